//! Counts how often each thread allocates, so that a loop that is to allocate nothing can be held to it in
//! service too.
//!
//! Method: an allocator that hands every call to the system's and adds one to a number of the calling thread.
//! A program opts in:
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: magsteer::daemon::CountingAllocator = magsteer::daemon::CountingAllocator;
//! # let before = magsteer::daemon::allocations_of_thread();
//! # drop(std::hint::black_box(Box::new(1)));
//! # assert_eq!(magsteer::daemon::allocations_of_thread(), before + 1);
//! ```
//!
//! Costs one addition an allocation. In a program that did not opt in every count is 0, and [`is_counting`]
//! tells.
#![expect(unsafe_code, reason = "an allocator that counts has no safe form")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

thread_local! {
    static OF_THREAD: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting by thread. Giving memory back is not counted.
#[derive(Debug, Clone, Copy)]
pub struct CountingAllocator;

/// Allocations of the calling thread so far.
#[must_use]
pub fn allocations_of_thread() -> u64 {
    OF_THREAD.get()
}

/// True when this program counts: asked by allocating once.
#[must_use]
pub fn is_counting() -> bool {
    let before = allocations_of_thread();
    drop(black_box(Box::new(0_u8)));
    allocations_of_thread() > before
}

fn count() {
    // A thread that is ending has no number any more, and runs nothing that is counted.
    let _ = OF_THREAD.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches a number that needs neither
// allocation nor destruction.
unsafe impl GlobalAlloc for CountingAllocator {
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
