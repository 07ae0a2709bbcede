//! Planned frame angles and ways, judged by what the planner does not use: the rod solved anew from rest, and the ways walked again.

use std::path::Path;
use std::sync::OnceLock;

use magsteer::config::Config;
use magsteer::control::plan::{Bounds, Plan, Planner, Walker, draw_targets};
use magsteer::control::{ControlConfig, Directions};
use magsteer::magnetics::CoilArray;
use magsteer::math::{along_great_circle, angle_between};
use magsteer::rod::{Manipulator, Pass, PassMode, TipLoad};
use magsteer_hal::{Actuation, HardwareDescription};
use nalgebra::Vector3;
use rayon::ThreadPoolBuilder;

/// A rig on a coarse grid of frame settings, which is quick and finds most that a fine one does.
struct Rig {
    description: HardwareDescription,
    manipulator: Manipulator,
    control: ControlConfig,
}

impl Rig {
    fn shipped() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        let (_, config) = Config::load(&path).unwrap();
        let mut control = config.control.unwrap();
        control.plan.as_mut().unwrap().frame_step_deg = 30.0;
        Self { description: config.description, manipulator: config.manipulator.unwrap(), control }
    }

    fn planner(&self) -> Planner {
        let plan = self.control.plan.as_ref().unwrap();
        Planner::new(plan, &self.control, &self.description, self.manipulator.clone())
    }

    fn walker(&self) -> Walker {
        Walker::new(&self.control, &self.description, self.manipulator.clone(), 0.05)
    }

    fn bounds(&self) -> Bounds {
        let plan = self.control.plan.as_ref().unwrap();
        Bounds { margin_min: plan.margin_min, tolerance: plan.tolerance_deg.to_radians() }
    }
}

/// The shipped rig, its planner, and ten targets in the cone of 30 deg with their plans.
fn planned() -> &'static (Rig, Planner, Vec<Directions>, Vec<Plan>) {
    static PLANNED: OnceLock<(Rig, Planner, Vec<Directions>, Vec<Plan>)> = OnceLock::new();
    PLANNED.get_or_init(|| {
        let rig = Rig::shipped();
        let planner = rig.planner();
        let rest = &planner.rest().posture.directions;
        let targets = draw_targets(rest, 2, 30.0_f64.to_radians(), 10, 7);
        let plans = targets.iter().map(|target| planner.from_rest(target).unwrap()).collect();
        (rig, planner, targets, plans)
    })
}

/// Greatest angle between the magnets of two sets of directions, rad.
fn apart(a: &Directions, b: &Directions) -> f64 {
    let pairs = a.iter().zip(b).take(2);
    pairs.map(|(a, b)| angle_between(&Vector3::from(*a), &Vector3::from(*b))).fold(0.0, f64::max)
}

/// Rest with each magnet turned by so much about an axis perpendicular to it, deg.
fn turned(rest: &Directions, about: Vector3<f64>, by_deg: f64) -> Directions {
    let mut target = *rest;
    for direction in target.iter_mut().take(2) {
        let from = Vector3::from(*direction);
        let way = about.cross(&from).normalize() * by_deg.to_radians();
        *direction = along_great_circle(&from, &way, &Vector3::zeros()).0.into();
    }
    target
}

/// Goal: ten random targets are reached, and each plan's actuation alone, solved from the unloaded rod by another method, gives a
/// stable equilibrium that points where the target says: the same branch, by another way.
#[test]
fn ends_of_ways_to_ten_targets_are_stable_equilibria_that_point_there() {
    let (rig, _, targets, plans) = planned();
    let array = CoilArray::new(&rig.description);
    for (target, plan) in targets.iter().zip(plans) {
        let actuation = &plan.posture.equilibrium.actuation;
        let posed = array.posed(&actuation.angle_rad[..2]);
        let mut pass = Pass::new(&rig.manipulator);
        let solution = rig.manipulator.solve_from_rest(
            &posed.actuated(&actuation.current_a[..6]),
            &TipLoad::NONE,
            PassMode::default(),
            &mut pass,
        );
        assert!(solution.converged() && pass.field_valid());
        let mut solved = Directions::default();
        for (direction, magnet) in solved.iter_mut().zip(pass.magnets()) {
            *direction = magnet.tangent().into();
        }
        let stability = rig.manipulator.stability(&mut pass);
        assert_eq!(stability.unstable_modes, 0);
        assert!((stability.margin - plan.posture.margin).abs() < 1e-3, "{stability:?}");
        assert!(apart(&solved, target) < 0.1_f64.to_radians(), "{} deg", apart(&solved, target).to_degrees());
        // The model is left within some 1e-4 of the rod's deflection of equilibrium.
        assert!(apart(&solved, &plan.posture.directions) < 0.01_f64.to_radians());
        assert!((plan.error - apart(&plan.posture.directions, target)).abs() < 1e-9);
    }
}

#[test]
fn currents_and_angles_stay_within_the_limits_of_the_description() {
    let (rig, _, _, plans) = planned();
    for plan in plans {
        let actuation = &plan.posture.equilibrium.actuation;
        for (coil, current) in rig.description.coils.iter().zip(&actuation.current_a) {
            assert!(current.abs() <= coil.current_max);
            assert!(current.abs() <= plan.walked.current_max + 1e-12);
        }
        for waypoint in plan.waypoints.iter().chain(&plan.home) {
            for (frame, angle) in rig.description.frames.iter().zip(&waypoint.frame_angles) {
                assert!((frame.angle_min..=frame.angle_max).contains(angle));
            }
        }
        assert!(plan.walked.margin_min >= rig.bounds().margin_min);
        assert!(plan.posture.margin >= plan.walked.margin_min);
    }
}

/// Goal: frames that reach less far are not asked for more, on the grid or between its settings.
#[test]
fn narrow_frames_are_not_turned_beyond_their_range() {
    let mut rig = Rig::shipped();
    for frame in &mut rig.description.frames {
        (frame.angle_min, frame.angle_max) = (-65.0_f64.to_radians(), 35.0_f64.to_radians());
    }
    let planner = rig.planner();
    // -60, -30, 0 and 30 deg of either frame.
    assert_eq!(planner.setting_count(), 16);
    let rest = planner.rest().posture.directions;
    for target in draw_targets(&rest, 2, 40.0_f64.to_radians(), 3, 2) {
        let Ok(plan) = planner.from_rest(&target) else { continue };
        for waypoint in plan.waypoints.iter().chain(&plan.home) {
            let range = -65.0_f64.to_radians()..=35.0_f64.to_radians();
            assert!(waypoint.frame_angles[..2].iter().all(|angle| range.contains(angle)));
        }
    }
    assert!(planner.from_rest(&turned(&rest, Vector3::z(), 10.0)).is_ok());
}

/// Goal: a way is what it says: whoever walks its waypoints arrives with the same currents, and comes home along its return.
#[test]
fn ways_walked_again_arrive_and_lead_home() {
    let (rig, planner, targets, plans) = planned();
    let tolerance = rig.bounds().tolerance;
    for (target, plan) in targets.iter().zip(plans).take(4) {
        let mut walker = rig.walker();
        for waypoint in &plan.waypoints {
            walker.walk(waypoint, &rig.bounds()).unwrap();
        }
        assert!(walker.error_to(target) <= tolerance);
        let again = walker.posture().equilibrium.actuation;
        let currents = again.current_a.iter().zip(&plan.posture.equilibrium.actuation.current_a);
        let apart = currents.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Currents wander in the null space until they change by less than 0.02 A an allocation.
        assert!(apart < 0.2, "{apart} A");
        for waypoint in &plan.home {
            walker.walk(waypoint, &rig.bounds()).unwrap();
        }
        assert!(walker.error_to(&planner.rest().posture.directions) <= tolerance);
        // The rod comes to rest on the branch that it left: without currents it stays where it is.
        let last = plan.home.last().unwrap_or(&plan.waypoints[0]).frame_angles;
        walker.actuate(&Actuation { angle_rad: last, ..Actuation::default() }).unwrap();
        assert!(walker.error_to(&planner.rest().posture.directions) <= tolerance);
    }
}

/// Goal: a sequence of plans is one way: each begins where the one before it ended.
#[test]
fn plans_one_after_another_make_one_way() {
    let (rig, planner, targets, _) = planned();
    let mut standing = planner.rest().clone();
    let mut walker = rig.walker();
    for target in &targets[..3] {
        let plan = planner.plan(&standing, target).unwrap();
        for waypoint in &plan.waypoints {
            walker.walk(waypoint, &rig.bounds()).unwrap();
        }
        assert!(walker.error_to(target) <= rig.bounds().tolerance);
        standing = plan.standing();
    }
}

/// Goal: neither the number of threads nor their pace is seen in a plan.
#[test]
fn plans_are_the_same_for_any_number_of_threads_bit_for_bit() {
    let (_, planner, targets, _) = planned();
    let rest = &planner.rest().posture.directions;
    let far = draw_targets(rest, 2, 60.0_f64.to_radians(), 2, 11);
    let bits = |threads: usize| -> Vec<u64> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let plans = pool.install(|| {
            let mut plans: Vec<_> =
                targets[..2].iter().chain(&far).map(|target| planner.from_rest(target)).collect();
            if let Ok(first) = &plans[0] {
                plans.push(planner.plan(&first.standing(), &targets[2]));
            }
            plans
        });
        let numbers = |plan: &Plan| -> Vec<f64> {
            let mut numbers = vec![plan.error, plan.walked.current_max, plan.walked.margin_min];
            numbers.extend([plan.posture.margin, plan.posture.expected, plan.posture.condition]);
            numbers.extend(plan.posture.equilibrium.actuation.current_a);
            for waypoint in plan.waypoints.iter().chain(&plan.home) {
                numbers.extend(waypoint.frame_angles);
                numbers.extend(waypoint.directions.iter().flatten());
            }
            numbers
        };
        let reached = plans.iter().flat_map(|plan| plan.as_ref().map_or(vec![f64::NAN], &numbers));
        reached.map(f64::to_bits).collect()
    };
    assert_eq!(bits(1), bits(2));
}

/// Goal: with all coils in one plane nothing turns the rod out of it, and what is refused is named.
#[test]
fn frames_at_zero_reach_targets_in_their_plane_and_none_out_of_it() {
    let (_, planner, ..) = planned();
    let rest = planner.rest().posture.directions;
    let zero = Default::default();
    let inside = planner.from_rest_with(&zero, &turned(&rest, Vector3::y(), 10.0)).unwrap();
    assert!(inside.waypoints.iter().all(|waypoint| waypoint.frame_angles == zero));
    let refused = planner.from_rest_with(&zero, &turned(&rest, Vector3::z(), 10.0)).unwrap_err();
    assert_eq!(refused.tried, 1);
    assert_eq!(refused.closest, magsteer::control::plan::Obstacle::OutOfReach);
}

#[test]
fn a_target_folded_back_on_itself_is_refused_with_an_obstacle() {
    let (_, planner, ..) = planned();
    let mut target = planner.rest().posture.directions;
    let [x, y, z] = target[0];
    // The first magnet points back into the clamp.
    target[0] = [-x, -y, -z];
    let refused = planner.from_rest(&target).unwrap_err();
    assert!(refused.tried >= planner.setting_count());
    assert!(refused.to_string().contains("not reached with any of"), "{refused}");
}

/// Goal: the best single setting reaches at least as many targets as any other that is tried here, and what it is said to reach.
#[test]
fn the_best_single_setting_is_no_worse_than_others() {
    let (_, planner, targets, _) = planned();
    let targets = &targets[..4];
    let count = |setting: &[f64; magsteer_hal::POSE_PARAMETERS_MAX]| {
        targets.iter().filter(|target| planner.from_rest_with(setting, target).is_ok()).count()
    };
    let best = count(&planner.best_fixed(targets, |_| {}));
    let mut other = [0.0; magsteer_hal::POSE_PARAMETERS_MAX];
    for (bottom, top) in [(0.0, 0.0), (60.0, 60.0), (30.0, -60.0), (-60.0, 30.0)] {
        (other[0], other[1]) = (f64::to_radians(bottom), f64::to_radians(top));
        assert!(count(&other) <= best);
    }
    assert!(best > 0);
}
