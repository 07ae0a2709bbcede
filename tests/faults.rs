//! Every fault verb on every target: the plant does it, and the daemon answers.
//!
//! In lockstep with the real controller against the shipped planar rig, so that all times are simulated ones.
//! The loop steers between two pairs of angles, half a second each, when the fault begins.
#![cfg(feature = "sim")]

mod fault_support;
mod rig_support;

use fault_support::{Answer, Episode};
use magsteer_hal::operator::Cause;

/// Limits of the shipped file, s.
const POSE_STOP: f64 = 0.25;
const FEEDBACK_STOP: f64 = 0.2;
const COMMAND_VALIDITY: f64 = 0.1;
/// The driver's own watch on currents, and the daemon's behind it.
const DRIVER_FOLLOW: f64 = 0.1;
/// Allowance for a ramp from 3 A at 300 A/s, amplifiers of 200 Hz, and a period of the sensor, s.
const RAMP: f64 = 0.03;

/// Stops for a cause of its own, and latches it.
fn stops(cause: Cause, zero_after: f64) -> Answer {
    Answer::Stops { cause, latched: cause, zero_after: zero_after + RAMP }
}

/// Stops, and cuts because nobody can see the end of the ramp, or it does not end.
fn stops_and_cuts(cause: Cause, zero_after: f64) -> Answer {
    Answer::Stops { cause, latched: Cause::RampTimeout, zero_after: zero_after + RAMP }
}

fn expect(target: &str, cases: &[(&str, Answer)]) {
    for (verb, answer) in cases {
        let episode = Episode::of(target, verb);
        episode.expect(answer);
    }
}

/// Proves SR-10.
#[test]
fn poses_that_do_not_come_or_are_refused_hold_then_stop() {
    let stale = stops(Cause::PoseStale, POSE_STOP);
    expect(
        "poses",
        &[
            ("verb = 'off'", stale),
            ("verb = 'garbage'\ngarbage = 'nan'", stale),
            ("verb = 'garbage'\ngarbage = 'huge'", stale),
            ("verb = 'garbage'\ngarbage = 'quaternion'", stale),
            ("verb = 'slow'\nrate_hz = 2.0", stale),
            ("verb = 'delayed'\ndelay_ms = 300.0", stale),
            ("verb = 'repeated'", stale),
            ("verb = 'backward'", stale),
            ("verb = 'wrong-version'", stale),
        ],
    );
}

#[test]
fn poses_of_one_magnet_that_go_wrong_condemn_the_message() {
    let stale = stops(Cause::PoseStale, POSE_STOP);
    expect(
        "poses",
        &[
            ("verb = 'off'\nmagnet = 'm2'", stale),
            ("verb = 'garbage'\ngarbage = 'nan'\nmagnet = 'm1'", stale),
            ("verb = 'garbage'\ngarbage = 'huge'\nmagnet = 'm1'", stale),
            ("verb = 'garbage'\ngarbage = 'quaternion'\nmagnet = 'm2'", stale),
        ],
    );
}

/// Goal: poses that pass every check at receipt, but are not true. A frozen sensor at rest harms nothing;
/// once the rod has been moved, the model knows better.
#[test]
fn poses_that_could_be_true_and_are_not_are_found_out_by_the_model() {
    // Two steps of half a second each until the model is 30 degrees away.
    let implausible = stops(Cause::PoseImplausible, 1.5);
    expect(
        "poses",
        &[
            ("verb = 'stuck'", implausible),
            ("verb = 'stuck'\nmagnet = 'm2'", implausible),
            ("verb = 'garbage'\ngarbage = 'random'", stops(Cause::PoseImplausible, 3.0 * POSE_STOP)),
            (
                "verb = 'garbage'\ngarbage = 'random'\nmagnet = 'm1'",
                stops(Cause::PoseImplausible, 6.0 * POSE_STOP),
            ),
        ],
    );
}

#[test]
fn another_life_of_the_sensor_is_not_trusted_until_armed_anew() {
    let restarted = stops(Cause::SensorRestarted, 0.01);
    expect(
        "poses",
        &[
            ("verb = 'wrong-epoch'\nepoch = 'other'", restarted),
            ("verb = 'wrong-epoch'\nepoch = 'every-message'", restarted),
        ],
    );
}

#[test]
fn poses_lost_for_less_than_the_stop_limit_are_ridden_through() {
    expect(
        "poses",
        &[
            ("verb = 'delayed'\ndelay_ms = 20.0", Answer::SteersOn { holds: false }),
            ("verb = 'slow'\nrate_hz = 10.0", Answer::SteersOn { holds: true }),
            (
                "verb = 'intermittent'\nperiod_ms = 200.0\noff_fraction = 0.5",
                Answer::SteersOn { holds: true },
            ),
            (
                "verb = 'intermittent'\nperiod_ms = 600.0\noff_fraction = 0.5",
                stops(Cause::PoseStale, POSE_STOP),
            ),
            (
                "verb = 'intermittent'\nmagnet = 'm1'\nperiod_ms = 200.0\noff_fraction = 0.5",
                Answer::SteersOn { holds: true },
            ),
            ("verb = 'slow'\nmagnet = 'm1'\nrate_hz = 20.0", Answer::SteersOn { holds: false }),
            ("verb = 'delayed'\nmagnet = 'm2'\ndelay_ms = 20.0", Answer::SteersOn { holds: false }),
        ],
    );
}

/// Proves SR-02.
#[test]
fn feedback_that_does_not_come_or_is_refused_stops_and_cuts() {
    let blind = stops_and_cuts(Cause::FeedbackStale, FEEDBACK_STOP);
    expect(
        "feedback",
        &[
            ("verb = 'off'", blind),
            ("verb = 'garbage'\ngarbage = 'nan'", blind),
            ("verb = 'delayed'\ndelay_ms = 300.0", blind),
            ("verb = 'repeated'", blind),
            ("verb = 'backward'", blind),
            ("verb = 'wrong-version'", blind),
            // The next message but one shows the end of the ramp.
            ("verb = 'slow'\nrate_hz = 2.0", stops(Cause::FeedbackStale, FEEDBACK_STOP)),
        ],
    );
}

/// Goal: frozen under fresh stamps, and still found out: the echo of commands stands still.
#[test]
fn feedback_that_is_stuck_is_found_out_by_its_echo() {
    expect("feedback", &[("verb = 'stuck'", stops_and_cuts(Cause::FeedbackStale, FEEDBACK_STOP))]);
}

/// Proves SR-12.
#[test]
fn feedback_of_impossible_currents_cuts_at_once() {
    let over = stops(Cause::OverCurrent, 0.01);
    expect(
        "feedback",
        &[
            ("verb = 'garbage'\ngarbage = 'huge'", over),
            ("verb = 'garbage'\ngarbage = 'huge'\ncoil = 'air-top'", over),
        ],
    );
}

#[test]
fn feedback_of_possible_currents_that_are_not_true_stops() {
    let astray = 0.15 + 0.02;
    expect(
        "feedback",
        &[
            ("verb = 'garbage'\ngarbage = 'random'", stops_and_cuts(Cause::NotFollowing, astray)),
            (
                "verb = 'garbage'\ngarbage = 'random'\nframe = 'top'",
                stops(Cause::NotFollowing, 10.0 * astray),
            ),
            (
                "verb = 'garbage'\ngarbage = 'nan'\nframe = 'top'",
                stops_and_cuts(Cause::FeedbackStale, FEEDBACK_STOP),
            ),
        ],
    );
}

#[test]
fn another_life_of_the_driver_holds_no_authority() {
    let lost = stops(Cause::AuthorityLost, 0.01);
    expect(
        "feedback",
        &[
            ("verb = 'wrong-epoch'\nepoch = 'other'", lost),
            ("verb = 'wrong-epoch'\nepoch = 'every-message'", lost),
        ],
    );
}

#[test]
fn feedback_lost_for_less_than_its_limit_is_ridden_through() {
    let steers_on = Answer::SteersOn { holds: false };
    expect(
        "feedback",
        &[
            ("verb = 'delayed'\ndelay_ms = 20.0", steers_on),
            ("verb = 'slow'\nrate_hz = 20.0", steers_on),
            ("verb = 'intermittent'\nperiod_ms = 100.0\noff_fraction = 0.5", steers_on),
        ],
    );
}

/// Goal: what amplifiers do is measured. The driver's own watch comes first, and cuts; the daemon tells of
/// it.
#[test]
fn actuators_that_do_not_obey_are_cut_by_the_drivers_own_watch() {
    let cut = |after: f64| stops(Cause::DriverFault, after + DRIVER_FOLLOW);
    expect(
        "actuators",
        &[
            ("verb = 'off'", cut(0.05)),
            ("verb = 'stuck'", cut(0.4)),
            ("verb = 'garbage'\ngarbage = 'random'", cut(0.1)),
            ("verb = 'delayed'\ndelay_ms = 300.0", cut(0.4)),
            ("verb = 'slow'\nrate_hz = 0.5", cut(1.0)),
            ("verb = 'intermittent'\nperiod_ms = 600.0\noff_fraction = 0.5", cut(0.4)),
        ],
    );
}

#[test]
fn actuators_that_lag_a_little_are_ridden_through() {
    let steers_on = Answer::SteersOn { holds: false };
    expect(
        "actuators",
        &[
            ("verb = 'slow'\nrate_hz = 10.0", steers_on),
            ("verb = 'delayed'\ndelay_ms = 20.0", steers_on),
            ("verb = 'intermittent'\nperiod_ms = 50.0\noff_fraction = 0.1", steers_on),
        ],
    );
}

/// Goal: commands that the driver's guard refuses end authority; the driver ramps down alone, and the daemon
/// sees it.
///
/// Proves SR-04.
#[test]
fn commands_that_go_wrong_are_refused_and_end_authority() {
    let lost = stops(Cause::AuthorityLost, COMMAND_VALIDITY);
    for verb in [
        "verb = 'repeated'",
        "verb = 'backward'",
        "verb = 'wrong-epoch'\nepoch = 'other'",
        "verb = 'wrong-epoch'\nepoch = 'every-message'",
        "verb = 'wrong-version'",
    ] {
        let episode = Episode::of("actuators", verb);
        episode.expect(&lost);
        assert!(episode.commands_refused > 100, "{verb}: {}", episode.commands_refused);
    }
}

#[test]
fn conditions_of_the_plant_itself_are_answered_too() {
    expect(
        "coil",
        &[
            ("verb = 'open'\ncoil = 'iron-top-right'", stops(Cause::DriverFault, 0.6 + DRIVER_FOLLOW)),
            (
                "verb = 'stuck-amplifier'\ncoil = 'iron-top-right'",
                stops(Cause::DriverFault, 0.9 + DRIVER_FOLLOW),
            ),
            (
                "verb = 'shorted'\ncoil = 'iron-top-right'\nturns_fraction = 0.1",
                Answer::SteersOn { holds: false },
            ),
        ],
    );
    // The planar rig holds its frames where they are: one that stalls is not missed.
    expect("frame", &[("verb = 'stalled'\nframe = 'top'", Answer::SteersOn { holds: false })]);
}

#[test]
fn an_episode_repeats_bit_for_bit() {
    let run = || Episode::of("poses", "verb = 'garbage'\ngarbage = 'random'");
    assert_eq!(run(), run());
}
