//! Time of the models and of the control cycle, of one core: `cargo bench --bench model`.
//!
//! Prints the distributions of divan first. Then a table of medians beside the times that they have to stay below and the median of the exact pass:
//! all of it taken turn by turn in one run, so that the ratios hold while the machine's speed does not. Then the exact Jacobian against the
//! paper's Algorithm 1, and how pass and cycle grow with magnets and coils. Last the error of the mesh that was timed.

mod algorithm;
mod mesh;
mod recorded;
#[path = "../../tests/rig_support/mod.rs"]
mod rig_support;
mod scaling;
mod subjects;
mod turns;

use divan::Bencher;
use subjects::Subject;
use turns::{Timed, timed};

/// Turns of every subject.
const TURNS: usize = 600;

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
    let mut calls: Vec<Timed> = Subject::ALL.iter().map(|subject| timed(subject.prepare())).collect();
    turns::medians(&mut calls, TURNS)
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
    println!();
    recorded::report();
    println!("For context: the paper's closed loop runs at 2 Hz.");
    algorithm::report();
    scaling::report();
    println!();
    mesh::report();
}
