//! Work whose progress a service manager is told of.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use magsteer::daemon::{Notify, StopFlag};
use magsteer_hal::Stamp;

use super::ending::SetAtEnd;

/// How often the thread that tells looks at what has been done.
const POLL: Duration = Duration::from_millis(10);

/// Runs `work`, which counts in `progress`, while a thread tells the service manager how it goes.
pub fn managed<T>(stop: &StopFlag, progress: &AtomicU64, text: &str, work: impl FnOnce() -> T) -> T {
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut notify = Notify::from_environment();
            loop {
                // Looked at first: what was asked before the end is told in any case.
                let is_over = ended.load(Ordering::Acquire);
                if stop.requested().is_some() {
                    notify.stopping();
                }
                let count = progress.load(Ordering::Relaxed);
                if count > 0 {
                    notify.progress(Stamp::now(), count);
                    notify.status(text);
                }
                if is_over {
                    break;
                }
                std::thread::sleep(POLL);
            }
        });
        let _ended = SetAtEnd(&ended);
        work()
    })
}
