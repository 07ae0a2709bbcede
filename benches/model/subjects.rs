//! What is timed.

use std::cell::Cell;
use std::fmt::{self, Display};
use std::path::Path;

use divan::black_box;
use magsteer::config::{Config, Document};
use magsteer::control::Step;
use magsteer::magnetics::{AppliedField, CoilArray, CoilPose, FieldSample, Multipole};
use magsteer::rod::{Manipulator, Pass, PassMode, TipLoad, Wrenches};
use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{CoilDescription, PartDescription};
use nalgebra::Vector3;

use crate::recorded::RECORDING;

const POINT: Vector3<f64> = Vector3::new(0.02, 0.01, -0.015);
/// Amperes that bend the shipped manipulator by tens of degrees.
const CURRENTS: [f64; 6] = [0.8, -0.6, 1.0, 0.4, -0.7, 0.5];
const ANGLES: [f64; 2] = [0.2, -0.3];
/// Step of the serial Jacobian's differences, A or rad.
const DIFFERENCE: f64 = 0.01;

/// One thing to time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    CoilField,
    ArrayField,
    ArrayPose,
    Pass,
    PassFrozen,
    PassPoses,
    SerialJacobian,
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
        Self::SerialJacobian,
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
            Self::SerialJacobian => "serial Jacobian: 8 re-solves under frozen wrenches",
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
            Self::SerialJacobian => serial_jacobian(&rig, manipulator),
            Self::CycleStep => cycle_step(),
            Self::PassEightMagnets => pass_eight_magnets(&rig),
        }
    }
}

/// The shipped rig.
pub fn shipped() -> (Document, Config) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    Config::load(&file).expect("the shipped file is valid")
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

/// The field that each magnet had, wherever it moves: with it a pass knows the wrenches of the paper's Algorithm 1.
struct Held {
    at_magnets: Vec<FieldSample>,
    next: Cell<usize>,
}

impl AppliedField for Held {
    fn parameter_count(&self) -> usize {
        0
    }

    /// A pass asks once a magnet, from base to tip.
    fn evaluate(&self, _: &Vector3<f64>, sample: &mut FieldSample) {
        let held = &self.at_magnets[self.next.get()];
        self.next.set((self.next.get() + 1) % self.at_magnets.len());
        sample.field = held.field;
        sample.gradient = held.gradient;
        sample.second_gradient = held.second_gradient;
        sample.valid = true;
    }
}

/// One re-solve a parameter, each from the present equilibrium: differences of the tangents.
fn serial_jacobian(rig: &HardwareDescription, manipulator: Manipulator) -> Box<dyn FnMut()> {
    let posed = CoilArray::new(rig).posed(&ANGLES);
    let field = posed.actuated(&CURRENTS);
    let mut pass = Pass::new(&manipulator);
    let found = manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
    assert!(found.converged(), "{found:?}");
    let unknowns = pass.unknowns();
    let tangents: Vec<Vector3<f64>> = pass.magnets().iter().map(|magnet| magnet.tangent()).collect();
    let present: Vec<FieldSample> = pass
        .magnets()
        .iter()
        .map(|magnet| {
            let mut sample = FieldSample::default();
            field.evaluate(&magnet.position(), &mut sample);
            sample.second_gradient = Default::default();
            sample
        })
        .collect();
    let parameters = field.parameter_count();
    let mut held = Held { at_magnets: present.clone(), next: Cell::new(0) };
    let mut jacobian = vec![Vector3::zeros(); parameters * tangents.len()];
    Box::new(move || {
        for parameter in 0..parameters {
            for (held, sample) in held.at_magnets.iter_mut().zip(&present) {
                let column = &sample.columns[parameter];
                held.field = sample.field + column.field * DIFFERENCE;
                held.gradient = sample.gradient;
                held.gradient += column.gradient * DIFFERENCE;
            }
            let found = manipulator.solve(&held, &TipLoad::NONE, &unknowns, PassMode::default(), &mut pass);
            assert!(found.converged(), "{found:?}");
            let rows = jacobian[parameter * tangents.len()..].iter_mut();
            for (entry, (magnet, tangent)) in rows.zip(pass.magnets().iter().zip(&tangents)) {
                *entry = (magnet.tangent() - tangent) / DIFFERENCE;
            }
        }
        black_box(&jacobian);
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
fn pass_eight_magnets(rig: &HardwareDescription) -> Box<dyn FnMut()> {
    let mut large = rig.clone();
    let parts = &rig.manipulator.parts;
    large.manipulator.parts = parts.iter().cycle().take(16).cloned().collect();
    for part in &mut large.manipulator.parts {
        if let PartDescription::Section(section) = part {
            section.length = 8e-3;
        }
    }
    large.coils = rig.coils.iter().cycle().take(32).cloned().collect::<Vec<CoilDescription>>();
    let (document, _) = shipped();
    let rod: magsteer::rod::RodConfig = document.section("rod").expect("shipped");
    let manipulator = rod.build(&large).expect("a valid rod");
    pass(&large, manipulator, PassMode::default())
}
