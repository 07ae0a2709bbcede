//! When a long-running command is told to end: by a signal, or because whoever started it is gone.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use magsteer::daemon::StopFlag;
use magsteer::daemon::kernel::Signals;

use super::exit::Exit;
use super::output;

/// Noted in place of a signal when standard input closed; no signal has this number.
const STDIN_CLOSED: i32 = 1_000;
/// How often the thread that takes signals looks whether the work has ended.
const SIGNAL_POLL: Duration = Duration::from_millis(50);

/// Runs `work` while SIGINT, SIGTERM, SIGHUP and, with `end_with_stdin`, the end of standard input are noted in `stop` and
/// handed to `ask`.
///
/// # Errors
/// When the kernel refuses the signal mask or a thread.
pub fn watching<T>(
    stop: &Arc<StopFlag>,
    end_with_stdin: bool,
    ask: impl Fn() + Clone + Send + Sync + 'static,
    work: impl FnOnce() -> T,
) -> anyhow::Result<T> {
    // Blocked here, before any thread starts, and so in all of them.
    let signals = Signals::block()?;
    if end_with_stdin {
        watch_stdin(Arc::clone(stop), ask.clone())?;
    }
    let ended = AtomicBool::new(false);
    Ok(std::thread::scope(|scope| {
        scope.spawn(|| {
            while !ended.load(Ordering::Acquire) {
                if let Some(signal) = signals.wait(SIGNAL_POLL) {
                    stop.request(signal);
                    ask();
                }
            }
        });
        let _ended = SetAtEnd(&ended);
        work()
    }))
}

/// Sets its flag when it goes, by a panic too: threads of a scope that wait for it must not wait for ever.
pub struct SetAtEnd<'a>(pub &'a AtomicBool);

impl Drop for SetAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// How a command ends that was asked to.
pub fn exit_of(stop: &StopFlag) -> Exit {
    match stop.requested() {
        Some(libc::SIGINT) => Exit::Interrupted,
        Some(libc::SIGTERM | libc::SIGHUP) => Exit::Terminated,
        _ => Exit::Success,
    }
}

/// The same once its result was told. When nobody took that, as when a terminal closed, the end by a signal is still what
/// it is: that it ramped down says more than that its words were lost.
///
/// # Errors
/// What kept the result from being told, of a command that ended by itself; a reader that went away does not.
pub fn exit_told(stop: &StopFlag, told: anyhow::Result<()>) -> anyhow::Result<Exit> {
    match (exit_of(stop), output::told(told)) {
        (Exit::Success, Err(error)) => Err(error),
        (exit, told) => {
            told.unwrap_or_else(|error| output::error(format_args!("{error:#}")));
            Ok(exit)
        }
    }
}

/// The thread waits at standard input until it closes, or until the process ends.
fn watch_stdin(stop: Arc<StopFlag>, ask: impl Fn() + Send + 'static) -> std::io::Result<()> {
    let watch = move || {
        // Whether it ended or failed, nobody is there any more.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        stop.request(STDIN_CLOSED);
        ask();
    };
    std::thread::Builder::new().name("magsteer-stdin".to_owned()).spawn(watch).map(drop)
}
