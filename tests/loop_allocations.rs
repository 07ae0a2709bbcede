//! Goal: a daemon tells how often its loop allocates, in service and not in tests alone, and does not blame
//! it for the transport's one allocation a message.

use magsteer::control::{CycleInput, CycleOutcome, Step};
use magsteer::daemon::{
    ControlLoop, CountingAllocator, DaemonConfig, LoopCounters, LoopEnd, LoopOptions, LoopRings, Request,
    Statistics, StopFlag, Verb, allocations_of_thread, is_counting, run_loop,
};
use magsteer_hal::scripted::{EchoHardware, example_description};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Cycles until the daemon is asked to end: a tenth of a second.
const CYCLES: u32 = 100;

/// Allocates so often in each cycle in which it steers.
struct Wasteful<'a> {
    allocations: u32,
    cycles: u32,
    /// Cycles in which it steered.
    steered: &'a mut u64,
    stop: &'a StopFlag,
}

impl Step for Wasteful<'_> {
    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        self.cycles += 1;
        if self.cycles == CYCLES {
            self.stop.request(1);
        }
        if input.engaged {
            *self.steered += 1;
            (0..self.allocations).for_each(|_| drop(std::hint::black_box(Box::new(0_u8))));
        }
        CycleOutcome::asking_for(input.admitted)
    }
}

/// A loop that is armed and steers from its first cycles on; how it ended, and in how many cycles it steered.
fn run(allocations: u32) -> (LoopEnd, u64) {
    let description = example_description();
    let table: toml::Table = include_str!("../config/bigmag-planar.toml").parse().expect("shipped");
    let config: DaemonConfig = table["daemon"].clone().try_into().expect("shipped");
    let (mut requests, request_out) = rtrb::RingBuffer::new(64);
    let (answer_in, _answers) = rtrb::RingBuffer::new(64);
    let (record_in, _records) = rtrb::RingBuffer::new(4_096);
    let rings = LoopRings { requests: request_out, answers: answer_in, records: record_in };
    // One a cycle; those that come too early are refused.
    for id in 0..30 {
        let verb = if id % 2 == 0 { Verb::Arm } else { Verb::Go };
        requests.push(Request { id, verb }).expect("room for all");
    }
    let (stop, mut steered) = (StopFlag::new(), 0);
    let controller = Wasteful { allocations, cycles: 0, steered: &mut steered, stop: &stop };
    let hardware = EchoHardware::new(&description);
    let control_loop = ControlLoop::new(hardware, controller, &description, &config, LoopOptions::default());
    let (statistics, counters) = (Statistics::new(config.rate_hz), LoopCounters::default());
    let end = run_loop(control_loop, config.pace(), statistics, rings, &counters, &stop);
    (end, steered)
}

#[test]
fn this_program_counts_by_thread() {
    assert!(is_counting());
    let before = allocations_of_thread();
    std::thread::scope(|scope| {
        let other = scope.spawn(|| {
            let before = allocations_of_thread();
            let kept = std::hint::black_box(vec![1_u8; 100]);
            (allocations_of_thread() - before, kept.len())
        });
        assert_eq!(other.join().expect("it allocates once"), (1, 100));
    });
    let mut kept = std::hint::black_box(Vec::with_capacity(1));
    let here = allocations_of_thread();
    kept.extend([1_u8, 2, 3]);
    assert_eq!(allocations_of_thread() - here, 1, "growing is one more");
    assert!(here > before);
}

/// Proves SR-19.
#[test]
fn what_a_loop_allocates_beyond_one_a_message_is_counted_and_told_at_its_end() {
    for (allocations, blamed) in [(0, 0), (1, 0), (3, 2)] {
        let (end, steered) = run(allocations);
        assert!(steered > 30, "{steered} cycles: {end:?}");
        assert_eq!(end.allocations, blamed * steered, "{allocations} a cycle, {steered} cycles");
        let binned = [&end.histograms.lateness_us, &end.histograms.execution_us];
        let counts = binned.map(|bins| bins.iter().map(|bin| bin.cycles).sum::<u64>());
        assert_eq!(counts, [end.timing.cycles; 2]);
    }
}
