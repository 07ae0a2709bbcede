//! The guide: ways planned from where a loop stands, judged by a pretended loop that refuses and misses, and by the simulated plant.

mod rig_support;

use std::sync::OnceLock;

use magsteer::control::Directions;
use magsteer::control::plan::{
    GivenUp, Guide, Leg, Order, Planner, Posture, Rehearsal, Stance, Told, draw_targets,
};
use magsteer::math::angle_between;
use magsteer_hal::COILS_MAX;
use nalgebra::{Rotation3, Vector3};
use rig_support::Setup;
use rig_support::lead::Lead;

/// The shipped rig with a coarse grid of frame settings, and four targets within 30 deg of rest.
fn rig() -> &'static (Setup, Planner, Vec<Directions>) {
    static RIG: OnceLock<(Setup, Planner, Vec<Directions>)> = OnceLock::new();
    RIG.get_or_init(|| {
        let mut setup = Setup::shipped("bigmag-3d.toml");
        let control = setup.config.control.as_mut().expect("has a controller");
        control.plan.as_mut().expect("has a planner").frame_step_deg = 30.0;
        let control = setup.config.control.as_ref().expect("has a controller");
        let plan = control.plan.as_ref().expect("has a planner");
        let manipulator = setup.config.manipulator.clone().expect("has a model");
        let planner = Planner::new(plan, control, &setup.config.description, manipulator);
        let rest = planner.rest().posture.directions;
        let targets = draw_targets(&rest, 2, 30.0_f64.to_radians(), 4, 7);
        (setup, planner, targets)
    })
}

/// A loop that stands in a posture of the model, its magnets with it.
fn stance(posture: &Posture) -> Stance {
    Stance {
        equilibrium: posture.equilibrium,
        predicted: posture.directions,
        measured: posture.directions,
        gains: [1.0; COILS_MAX],
    }
}

fn at_rest() -> Stance {
    stance(&rig().1.rest().posture)
}

/// The same loop, its magnets turned about an axis of the world, deg.
fn beside(stance: Stance, [x, y, z]: [f64; 3]) -> Stance {
    let turn = Rotation3::new(Vector3::new(x.to_radians(), y.to_radians(), z.to_radians()));
    Stance { measured: stance.measured.map(|direction| (turn * Vector3::from(direction)).into()), ..stance }
}

fn leg(order: Result<Option<Order>, GivenUp>) -> Leg {
    match order {
        Ok(Some(Order::Steer(leg))) => leg,
        other => panic!("{other:?}"),
    }
}

/// Greatest angle between the magnets of two sets of directions, rad.
fn apart(a: &Directions, b: &Directions) -> f64 {
    let pairs = a.iter().zip(b).take(2);
    pairs.map(|(a, b)| angle_between(&Vector3::from(*a), &Vector3::from(*b))).fold(0.0, f64::max)
}

/// Turns directions as the magnets of `stance` are turned back to its model.
fn turn_back(directions: &mut Directions, stance: &Stance) {
    let pairs = directions.iter_mut().zip(&stance.measured).zip(&stance.predicted).take(2);
    for ((direction, measured), predicted) in pairs {
        let [measured, predicted] = [measured, predicted].map(|all| Vector3::from(*all));
        let back = Rotation3::rotation_between(&measured, &predicted).expect("some degrees");
        *direction = (back * Vector3::from(*direction)).into();
    }
}

/// The first leg of a way to rest from `stance`; every way to the target is refused.
fn homeward(guide: &mut Guide, stance: &Stance, rest: &Directions) -> Leg {
    loop {
        let next = leg(guide.order(stance));
        if !next.is_last && apart(&next.waypoint.directions, rest) < 5.0_f64.to_radians() {
            return next;
        }
        guide.tell(Told::Refused);
    }
}

/// Goal: the loop with its real controller on the plant with its errors settles at every target, one after another, and the rod never
/// snaps on the way.
#[test]
fn a_loop_is_led_from_target_to_target_on_a_plant_that_is_not_the_model() {
    let (setup, planner, targets) = rig();
    let mut lead = Lead::new(setup, planner.clone());
    for target in targets {
        let (settled, story) = lead.to(target);
        assert!(settled, "{story:?}");
    }
    assert_eq!((lead.snapped, lead.stopped), (0, 0));
}

/// Goal: a loop that does as it is told ends at the target itself, whatever its magnets are beside the model, and is then left alone.
#[test]
fn a_way_ends_at_the_target_and_the_guide_then_asks_for_nothing() {
    let (_, planner, targets) = rig();
    let mut guide = Guide::new(planner.clone());
    assert!(matches!(guide.order(&at_rest()), Ok(None)), "no target was set");
    guide.set_out(&targets[0]);
    let mut last = leg(guide.order(&at_rest()));
    while !last.is_last {
        guide.tell(Told::Arrived);
        last = leg(guide.order(&at_rest()));
    }
    assert_eq!(last.waypoint.directions, targets[0]);
    guide.tell(Told::Arrived);
    assert!(matches!(guide.order(&at_rest()), Ok(None)));
}

/// Goal: where the magnets are beside the model, the way is planned to where the model must point for them to be at the target, which
/// wants other frames than the target itself.
#[test]
fn ways_are_planned_for_magnets_as_far_beside_the_model_as_they_are() {
    let (_, planner, targets) = rig();
    let target = &targets[0];
    let stance = beside(at_rest(), [0.0, 20.0, 0.0]);
    let turn_back = Rotation3::new(Vector3::new(0.0, -20.0_f64.to_radians(), 0.0));
    let goal = |target: &Directions| {
        let standing = planner.standing_at(&stance.equilibrium, &stance.predicted, &[], &[]);
        let plan = planner.plan(&standing.expect("at rest"), target).expect("near rest");
        plan.posture.equilibrium.actuation.angle_rad
    };
    let corrected = goal(&target.map(|direction| (turn_back * Vector3::from(direction)).into()));
    assert_ne!(corrected, goal(target), "or nothing is seen of it");
    let mut guide = Guide::new(planner.clone());
    guide.set_out(target);
    let mut last = leg(guide.order(&stance));
    while !last.is_last {
        guide.tell(Told::Arrived);
        last = leg(guide.order(&stance));
    }
    assert_eq!(last.waypoint.frame_angles, corrected);
}

/// Goal: at a waypoint on the way the magnets are asked to where they will be when the model is where it was planned; at rest, where they
/// are beside it by as much, to where that leaves no currents.
#[test]
fn waypoints_are_asked_for_as_far_beside_the_model_as_the_magnets_are() {
    let (_, planner, _) = rig();
    let rest = planner.rest().posture.directions;
    let off = beside(at_rest(), [1.0, 2.0, -3.0]);
    let mut by_way = [0; 2];
    // One magnet moves before the other hardly ever where both turn little.
    for target in draw_targets(&rest, 2, 60.0_f64.to_radians(), 20, 7) {
        let mut guide = Guide::new(planner.clone());
        guide.set_out(&target);
        while let Ok(Some(Order::Steer(asked))) = guide.order(&at_rest()) {
            // The way is planned: the same leg, for magnets beside the model.
            let mut seen = leg(guide.clone().order(&off)).waypoint.directions;
            by_way[usize::from(asked.waypoint.directions == rest)] += usize::from(!asked.is_last);
            if !asked.is_last {
                turn_back(&mut seen, &off);
            }
            assert!(apart(&seen, &asked.waypoint.directions) < 1e-6);
            guide.tell(Told::Arrived);
        }
    }
    assert!(by_way.iter().all(|count| *count > 0), "or nothing is seen of it: {by_way:?}");
}

/// Goal: from a posture that bends them elsewhere the magnets are asked home to where they were seen to rest, not to where the model rests, nor
/// as far beside it as they are where they set out.
#[test]
fn magnets_are_asked_home_to_where_they_rested() {
    let (_, planner, targets) = rig();
    let rest = planner.rest().posture.directions;
    let sagging = beside(at_rest(), [1.0, 2.0, -3.0]);
    let posture = planner.from_rest(&targets[0]).expect("within 30 deg").posture;
    let bent = beside(stance(&posture), [0.0, -4.0, 0.0]);
    let mut guide = Guide::new(planner.clone());
    guide.set_out(&targets[0]);
    let _ = leg(guide.order(&sagging));
    guide.set_out(&targets[1]);
    let mut home = homeward(&mut guide, &bent, &rest).waypoint.directions;
    assert!(apart(&home, &rest) > 1.0_f64.to_radians());
    turn_back(&mut home, &sagging);
    assert!(apart(&home, &rest) < 1e-6);
}

/// Goal: after a refusal the frames are to end elsewhere, after two the way begins at rest, and what does not end is given up.
#[test]
fn a_loop_that_refuses_everything_is_offered_other_frames_then_rest_then_nothing() {
    let (_, planner, targets) = rig();
    let posture = planner.from_rest(&targets[0]).expect("within 30 deg").posture;
    let mut guide = Guide::new(planner.clone());
    guide.set_out(&targets[1]);
    let (mut refused, mut homeward, mut releases) = (Vec::new(), Vec::new(), 0);
    let mut present = stance(&posture);
    let given_up = loop {
        match guide.order(&present) {
            Err(given_up) => break given_up,
            Ok(None) => panic!("nothing was reached"),
            Ok(Some(Order::Retreat)) => panic!("nothing holds"),
            Ok(Some(Order::Release)) => {
                releases += 1;
                present = at_rest();
                guide.tell(Told::Released);
            }
            Ok(Some(Order::Steer(leg))) => {
                let is_homeward = apart(&leg.waypoint.directions, &planner.rest().posture.directions) < 1e-6;
                if leg.is_last {
                    refused.push(leg.waypoint.frame_angles);
                }
                if is_homeward && releases == 0 {
                    homeward.push(leg.waypoint.frame_angles);
                }
                // Frames that turn at rest refuse nobody.
                let passes = is_homeward && releases > 0;
                guide.tell(if passes { Told::Arrived } else { Told::Refused });
            }
        }
        assert!(refused.len() < 20 && releases < 20, "does not end");
    };
    assert!(releases > 0, "after {} ways", refused.len());
    assert!(refused.len() >= 2, "{refused:?}");
    let again = refused.iter().enumerate().find(|(index, frames)| refused[..*index].contains(frames));
    assert_eq!(again, None, "{refused:?}");
    // With the bias once more, which here is none, then with other frames.
    assert!(homeward.len() >= 3 && homeward[0] == homeward[1], "{homeward:?}");
    assert!(homeward[2..].iter().all(|frames| *frames != homeward[0]), "{homeward:?}");
    assert!(matches!(given_up, GivenUp::Exhausted { refused: 2.., .. }), "{given_up}");
}

/// Goal: a loop that holds near a snap-through is first of all sent back along its way, wherever it stands, and then on a way with other frames.
#[test]
fn a_loop_that_holds_is_sent_back_before_anything_else() {
    let (_, planner, targets) = rig();
    let mut guide = Guide::new(planner.clone());
    guide.set_out(&targets[1]);
    let mut held = leg(guide.order(&at_rest()));
    while !held.is_last {
        guide.tell(Told::Arrived);
        held = leg(guide.order(&at_rest()));
    }
    guide.tell(Told::Held);
    let mut nowhere = at_rest();
    nowhere.predicted = targets[3];
    assert!(matches!(guide.order(&nowhere), Ok(Some(Order::Retreat))), "nothing is planned");
    guide.tell(Told::Retreated);
    let mut next = leg(guide.order(&at_rest()));
    while !next.is_last {
        guide.tell(Told::Arrived);
        next = leg(guide.order(&at_rest()));
    }
    assert_ne!(next.waypoint.frame_angles, held.waypoint.frame_angles);
}

/// Goal: where the way to rest is refused from a posture with magnets far beside the model, it is gone again in two steps: to where the magnets
/// are then expected while the model rests, and from there to rest itself.
#[test]
fn a_way_to_rest_that_is_refused_is_gone_again_by_way_of_where_the_bias_takes_the_magnets() {
    let (_, planner, targets) = rig();
    let rest = planner.rest().posture.directions;
    let posture = planner.from_rest(&targets[0]).expect("within 30 deg").posture;
    let bent = beside(stance(&posture), [0.0, 4.0, 0.0]);
    let mut guide = Guide::new(planner.clone());
    guide.set_out(&targets[1]);
    let straight = homeward(&mut guide, &bent, &rest);
    assert_eq!(straight.waypoint.directions, rest, "where they rest was never seen");
    guide.tell(Told::Refused);
    let first = homeward(&mut guide, &bent, &rest);
    let off = apart(&first.waypoint.directions, &rest).to_degrees();
    assert!((off - 4.0).abs() < 0.5, "{off} deg");
    assert_eq!(first.waypoint.frame_angles, straight.waypoint.frame_angles);
    guide.tell(Told::Arrived);
    let second = leg(guide.order(&bent));
    assert_eq!((second.waypoint.directions, second.is_last), (rest, false));
    assert_eq!(second.waypoint.frame_angles, first.waypoint.frame_angles);
    guide.tell(Told::Arrived);
    // From rest on the way leads to the target.
    let next = leg(guide.order(&at_rest()));
    assert!(next.is_last || apart(&next.waypoint.directions, &rest) < 1e-9, "{next:?}");
}

/// Goal: where the planner expects the scout to refuse every way home, the guide asks for one all the same before currents are let go: the
/// loop's scout has the last word.
#[test]
fn a_way_home_that_may_be_refused_is_asked_for() {
    let (setup, _, targets) = rig();
    let mut control = setup.config.control.clone().expect("has a controller");
    // Nothing comes as close as that.
    control.scout.as_mut().expect("has a scout").tolerance_deg = 0.0;
    let plan = control.plan.as_ref().expect("has a planner");
    let manipulator = setup.config.manipulator.clone().expect("has a model");
    let planner = Planner::new(plan, &control, &setup.config.description, manipulator);
    let there = planner.from_rest(&targets[0]).expect("within 30 deg");
    assert!(!there.passes);
    let posture = there.posture;
    let standing =
        planner.standing_at(&posture.equilibrium, &posture.directions, &[], &[]).expect("it is there");
    assert!(standing.home.is_some_and(|home| !home.is_empty()));
}

/// Goal: where the model does not find to where the rig is, the currents are let go; where it does not even then, the target is given up.
#[test]
fn a_rig_that_the_model_does_not_come_to_is_let_go_and_then_given_up() {
    let (_, planner, targets) = rig();
    let mut guide = Guide::new(planner.clone());
    guide.set_out(&targets[0]);
    let mut elsewhere = at_rest();
    elsewhere.predicted = targets[1];
    assert!(matches!(guide.order(&elsewhere), Ok(Some(Order::Release))));
    guide.tell(Told::Released);
    assert!(matches!(guide.order(&elsewhere), Err(GivenUp::Lost)));
}

/// Goal: the posture of a plan is found again from its equilibrium alone, and only where the magnets point as they say.
#[test]
fn a_standing_is_found_from_the_equilibrium_and_not_on_another_branch() {
    let (_, planner, targets) = rig();
    for target in targets {
        let plan = planner.from_rest(target).expect("within 30 deg");
        let equilibrium = &plan.posture.equilibrium;
        let standing = planner.standing_at(equilibrium, &plan.posture.directions, &[], &[]);
        let standing = standing.expect("the model was there");
        assert!(apart(&standing.posture.directions, &plan.posture.directions) < 0.01_f64.to_radians());
        assert!((standing.posture.margin - plan.posture.margin).abs() < 1e-3);
        let elsewhere = planner.rest().posture.directions;
        assert!(planner.standing_at(equilibrium, &elsewhere, &[], &[]).is_none());
    }
}

/// Goal: ways that are said to pass are walked by the scout's own walk to their end, and settings to be avoided are.
#[test]
fn ways_that_pass_are_those_that_the_scout_walks_and_none_ends_where_it_shall_not() {
    let (setup, planner, targets) = rig();
    let control = setup.config.control.as_ref().expect("has a controller");
    let scout = control.scout.as_ref().expect("has a scout");
    let manipulator = setup.config.manipulator.clone().expect("has a model");
    for target in targets {
        let first = planner.plan(planner.rest(), target).expect("within 30 deg");
        let mut rehearsal = Rehearsal::new(scout, control, &setup.config.description, manipulator.clone());
        let walked =
            first.waypoints.iter().all(|waypoint| rehearsal.step(&waypoint.target()).obstacle.is_none());
        assert_eq!(first.passes, walked);
        let avoided = first.posture.equilibrium.actuation.angle_rad;
        if let Ok(second) = planner.plan_avoiding(planner.rest(), target, &[avoided]) {
            let frames = second.posture.equilibrium.actuation.angle_rad;
            let turned = frames.iter().zip(&avoided).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(turned > 14.0_f64.to_radians(), "{frames:?} beside {avoided:?}");
        }
    }
}

/// Goal: a leg is gone when reference and frames are there, and not before.
#[test]
fn a_leg_is_gone_when_reference_and_frames_are_there() {
    let (_, planner, targets) = rig();
    let mut guide = Guide::new(planner.clone());
    guide.set_out(&targets[0]);
    let leg = leg(guide.order(&at_rest()));
    let mut actuation = at_rest().equilibrium.actuation;
    actuation.angle_rad = leg.waypoint.frame_angles;
    assert!(leg.has_arrived(&leg.waypoint.directions, &actuation));
    assert!(!leg.has_arrived(&targets[1], &actuation));
    actuation.angle_rad[0] += 0.1_f64.to_radians();
    assert!(!leg.has_arrived(&leg.waypoint.directions, &actuation));
}
