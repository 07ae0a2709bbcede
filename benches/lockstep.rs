//! Where the time of a lockstep run goes: `cargo bench --bench lockstep`.
//!
//! Plays the shipped experiment with the shipped rig on one core and prints, for each part of the cycle,
//! microseconds a simulated millisecond and its share. The parts: the plant (reading it advances it), the
//! controller's step, the rest of the loop (supervisor, gate, records), and what a campaign does beside it
//! (truth, judge, digest). Last the pace without the timers, by the processor time of the thread: what other
//! programs take is not in it. Nothing is asserted: machines differ.

use std::cell::Cell;
use std::ops::ControlFlow;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

use magsteer::config::{Config, Document, Experiment};
use magsteer::control::{Cycle, CycleInput, CycleOutcome, Step};
use magsteer::daemon::RunDigest;
use magsteer::daemon::lockstep::{Lockstep, PlayEnd, TimedTarget};
use magsteer_hal::{AdmittedCommand, Hardware, PoseMessage, Sensed, Stamp, WriteError};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};
use rustix::time::{ClockId, clock_gettime};

/// Plays of each kind; the fastest counts, since other work on the machine only adds.
const TURNS: usize = 3;

/// Time spent in a part so far.
type Spent = Rc<Cell<Duration>>;

fn timed<T>(spent: &Spent, work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let result = work();
    spent.set(spent.get() + begin.elapsed());
    result
}

struct TimedRig {
    rig: SimulatedRig,
    spent: Spent,
}

impl Hardware for TimedRig {
    fn read(&mut self, now: Stamp) -> Sensed {
        timed(&self.spent, || self.rig.read(now))
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        timed(&self.spent, || self.rig.write(command, now))
    }
}

struct TimedController {
    cycle: Cycle,
    spent: Spent,
}

impl Step for TimedController {
    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        timed(&self.spent, || self.cycle.step(input))
    }
}

/// The shipped rig and experiment.
struct Shipped {
    config: Config,
    plant: PlantConfig,
    steps: Vec<TimedTarget>,
}

impl Shipped {
    fn load(name: &str, experiment: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
        let (document, config) = Config::load(&folder.join(name)).expect("shipped");
        let plant = document.section("plant").expect("shipped");
        let experiment = Document::load(&folder.join("experiments").join(experiment)).expect("shipped");
        let experiment = Experiment::from_document(&experiment, &config.description).expect("shipped");
        let target = |step| experiment.target(step, &config.description);
        let steps = experiment.steps.iter();
        let steps = steps.map(|step| TimedTarget { target: target(step), duration: step.duration_s });
        Self { steps: steps.collect(), plant, config }
    }

    fn rate_hz(&self) -> f64 {
        self.config.daemon.as_ref().map_or(f64::NAN, |daemon| daemon.rate_hz)
    }

    fn rig(&self) -> SimulatedRig {
        let description = &self.config.description;
        SimulatedRig::new(self.plant.build(description).expect("shipped"), description)
    }

    fn controller(&self) -> Cycle {
        let control = self.config.control.as_ref().expect("has a controller");
        let manipulator = self.config.manipulator.clone().expect("has a model");
        Cycle::new(control, &self.config.description, manipulator)
    }

    /// Plays the experiment as a campaign does; returns simulated time (s), processor time, digest. `extra`
    /// counts what is done beside the loop.
    fn play<H: Hardware, S: Step>(
        &self,
        hardware: H,
        controller: S,
        truth: impl Fn(&H) -> PoseMessage,
        extra: Option<&Spent>,
    ) -> (f64, Duration, String) {
        let description = &self.config.description;
        let daemon = self.config.daemon.as_ref().expect("has a daemon");
        let mut lockstep = Lockstep::new(hardware, controller, description, daemon);
        let mut digest = RunDigest::new(description);
        let begin = processor_time();
        let truth = |hardware: &H| match extra {
            Some(spent) => timed(spent, || truth(hardware)),
            None => truth(hardware),
        };
        let played = lockstep.play(&self.steps, truth, |seen| {
            match extra {
                Some(spent) => timed(spent, || digest.take(seen.record, seen.truth)),
                None => digest.take(seen.record, seen.truth),
            }
            ControlFlow::Continue(())
        });
        let took = processor_time().saturating_sub(begin);
        assert_eq!(played.end, PlayEnd::Complete, "the shipped loop steers to the end");
        (lockstep.elapsed(), took, digest.finish())
    }

    /// Time of a play and of its parts, s: plant, controller, truth and digest.
    fn profile(&self) -> [f64; 4] {
        let [plant, controller, extra] = [(); 3].map(|()| Spent::default());
        let rig = TimedRig { rig: self.rig(), spent: Rc::clone(&plant) };
        let cycle = TimedController { cycle: self.controller(), spent: Rc::clone(&controller) };
        let begin = Instant::now();
        self.play(rig, cycle, |timed| timed.rig.plant().truth(), Some(&extra));
        [begin.elapsed(), plant.get(), controller.get(), extra.get()].map(|spent| spent.as_secs_f64())
    }
}

/// Processor time that this thread took so far.
fn processor_time() -> Duration {
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime)).unwrap_or_default()
}

fn main() {
    // Asked by `cargo test --benches`, which only wants to know that it runs.
    if std::env::args().any(|argument| argument == "--test" || argument == "--list") {
        return;
    }
    for (name, experiment) in [
        ("bigmag-planar.toml", "planar.toml"),
        ("bigmag-planar-camera.toml", "planar.toml"),
        ("bigmag-3d.toml", "pointing.toml"),
    ] {
        let shipped = Shipped::load(name, experiment);
        let plain = (0..TURNS)
            .map(|_| shipped.play(shipped.rig(), shipped.controller(), |rig| rig.plant().truth(), None));
        let plain: Vec<_> = plain.collect();
        let simulated = plain[0].0;
        assert!(plain.iter().all(|play| play.2 == plain[0].2), "every play is the same bit for bit");
        let fastest = plain.iter().map(|play| play.1).min().unwrap_or_default().as_secs_f64();
        let profiles = (0..TURNS).map(|_| shipped.profile());
        let [whole, plant, controller, extra] =
            profiles.min_by(|a, b| a[0].total_cmp(&b[0])).unwrap_or_default();
        let rest = whole - plant - controller - extra;
        println!("{name}: {simulated:.1} s simulated at {} Hz, digest {}", shipped.rate_hz(), plain[0].2);
        println!("{:<46}{:>18}{:>9}", "part", "us a simulated ms", "share");
        for (part, spent) in [
            ("plant", plant),
            ("controller", controller),
            ("truth and digest", extra),
            ("supervisor, gate, records, judge, timers", rest),
        ] {
            println!("{part:<46}{:>18.2}{:>7.1} %", spent * 1e3 / simulated, 100.0 * spent / whole);
        }
        println!(
            "without timers: {:.2} us, {:.1} times real time on one core\n",
            fastest * 1e3 / simulated,
            simulated / fastest
        );
    }
}
