//! Keeps the machine busy beside what is soaked.

use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Threads of ordinary priority that calculate until this is dropped.
#[derive(Debug)]
pub struct Load {
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Load {
    /// Starts `count` threads.
    ///
    /// # Errors
    /// When the kernel refuses one; those that run end.
    pub fn start(count: u32) -> std::io::Result<Self> {
        let mut load = Self { ended: Arc::new(AtomicBool::new(false)), threads: Vec::new() };
        for _ in 0..count {
            let ended = Arc::clone(&load.ended);
            let busy = move || {
                let mut value = 1_u64;
                while !ended.load(Ordering::Relaxed) {
                    (0..10_000_u64).for_each(|step| value = black_box(value.wrapping_mul(3) ^ step));
                }
            };
            load.threads.push(std::thread::Builder::new().name("soak-load".to_owned()).spawn(busy)?);
        }
        Ok(load)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // It only calculates; were it to panic, nothing would be lost.
            let _ = thread.join();
        }
    }
}
