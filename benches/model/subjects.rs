//! What is timed.

use std::fmt::{self, Display};
use std::path::Path;

use divan::black_box;
use magsteer::config::{Config, Document};
use magsteer::control::Step;
use magsteer::magnetics::{AppliedField, CoilArray, CoilPose, FieldSample, Multipole};
use magsteer::rod::{Manipulator, Pass, PassMode, TipLoad, Wrenches};
use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{CoilDescription, PartDescription};
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::recorded::RECORDING;

const POINT: Vector3<f64> = Vector3::new(0.02, 0.01, -0.015);
/// Amperes that bend the shipped manipulator by tens of degrees.
pub const CURRENTS: [f64; 6] = [0.8, -0.6, 1.0, 0.4, -0.7, 0.5];
pub const ANGLES: [f64; 2] = [0.2, -0.3];

/// One thing to time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    CoilField,
    ArrayField,
    ArrayPose,
    Pass,
    PassFrozen,
    PassPoses,
    PassStability,
    CycleStep,
    PassEightMagnets,
}

impl Display for Subject {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.title())
    }
}

impl Subject {
    /// Every subject.
    pub const ALL: [Self; 9] = [
        Self::CoilField,
        Self::ArrayField,
        Self::ArrayPose,
        Self::Pass,
        Self::PassFrozen,
        Self::PassPoses,
        Self::PassStability,
        Self::CycleStep,
        Self::PassEightMagnets,
    ];

    /// What one call does.
    pub fn title(self) -> &'static str {
        match self {
            Self::CoilField => "field of one coil, both gradients",
            Self::ArrayField => "field of six coils, both gradients, columns of 8 parameters",
            Self::ArrayPose => "turning two frames with six coils",
            Self::Pass => "pass: statics, Newton step, Jacobian; 2 magnets, 8 parameters",
            Self::PassFrozen => "pass with frozen wrenches",
            Self::PassPoses => "pass with Jacobians of whole poses",
            Self::PassStability => "pass with margin of stability and unstable modes",
            Self::CycleStep => "control cycle, steering",
            Self::PassEightMagnets => "pass with 8 magnets, 32 coils and 2 frames",
        }
    }

    /// The time to stay below, s.
    pub fn bar(self) -> Option<f64> {
        match self {
            Self::CoilField => Some(80e-9),
            Self::Pass => Some(10e-6),
            Self::CycleStep => Some(30e-6),
            _ => None,
        }
    }

    /// A call of it.
    pub fn prepare(self) -> Box<dyn FnMut()> {
        let (_, config) = shipped();
        let rig = config.description;
        let manipulator = config.manipulator.expect("has a model");
        match self {
            Self::CoilField => coil_field(&rig),
            Self::ArrayField => array_field(&rig),
            Self::ArrayPose => array_pose(&rig),
            Self::Pass => pass(&rig, manipulator, PassMode::default()),
            Self::PassFrozen => {
                pass(&rig, manipulator, PassMode { poses: false, wrenches: Wrenches::Frozen })
            }
            Self::PassPoses => {
                pass(&rig, manipulator, PassMode { poses: true, wrenches: Wrenches::Following })
            }
            Self::PassStability => pass_stability(&rig, manipulator),
            Self::CycleStep => cycle_step(),
            Self::PassEightMagnets => pass_eight_magnets(),
        }
    }
}

/// The shipped rig.
pub fn shipped() -> (Document, Config) {
    read("bigmag-planar.toml")
}

/// A shipped rig.
pub fn load(file: &str) -> Config {
    read(file).1
}

fn read(file: &str) -> (Document, Config) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(file);
    Config::load(&path).expect("the shipped file is valid")
}

fn coil_field(rig: &HardwareDescription) -> Box<dyn FnMut()> {
    let coil = Multipole::new(&rig.coils[0].coefficients);
    let pose = CoilPose { origin: Vector3::new(-0.08, 0.0, -0.06), axis: Vector3::new(0.8, 0.0, 0.6) };
    Box::new(move || {
        let made = black_box(&coil).evaluate(black_box(&pose), black_box(&POINT));
        // By reference: the answer is made once, not copied.
        black_box(&made);
    })
}

fn array_field(rig: &HardwareDescription) -> Box<dyn FnMut()> {
    let posed = CoilArray::new(rig).posed(&ANGLES);
    let mut sample = FieldSample::default();
    Box::new(move || {
        black_box(&posed).actuated(black_box(&CURRENTS)).evaluate(black_box(&POINT), &mut sample);
        black_box(&sample);
    })
}

fn array_pose(rig: &HardwareDescription) -> Box<dyn FnMut()> {
    let array = CoilArray::new(rig);
    let mut posed = array.posed(&ANGLES);
    Box::new(move || {
        array.pose_into(black_box(&ANGLES), &mut posed);
        black_box(&posed);
    })
}

fn pass(rig: &HardwareDescription, manipulator: Manipulator, mode: PassMode) -> Box<dyn FnMut()> {
    let posed = CoilArray::new(rig).posed(&ANGLES);
    let mut pass = Pass::new(&manipulator);
    let load = TipLoad::NONE;
    let found =
        manipulator.solve_from_rest(&posed.actuated(&CURRENTS), &load, PassMode::default(), &mut pass);
    assert!(found.converged(), "{found:?}");
    let unknowns = pass.unknowns();
    Box::new(move || {
        let field = black_box(&posed).actuated(black_box(&CURRENTS));
        manipulator.pass(&field, &load, black_box(&unknowns), mode, &mut pass);
        black_box(&pass);
    })
}

/// Under currents that change by a thousandth from call to call, as they do from cycle to cycle.
fn pass_stability(rig: &HardwareDescription, manipulator: Manipulator) -> Box<dyn FnMut()> {
    let posed = CoilArray::new(rig).posed(&ANGLES);
    let mut pass = Pass::new(&manipulator);
    let (load, mode) = (TipLoad::NONE, PassMode::default());
    let found = manipulator.solve_from_rest(&posed.actuated(&CURRENTS), &load, mode, &mut pass);
    assert!(found.converged(), "{found:?}");
    let unknowns = pass.unknowns();
    let currents = [CURRENTS, CURRENTS.map(|current| 1.001 * current)];
    let mut turn = 0;
    Box::new(move || {
        turn = 1 - turn;
        let field = black_box(&posed).actuated(black_box(&currents[turn]));
        manipulator.pass(&field, &load, black_box(&unknowns), mode, &mut pass);
        black_box(manipulator.stability(&mut pass));
    })
}

/// Steps through a recorded closed loop, to its end and back again, so that the actuation never jumps.
fn cycle_step() -> Box<dyn FnMut()> {
    let inputs = &RECORDING.steering;
    let mut cycle = RECORDING.controller();
    let turn = 2 * inputs.len();
    let mut count = 0;
    Box::new(move || {
        let index = if count < inputs.len() { count } else { turn - 1 - count };
        count = (count + 1) % turn;
        black_box(cycle.step(black_box(&inputs[index])));
    })
}

/// Eight short sections with a magnet each, within 32 coils: the greatest rig that the messages hold.
fn pass_eight_magnets() -> Box<dyn FnMut()> {
    let large = enlarged(8, 32);
    pass(&large.description, large.manipulator.expect("has a model"), PassMode::default())
}

/// The shipped coils again and again, each time turned about the workspace's z axis by some more, so that no two are alike.
fn turned(bigmag: &[CoilDescription], index: usize) -> CoilDescription {
    let mut coil = bigmag[index % bigmag.len()].clone();
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3 * (index / bigmag.len()) as f64);
    coil.position = (turn * Vector3::from(coil.position)).into();
    let rotation = turn * Matrix3::from_fn(|row, column| coil.rotation[row][column]);
    coil.rotation = [0, 1, 2].map(|row| [0, 1, 2].map(|column| rotation[(row, column)]));
    coil
}

/// The shipped rig with so many short sections with a magnet each, within so many coils; weightless, since eight magnets would hang
/// out of the field's range.
pub fn enlarged(magnets: usize, coils: usize) -> Config {
    let (document, mut large) = shipped();
    let parts = large.description.manipulator.parts.clone();
    large.description.manipulator.parts = parts.into_iter().cycle().take(2 * magnets).collect();
    for part in &mut large.description.manipulator.parts {
        if let PartDescription::Section(section) = part {
            section.length = 8e-3;
        }
    }
    large.description.gravity = [0.0; 3];
    let bigmag = large.description.coils.clone();
    large.description.coils = (0..coils).map(|index| turned(&bigmag, index)).collect();
    let rod: magsteer::rod::RodConfig = document.section("rod").expect("shipped");
    large.manipulator = Some(rod.build(&large.description).expect("a valid rod"));
    large
}
