//! A driver of ideal hardware: amplifiers and motors of first order, a rod that does not move.
//!
//! Replace what is marked HARDWARE, one method after the other, and keep `magsteer hal conformance` passing.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use magsteer_hal::binding::RigSheet;
use magsteer_hal::channels::Endpoint;
use magsteer_hal::config::HardwareConfig;
use magsteer_hal::driver::{Device, Measurement, run};
use magsteer_hal::{Actuation, HardwareDescription, PoseMessage, Stamp};

/// Of the driver's loop.
const PERIOD: Duration = Duration::from_millis(1);
const POSE_PERIOD: Duration = Duration::from_millis(5);
/// Of the amplifiers' current control.
const TIME_CONSTANT_S: f64 = 0.002;

/// Follows set points with a lag; its sensor sees the straight rod.
struct IdealHardware {
    measured: Actuation,
    rod: PoseMessage,
    seen: Stamp,
}

impl IdealHardware {
    fn new(description: &HardwareDescription) -> Self {
        let mut rod = PoseMessage::default();
        for (pose, magnet) in rod.magnets.iter_mut().zip(RigSheet::of(description).magnets) {
            pose.position_m = magnet.position_m;
            pose.orientation_xyzw = magnet.orientation_xyzw;
            pose.valid = 1;
            rod.magnet_count += 1;
        }
        Self { measured: Actuation::default(), rod, seen: Stamp::default() }
    }
}

impl Device for IdealHardware {
    fn follow(&mut self, setpoint: &Actuation, period_s: f64) {
        // HARDWARE: send the set points to your amplifiers (A) and motors (rad) here.
        let share = 1.0 - (-period_s / TIME_CONSTANT_S).exp();
        for (measured, wanted) in self.measured.current_a.iter_mut().zip(&setpoint.current_a) {
            *measured += share * (wanted - *measured);
        }
        self.measured.angle_rad = setpoint.angle_rad;
    }

    fn cut(&mut self) {
        // HARDWARE: take the enable line of your amplifiers away here.
        self.measured.current_a.fill(0.0);
    }

    fn measure(&mut self) -> Option<Measurement> {
        // HARDWARE: read your current sensors (A), encoders (rad) and fault lines here.
        Some(Measurement { stamp: Stamp::now(), actuation: self.measured, fault: 0 })
    }

    fn poses(&mut self) -> Option<PoseMessage> {
        // HARDWARE: hand over the newest poses of your tracker here, with the stamp of their exposure.
        let now = Stamp::now();
        if now.since(self.seen) < POSE_PERIOD {
            return None;
        }
        self.seen = now;
        self.rod.header.source_stamp_ns = now.nanoseconds();
        Some(self.rod)
    }
}

/// `driver [--root DIR] [--rig FILE]`
fn main() -> Result<(), Box<dyn Error>> {
    let mut root: Option<PathBuf> = None;
    let mut rig = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/rig.toml"));
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{argument} needs a value"))?;
        match argument.as_str() {
            "--root" => root = Some(value.into()),
            "--rig" => rig = value.into(),
            _ => return Err(format!("{argument}: only --root DIR and --rig FILE are known").into()),
        }
    }
    let config: HardwareConfig = toml::from_str(&std::fs::read_to_string(&rig)?)?;
    let description = config.build().map_err(|invalid| format!("{}: {invalid:?}", rig.display()))?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))?;
    let endpoint = Endpoint::new(&description.rig, root.as_deref())?;
    let mut hardware = IdealHardware::new(&description);
    println!("driver of {} is running", description.rig);
    let summary = run(&description, &endpoint, &mut hardware, PERIOD, &stop)?;
    println!("ended; {} commands refused, {} beyond a limit", summary.commands_refused, summary.limit_breaks);
    Ok(())
}
