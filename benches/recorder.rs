//! What the flight recorder costs: `cargo bench --bench recorder`.
//!
//! The loop's thread hands its record on with or without a recorder; the first numbers are that hand-over,
//! beside the cycle itself. The others are the telemetry thread's: encoding a record into the ring, while
//! nothing and while a flight is written. Nothing is judged: machines differ.

use std::path::Path;
use std::time::{Duration, Instant};

use magsteer::config::{Config, Problems};
use magsteer::control::Cycle;
use magsteer::daemon::recorder::{Recorder, RecorderConfig, RecorderPlan};
use magsteer::daemon::{ControlLoop, CycleRecord, LoopOptions, Request, Tick, Verb};
use magsteer_hal::operator::state;
use magsteer_hal::scripted::EchoHardware;
use magsteer_hal::{MagnetPose, Stamp};

const CYCLES: u32 = 30_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    let (document, config) = Config::load(&file)?;
    println!("a cycle's record: {} bytes in the loop's ring", size_of::<CycleRecord>());
    let records = cycles(&document, &config)?;
    take(&document, &config, &records)
}

/// Half of the times are shorter, and 99 of 100.
fn quantiles(times: &mut [Duration]) -> String {
    if times.is_empty() {
        return "none".to_owned();
    }
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_nanos();
    format!("p50 {} ns, p99 {} ns", at(0.5), at(0.99))
}

/// Times cycles that steer, alone and with the hand-over; returns their records.
fn cycles(document: &magsteer::config::Document, config: &Config) -> Result<Vec<CycleRecord>, Problems> {
    let rig = &config.description;
    let daemon = document.require("daemon", &config.daemon)?;
    let control = document.require("control", &config.control)?;
    let rod = document.require("rod", &config.manipulator)?;
    let controller = Cycle::new(control, rig, rod.clone());
    let options = LoopOptions::default();
    let mut hardware = EchoHardware::new(rig);
    // About where both magnets hang without current: 112 deg from z, in the plane.
    let (sine, cosine) = 56_f64.to_radians().sin_cos();
    let pose = MagnetPose { orientation_xyzw: [0.0, sine, 0.0, cosine], valid: 1, ..MagnetPose::default() };
    hardware.set_poses(&[pose; 2]);
    let mut control_loop = ControlLoop::new(hardware, controller, rig, daemon, options);
    let (mut to_telemetry, mut from_loop) = rtrb::RingBuffer::new(500);
    let mut tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
    let (mut alone, mut pushed, mut records) = (Vec::new(), Vec::new(), Vec::new());
    for cycle in 0..CYCLES {
        // Asked again and again: an echo of commands is no rod, and what it does may trip the loop.
        let verb = match record_state(&records) {
            state::IDLE if cycle > 50 => Some(Verb::Arm),
            state::ARMED => Some(Verb::Go),
            state::FAULT => Some(Verb::Reset),
            _ => None,
        };
        // One request a cycle, as here, is never refused.
        let _ = verb.map(|verb| control_loop.request(Request { id: cycle, verb }));
        tick = tick.stepped(daemon.period());
        let begin = Instant::now();
        let record = control_loop.cycle(tick);
        let computed = Instant::now();
        let full = to_telemetry.push(record).is_err();
        let handed_on = Instant::now();
        assert!(!full, "it is emptied below");
        if record.input.engaged {
            alone.push(computed - begin);
        }
        pushed.push(handed_on - computed);
        records.extend(from_loop.pop());
    }
    println!("cycle alone, {} that steered: {}", alone.len(), quantiles(&mut alone));
    println!("hand-over to the telemetry thread, with or without a recorder: {}", quantiles(&mut pushed));
    Ok(records)
}

/// State after the newest cycle.
fn record_state(records: &[CycleRecord]) -> u32 {
    records.last().map_or(state::BOOT, |record| record.decision.state)
}

/// Times the recorder.
fn take(
    document: &magsteer::config::Document,
    config: &Config,
    records: &[CycleRecord],
) -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let recorder = RecorderConfig { folder: folder.path().to_owned(), seconds: 10.0, flights_max: 10 };
    let plan = RecorderPlan { config: recorder, config_sha256: document.resolved().sha256 };
    let mut recorder = Recorder::start(&plan, &config.description, 1_000.0)?;
    let time = |recorder: &mut Recorder| -> Vec<Duration> {
        let timed = records.iter().map(|record| {
            let begin = Instant::now();
            recorder.take(record);
            begin.elapsed()
        });
        timed.collect()
    };
    let mut quiet = time(&mut recorder);
    println!("encoding a record into the ring: {}", quantiles(&mut quiet));
    if recorder.order().is_ok() {
        println!("the same while a flight is written: {}", quantiles(&mut time(&mut recorder)));
    }
    let begin = Instant::now();
    recorder.end();
    println!("end, with another flight of 10.5 s: {:.0} ms", begin.elapsed().as_secs_f64() * 1e3);
    Ok(())
}
