//! Goal: a plant's step allocates nothing, whichever sensor is mounted, exposures and reconstructions
//! included.
//!
//! Method: a global allocator counts per thread while steps run.
#![expect(unsafe_code, reason = "an allocator that counts has no safe form")]

#[path = "../src/fixture.rs"]
mod fixture;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use magsteer_sim_plant::PlantConfig;
use serde_json::json;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

fn count() {
    // A thread that is ending has no counter any more, and runs no step.
    let _ = ALLOCATIONS.try_with(|allocations| allocations.set(allocations.get() + 1));
}

// SAFETY: every call goes to the system's allocator unchanged; counting touches a thread-local number that
// needs neither allocation nor destruction.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
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

#[test]
fn steps_with_exposures_allocate_nothing() {
    for sensor in ["tracker", "camera", "fibre"] {
        for polynomial in [false, true] {
            let mut tables = fixture::plant_tables();
            tables["sensor"] = json!(sensor);
            tables["sensors"]["camera"]["point_cloud"]["rate_hz"] = json!(120.0);
            if polynomial {
                tables["sensors"]["camera"]["point_cloud"]["centreline"] =
                    json!({"polynomial": {"degree": 6}});
            }
            let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
            let mut plant = config.build(&fixture::bigmag()).expect("valid");
            let before = ALLOCATIONS.get();
            let mut messages = 0;
            for _ in 0..400 {
                plant.advance();
                while plant.take_pose().is_some() {
                    messages += 1;
                }
            }
            assert_eq!(ALLOCATIONS.get() - before, 0, "{sensor}");
            assert!(messages > 10, "{sensor}: {messages}");
        }
    }
}
