//! An allocator that hands every call to the system's and counts: for each thread, and on request for all of them.
//!
//! A test that names this module counts in its whole process.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]
#![expect(unsafe_code, reason = "an allocator that counts has no safe form")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

thread_local! {
    static OF_THREAD: Cell<u64> = const { Cell::new(0) };
}

static COUNTS_EVERYWHERE: AtomicBool = AtomicBool::new(false);
static EVERYWHERE: AtomicU64 = AtomicU64::new(0);

struct Counting;

fn count() {
    // A thread that is ending has no counter any more, and runs nothing that counts.
    let _ = OF_THREAD.try_with(|count| count.set(count.get() + 1));
    if COUNTS_EVERYWHERE.load(Ordering::Relaxed) {
        EVERYWHERE.fetch_add(1, Ordering::Relaxed);
    }
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches numbers that need neither
// allocation nor destruction.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `work` returns, and the allocations of this thread meanwhile.
pub fn allocations_in<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let before = OF_THREAD.get();
    let result = work();
    (result, OF_THREAD.get() - before)
}

/// Allocations of all threads during `work`. The only test of its process must ask: others would count too.
pub fn allocations_everywhere(work: impl FnOnce()) -> u64 {
    let before = EVERYWHERE.load(Ordering::SeqCst);
    COUNTS_EVERYWHERE.store(true, Ordering::SeqCst);
    work();
    COUNTS_EVERYWHERE.store(false, Ordering::SeqCst);
    EVERYWHERE.load(Ordering::SeqCst) - before
}
