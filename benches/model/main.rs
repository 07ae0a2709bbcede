//! Time of the models and of the control cycle, of one core: `cargo bench --bench model`.
//!
//! Prints the distributions of divan first. Then a table of medians beside the times that they have to stay below and the median of the exact pass:
//! all of it taken turn by turn in one run, so that the ratios hold while the machine's speed does not. Last the error of the mesh
//! that was timed.

mod mesh;
mod recorded;
#[path = "../../tests/rig_support/mod.rs"]
mod rig_support;
mod subjects;

use std::time::{Duration, Instant};

use divan::Bencher;
use subjects::Subject;

/// Turns of every subject.
const TURNS: usize = 600;
/// Length of one turn.
const TURN: Duration = Duration::from_micros(300);

/// What the paper's authors report of their own programs; another machine and another language, for context alone.
const PAPER: [&str; 2] =
    ["the paper's model and serial Jacobian take 158 ms", "the paper's closed loop runs at 2 Hz"];

#[divan::bench(args = Subject::ALL)]
fn model(bencher: Bencher, subject: Subject) {
    let call = subject.prepare();
    bencher.bench_local(call);
}

fn main() {
    divan::main();
    let listing = std::env::args().any(|argument| argument == "--list" || argument == "--test");
    if !listing {
        table();
    }
}

/// Median time of one call of each subject, s.
fn medians() -> Vec<f64> {
    let mut calls: Vec<_> = Subject::ALL.iter().map(|subject| subject.prepare()).collect();
    let batches: Vec<u32> = calls.iter_mut().map(|call| batch(call.as_mut())).collect();
    let mut times = vec![Vec::with_capacity(TURNS); calls.len()];
    for _ in 0..TURNS {
        for ((call, &batch), times) in calls.iter_mut().zip(&batches).zip(&mut times) {
            times.push(mean(call.as_mut(), batch));
        }
    }
    times.into_iter().map(median).collect()
}

/// Calls that fill a turn.
fn batch(call: &mut dyn FnMut()) -> u32 {
    mean(call, 20);
    let single = mean(call, 20);
    ((TURN.as_secs_f64() / single) as u32).max(1)
}

fn mean(call: &mut dyn FnMut(), calls: u32) -> f64 {
    let start = Instant::now();
    for _ in 0..calls {
        call();
    }
    start.elapsed().as_secs_f64() / f64::from(calls)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn table() {
    let medians = medians();
    let of = |wanted: Subject| {
        let index = Subject::ALL.iter().position(|subject| *subject == wanted);
        index.map_or(f64::NAN, |index| medians[index])
    };
    println!("\n{:<74}{:>11}{:>11}{:>10}{:>10}", "median of one call", "us", "bar us", "of bar", "of pass");
    for (subject, median) in Subject::ALL.iter().zip(&medians) {
        let (bar, share) = subject.bar().map_or((String::new(), String::new()), |bar| {
            (format!("{:.2}", bar * 1e6), format!("{:.2}", median / bar))
        });
        let relative = median / of(Subject::Pass);
        println!("{:<74}{:>11.3}{bar:>11}{share:>10}{relative:>10.3}", subject.title(), median * 1e6);
    }
    println!(
        "\nExact Jacobian of the tangents in one pass: {:.1} times faster than one re-solve a parameter.",
        of(Subject::SerialJacobian) / of(Subject::Pass)
    );
    recorded::report();
    println!("For context: {}.", PAPER.join("; "));
    mesh::report();
}
