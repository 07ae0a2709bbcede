//! One cycle: what it asks for before it may steer, when it begins, and when it is given nonsense.

use magsteer_hal::{Actuation, MAGNETS_MAX, MagnetPose, PoseMessage};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::fixtures::{Rig, any_size, numbers, seeded};
use crate::control::{
    AllocationKind, Cycle, CycleInput, CycleOutcome, Directions, FeedbackKind, FrameUse, JacobianKind, Model,
    OrientationErrorKind, PoseSource, Step,
};

const PERIOD: f64 = 1e-3;

fn cycle(rig: &Rig) -> Cycle {
    Cycle::new(&rig.control, &rig.description, rig.manipulator.clone())
}

/// Tangents in the x-z plane, deg from z.
fn planar(angles_deg: [f64; 2]) -> Directions {
    let mut directions = Directions::default();
    for (direction, angle) in directions.iter_mut().zip(angles_deg) {
        let (sine, cosine) = angle.to_radians().sin_cos();
        *direction = [sine, 0.0, cosine];
    }
    directions
}

/// Poses whose tangents are these.
fn seen(directions: &Directions) -> PoseMessage {
    let mut pose = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
    for (magnet, direction) in pose.magnets.iter_mut().zip(directions).take(2) {
        let turn =
            Rotation3::rotation_between(&Vector3::z(), &Vector3::from(*direction)).expect("not opposite");
        let [x, y, z, w] = UnitQuaternion::from_rotation_matrix(&turn).coords.into();
        *magnet = MagnetPose { orientation_xyzw: [x, y, z, w], valid: 1, ..MagnetPose::default() };
    }
    pose
}

fn input(measured: Directions, target: Directions) -> CycleInput {
    CycleInput {
        period: PERIOD,
        pose: Some(seen(&measured)),
        pose_is_fresh: true,
        pose_age: 5e-3,
        measured: Actuation::default(),
        admitted: Actuation::default(),
        target: target.into(),
        engaged: true,
    }
}

/// Goal: the equilibrium told is that of the tangents and gains told beside it, whatever was learnt in the same cycle: a model that knows
/// nothing else finds the same tangents there.
#[test]
fn the_equilibrium_told_is_where_another_model_finds_the_same_tangents() {
    let rig = Rig::shipped();
    let mut cycle = cycle(&rig);
    let mut given = input(planar([90.0, 90.0]), planar([90.0, 90.0]));
    given.engaged = false;
    let mut gains_max = 0.0_f64;
    for number in 0..1500 {
        let share = f64::from(number.min(400)) / 400.0;
        given.measured = rig.actuation(&[1.0, -0.8, 0.6, 0.9, -0.5, 0.7, 0.2, -0.1].map(|full| full * share));
        let told = cycle.step(&given);
        // A rod some degrees beside the model, so that gains are learnt.
        let turn = Rotation3::new(Vector3::new(0.0, -3.0_f64.to_radians(), 0.0));
        given.pose = Some(seen(&told.predicted.map(|tangent| (turn * Vector3::from(tangent)).into())));
        gains_max = told.gains.iter().fold(gains_max, |most, gain| most.max((gain - 1.0).abs()));
        if number % 100 != 0 {
            continue;
        }
        let mut other = Model::new(&rig.description, rig.manipulator.clone(), rig.control.passes_max);
        other.set_gains(&told.gains);
        other.resume(&told.equilibrium);
        let found = other.follow(&told.equilibrium.actuation);
        // One pass: nothing was left to be found.
        assert!(found.converged && found.passes == 1, "cycle {number}: {found:?}");
        for (magnet, predicted) in told.predicted.iter().enumerate().take(2) {
            let apart = (other.tangent(magnet) - Vector3::from(*predicted)).norm();
            assert!(apart < 1e-6, "cycle {number}, magnet {magnet}: {apart}");
        }
    }
    assert!(gains_max > 0.01, "nothing was learnt: {gains_max}");
}

/// Goal: a cycle that is not engaged, or has never seen a pose, asks for what is admitted already.
#[test]
fn nothing_is_asked_for_unless_engaged_and_seeing() {
    let (rig, mut random) = (Rig::shipped(), seeded(1));
    let mut cycle = cycle(&rig);
    for _ in 0..500 {
        let admitted = rig.actuation(&numbers(rig.parameters(), 3.0, &mut random));
        let seeing = input(planar([100.0, 110.0]), planar([60.0, 90.0]));
        let idle = CycleInput { engaged: false, admitted, measured: admitted, ..seeing };
        let blind = CycleInput { pose: None, pose_is_fresh: false, admitted, measured: admitted, ..seeing };
        for input in [idle, blind] {
            let outcome = cycle.step(&input);
            assert_eq!(outcome.request, admitted);
            assert_eq!(outcome.saturated, 0);
        }
    }
}

/// Goal: steering begins where the magnets are and from what is admitted, however far the target: the first request differs by no more than the
/// smoothed reference moves in one cycle, and grows from there.
#[test]
fn steering_begins_without_a_bump() {
    let rig = Rig::shipped();
    let mut cycle = cycle(&rig);
    // The rod at rest, as the model has it, and as it is measured.
    let idle = CycleInput { engaged: false, ..input(planar([90.0, 90.0]), planar([60.0, 90.0])) };
    let rest = cycle.step(&idle).predicted;
    let engaged = input(rest, planar([60.0, 90.0]));
    // Long enough to forget where they were seen first: 14 time constants of the model's bias.
    for _ in 0..1500 {
        cycle.step(&CycleInput { engaged: false, ..engaged });
    }
    let first = cycle.step(&engaged);
    for (desired, rest) in first.desired.iter().zip(&rest).take(2) {
        let moved = (Vector3::from(*desired) - Vector3::from(*rest)).norm();
        // One cycle at the greatest acceleration moves by 2e-5 rad; the rest is what is left of the bias.
        assert!(moved < 3e-4, "{moved}");
    }
    let most =
        |outcome: &CycleOutcome| outcome.request.current_a.iter().fold(0.0_f64, |most, i| most.max(i.abs()));
    let slew = rig.description.coils[0].slew_max * PERIOD;
    assert!(most(&first) < 0.1 * slew, "{}", most(&first));
    // It does steer: the requests go on from what was admitted.
    let mut admitted = first.request;
    for _ in 0..50 {
        admitted = cycle.step(&CycleInput { admitted, measured: admitted, ..engaged }).request;
    }
    assert!(admitted.current_a.iter().any(|current| current.abs() > 0.1));
}

/// Something that could be thought to arrive: far, old, late, absurd.
fn hostile(rig: &Rig, random: &mut ChaCha8Rng) -> CycleInput {
    let mut directions = || {
        let mut directions = Directions::default();
        for direction in &mut directions {
            let size = [0.0, 1.0, 1.0, 1.0, 1e-300, 1e6][random.random_range(0..6)];
            let v = Vector3::from_vec(numbers(3, 1.0, random));
            *direction = (v.normalize() * size).into();
        }
        directions
    };
    let (target, tangents) = (directions(), directions());
    let mut pose = PoseMessage { magnet_count: random.random_range(0..=8), ..PoseMessage::default() };
    for (magnet, tangent) in pose.magnets.iter_mut().zip(tangents).take(MAGNETS_MAX) {
        let axis = Vector3::from(tangent) + Vector3::new(0.0, 1e-3, 0.0);
        let turn = UnitQuaternion::from_scaled_axis(axis.normalize() * random.random_range(-7.0..7.0));
        magnet.orientation_xyzw = turn.coords.into();
        magnet.valid = [0, 1, 1, 1, 7][random.random_range(0..5)];
    }
    let size = [0.0, 1.0, 8.0, 1e3, 1e9][random.random_range(0..5)];
    let mut measured = rig.actuation(&numbers(rig.parameters(), size, random));
    if random.random_bool(0.05) {
        measured.current_a[random.random_range(0..32)] =
            [f64::NAN, f64::INFINITY, f64::MAX][random.random_range(0..3)];
    }
    let values: Vec<f64> =
        rig.limits().iter().map(|[_, most, _]| most * random.random_range(-1.0..=1.0)).collect();
    let period = [0.0, 1e-12, 1e-4, 1e-3, 1e-3, 1e-3, 0.1, 1e3, 1e12][random.random_range(0..9)];
    CycleInput {
        period,
        pose: random.random_bool(0.9).then_some(pose),
        pose_is_fresh: random.random_bool(0.5),
        pose_age: [0.0, 5e-3, any_size(1e-6, 1e9, random)][random.random_range(0..3)],
        measured,
        admitted: rig.actuation(&values),
        target: target.into(),
        engaged: random.random_bool(0.9),
    }
}

/// Goal: no input makes a cycle panic or ask for what is not finite or out of range, whichever options it has; sane inputs afterwards are steered by again.
#[test]
fn hostile_inputs_never_panic_and_always_give_usable_requests() {
    let mut rig = Rig::shipped();
    let mut random = seeded(2);
    let options = [
        (AllocationKind::Bounded, OrientationErrorKind::TangentPlane, JacobianKind::Exact),
        (AllocationKind::TruncatedSvd, OrientationErrorKind::AxisAngle, JacobianKind::Exact),
        (AllocationKind::Bounded, OrientationErrorKind::TangentPlane, JacobianKind::Algorithm1),
        (AllocationKind::TruncatedSvd, OrientationErrorKind::AxisAngle, JacobianKind::Algorithm1),
    ];
    let feedbacks = [FeedbackKind::DelayedReference, FeedbackKind::DisturbanceEstimate];
    let options = feedbacks.into_iter().flat_map(|feedback| options.map(|option| (feedback, option)));
    for (feedback, (allocation, error, jacobian)) in options {
        rig.control.feedback = feedback;
        (rig.control.allocation, rig.control.orientation_error) = (allocation, error);
        rig.control.jacobian = jacobian;
        if let Some(algorithm_1) = &mut rig.control.algorithm_1 {
            algorithm_1.magnet_poses = PoseSource::Measured;
        }
        (rig.control.frame_angles, rig.control.integral_per_s2) = (FrameUse::Steer, 2.0);
        let mut cycle = cycle(&rig);
        let (mut moved, mut astray) = (0, 0);
        for number in 0..10_000 {
            let input = hostile(&rig, &mut random);
            let outcome = cycle.step(&input);
            let values = rig.values(&outcome.request);
            for (value, [least, most, _]) in values.iter().zip(rig.limits()) {
                let slack = 1e-12 * most;
                assert!((least - slack..=most + slack).contains(value), "{number}: {value} {input:?}");
            }
            assert!(!outcome.condition.is_nan());
            let finite = |directions: &Directions| directions.iter().flatten().all(|entry| entry.is_finite());
            assert!(finite(&outcome.measured) && finite(&outcome.predicted), "{number}: {input:?}");
            assert!(finite(&outcome.bias), "{number}: {:?} {input:?}", outcome.bias);
            assert!(finite(&outcome.desired), "{number}: {:?} {input:?}", outcome.desired);
            moved += u32::from(outcome.request != input.admitted);
            astray += u32::from(!outcome.model.converged);
        }
        println!("{allocation:?}, {jacobian:?}: moved in {moved}, model astray in {astray} of 10000");
        assert!(moved > 2000 && astray > 2000);
        let sane = input(planar([110.0, 115.0]), planar([80.0, 90.0]));
        cycle.step(&CycleInput { engaged: false, ..sane });
        let mut recovered = (0..30).map(|_| cycle.step(&sane));
        assert!(recovered.any(|outcome| outcome.model.converged && outcome.request != sane.admitted));
    }
}
