//! `magsteer target joystick`: targets from a hand.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use evdev::{AbsoluteAxisCode, Device, KeyCode};
use magsteer::control::ReferenceTarget;
use magsteer::daemon::StopFlag;
use magsteer_hal::HardwareDescription;
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::{OperatorRequest, cause, state, verb};
use nalgebra::{Unit, Vector3};

use super::command::await_status;
use super::hand::{Grip, Hand, Order, Stick};
use crate::cli::actuation::{Numbers, finite};
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::{connect, send, target_request};
use crate::cli::output;
use crate::cli::rig_file::RigArgs;

/// Time between two looks at the device.
const PERIOD: Duration = Duration::from_millis(20);
/// How long a target is valid: ten looks.
const VALID_MS: u32 = 200;
/// Axes of the left and of the right stick.
const AXES: [[AbsoluteAxisCode; 2]; 2] = [
    [AbsoluteAxisCode::ABS_X, AbsoluteAxisCode::ABS_Y],
    [AbsoluteAxisCode::ABS_RX, AbsoluteAxisCode::ABS_RY],
];

/// Steer by a joystick or gamepad, as long as its dead-man button is held.
///
/// The left stick turns the first magnet named, the right stick the second: up and down about the axis, left and right towards it and
/// away from it. Letting the button go holds; pressing it goes on from where the magnets are. When this program, the device or its
/// cable dies the daemon holds by itself after 0.2 s. The daemon must be steering (`arm`, `go`).
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer target joystick --device /dev/input/event5 --magnets m1,m2 --speed-deg-s 15"
)]
pub struct Joystick {
    /// The device; the first with two axes and the button when left out.
    #[arg(long, value_name = "PATH")]
    device: Option<PathBuf>,
    /// Button that must be held, by its name in linux/input-event-codes.h.
    #[arg(long, value_name = "KEY", default_value = "BTN_TR")]
    dead_man: KeyCode,
    /// Magnets of the left and of the right stick; the first two of the rig when left out.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', num_args = 1..=2)]
    magnets: Vec<String>,
    /// Speed at full deflection, deg/s, above 0 and at most 180.
    #[arg(long, value_name = "DEG/S", default_value = "20", value_parser = speed)]
    speed_deg_s: f64,
    /// Axis of up and down, world; right-handed.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,1,0", allow_hyphen_values = true)]
    axis: Numbers<3>,
    #[command(flatten)]
    rig: RigArgs,
}

impl Joystick {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let rig = self.rig.load(None)?.description;
        let axis = Unit::try_new(Vector3::from(self.axis.0), 1e-9);
        let axis = axis.ok_or_else(|| Failure::usage("--axis: must be finite and not zero"))?;
        let hand = Hand::new(axis, self.speed_deg_s.to_radians(), self.chosen(&rig)?);
        let device = self.open()?;
        let mut client = connect(&self.rig, None)?;
        let status = await_status(&mut client)?;
        if !matches!(status.state, state::ACTIVE | state::HOLDING) {
            let state = state::name(status.state);
            let message = anyhow!("the daemon is {state}: arm it and let it go before steering by hand");
            return Err(Failure::with(Exit::No, message));
        }
        output::note(format_args!(
            "{}: hold {:?} to steer, let go to hold; Ctrl-C ends",
            device.name().unwrap_or("device"),
            self.dead_man
        ));
        let stop = Arc::new(StopFlag::new());
        watching(&stop, false, || (), || self.serve(&mut client, &device, hand, &rig, &stop))??;
        Ok(exit_of(&stop))
    }

    /// Indices of the magnets of both sticks.
    fn chosen(&self, rig: &HardwareDescription) -> anyhow::Result<[Option<usize>; 2]> {
        let names: Vec<&str> = rig.magnets().map(|magnet| magnet.name.as_str()).collect();
        let index = |name: &String| {
            let found = names.iter().position(|known| known == name);
            let known = names.join(", ");
            found.ok_or_else(|| Failure::usage(format_args!("--magnets: {name}: must be one of {known}")))
        };
        if self.magnets.is_empty() {
            return Ok([0, 1].map(|index| (index < names.len()).then_some(index)));
        }
        let mut chosen = [None; 2];
        for (place, name) in chosen.iter_mut().zip(&self.magnets) {
            *place = Some(index(name)?);
        }
        Ok(chosen)
    }

    fn open(&self) -> anyhow::Result<Device> {
        if let Some(path) = &self.device {
            let device = Device::open(path).map_err(|error| refuse(path, &error.to_string()))?;
            return if self.fits(&device) {
                Ok(device)
            } else {
                Err(refuse(path, &format!("has not both ABS_X, ABS_Y and {:?}", self.dead_man)))
            };
        }
        let found = evdev::enumerate().map(|(_, device)| device).find(|device| self.fits(device));
        found.ok_or_else(|| {
            let message = anyhow!(
                "no device below /dev/input has ABS_X, ABS_Y and {:?}: connect one, name it by --device, or join the group `input`",
                self.dead_man
            );
            Failure::with(Exit::NoInput, message)
        })
    }

    fn fits(&self, device: &Device) -> bool {
        let has_axes = device
            .supported_absolute_axes()
            .is_some_and(|axes| AXES[0].iter().all(|axis| axes.contains(*axis)));
        has_axes && device.supported_keys().is_some_and(|keys| keys.contains(self.dead_man))
    }

    /// Looks at the device again and again, until it or the program ends.
    fn serve(
        &self,
        client: &mut OperatorClient,
        device: &Device,
        mut hand: Hand,
        rig: &HardwareDescription,
        stop: &StopFlag,
    ) -> anyhow::Result<()> {
        let mut status = await_status(client)?;
        let verb = |verb: u32| OperatorRequest { verb, ..OperatorRequest::default() };
        while stop.requested().is_none() {
            std::thread::sleep(PERIOD);
            status = client.newest_status(magsteer_hal::Stamp::now()).unwrap_or(status);
            let grip = self.grip(device).map_err(|error| {
                // The daemon holds by itself; this is sooner.
                let _ = send(client, verb(verb::HOLD));
                Failure::with(Exit::Io, anyhow!("the device is gone: {error}"))
            })?;
            let order = hand.order(&grip, &status.measured_direction, PERIOD.as_secs_f64());
            let (target, goes) = match order {
                Order::Nothing => continue,
                Order::LetGo => {
                    send(client, verb(verb::HOLD))?;
                    continue;
                }
                Order::Take(target) => (target, status.state == state::HOLDING),
                Order::Steer(target) => (target, false),
            };
            let target = ReferenceTarget::from(target);
            let streamed = OperatorRequest { valid_ms: VALID_MS, ..target_request(&target, rig) };
            for request in std::iter::once(streamed).chain(goes.then(|| verb(verb::GO))) {
                let answer = send(client, request)?;
                if answer.accepted != 1 {
                    output::note(format_args!("refused: {}", cause::text(answer.cause)));
                    // Without its target the daemon must not go on: it would go to the one before.
                    break;
                }
            }
        }
        let _ = send(client, verb(verb::HOLD));
        Ok(())
    }

    /// What the device says now.
    fn grip(&self, device: &Device) -> std::io::Result<Grip> {
        let mut grip = Grip { held: device.get_key_state()?.contains(self.dead_man), ..Grip::default() };
        for (code, info) in device.get_absinfo()? {
            let half = f64::from(info.maximum() - info.minimum()) / 2.0;
            let centre = f64::from(info.maximum() + info.minimum()) / 2.0;
            let deflection = if half > 0.0 { (f64::from(info.value()) - centre) / half } else { 0.0 };
            for (stick, axes) in grip.sticks.iter_mut().zip(AXES) {
                let Stick { x, y } = stick;
                let place = if code == axes[0] {
                    x
                } else if code == axes[1] {
                    y
                } else {
                    continue;
                };
                *place = deflection;
            }
        }
        Ok(grip)
    }
}

fn refuse(path: &Path, why: &str) -> anyhow::Error {
    Failure::with(Exit::NoInput, anyhow!("{}: {why}: must be a joystick or gamepad", path.display()))
}

/// Speed, deg/s.
fn speed(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 && value <= 180.0 { Ok(value) } else { Err("must be above 0 and at most 180".to_owned()) }
}
