//! Faulty coils, amplifiers and motors in the plant, and how its driver notices: by stepped time, as a daemon
//! would drive it.

#[path = "../src/fixture.rs"]
mod fixture;

use std::time::Duration;

use magsteer_hal::message::driver_state;
use magsteer_hal::{Actuation, AdmittedCommand, Authority, CommandWriter, Gate, Stamp};
use magsteer_sim_plant::actuation::{CoilCondition, Fault, FrameCondition, Held, fault_code};
use magsteer_sim_plant::{Plant, PlantConfig};
use nalgebra::Vector3;
use serde_json::{Value, json};

const CYCLE: Duration = Duration::from_millis(1);
const STUCK_CURRENT: CoilCondition = CoilCondition::StuckAmplifier { holds: Held::Current };
const STUCK_VOLTAGE: CoilCondition = CoilCondition::StuckAmplifier { holds: Held::Voltage };

/// A plant and a commanding side, of cycles of a millisecond.
struct Bench {
    plant: Plant,
    gate: Gate,
    writer: CommandWriter,
    authority: Authority,
}

impl Bench {
    /// The fixture's plant with some keys replaced, claimed.
    fn with(changes: &[(&str, Value)]) -> Self {
        let description = fixture::bigmag();
        let mut tables = fixture::plant_tables();
        for (pointer, value) in changes {
            *tables.pointer_mut(pointer).expect("a key of the fixture") = value.clone();
        }
        let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
        let mut plant = config.build(&description).expect("valid");
        plant.set_clock(Stamp::from_nanoseconds(1_000_000_000));
        let mut bench = Self {
            plant,
            gate: Gate::new(&description),
            writer: CommandWriter::new(&description),
            authority: Authority { epoch: 0, token: 1, validity: Duration::from_millis(100) },
        };
        assert!(bench.claim(), "a healthy driver grants a claim");
        bench
    }

    /// Claims under a new epoch; whether the driver is driven a cycle later.
    fn claim(&mut self) -> bool {
        self.authority.epoch += 1;
        let command = self.gate.claim(self.authority);
        self.send(&command);
        self.plant.is_driven()
    }

    fn send(&mut self, command: &AdmittedCommand) {
        let now = self.plant.now();
        let message = self.writer.message(command, now);
        // What is refused shows in what follows.
        let _ = self.plant.offer(&message, now);
        self.plant.advance_to(now.after(CYCLE));
    }

    /// Drives for some cycles, or until the driver finds fault; after how many cycles it did.
    fn drive(&mut self, request: &Actuation, cycles: u32) -> Option<u32> {
        let faults = self.plant.counts().driver_faults;
        (1..=cycles).find(|_| {
            let admitted = self
                .gate
                .drive(request, CYCLE.as_secs_f64(), self.authority, Stamp::default())
                .expect("finite");
            self.send(&admitted.command);
            self.plant.counts().driver_faults > faults
        })
    }

    /// Says nothing for some cycles, or until the driver finds fault; after how many cycles it did.
    fn wait(&mut self, cycles: u32) -> Option<u32> {
        let faults = self.plant.counts().driver_faults;
        (1..=cycles).find(|_| {
            self.plant.advance_to(self.plant.now().after(CYCLE));
            self.plant.counts().driver_faults > faults
        })
    }

    fn current(&self, coil: usize) -> f64 {
        self.plant.actual().current_a[coil]
    }

    /// Code and state as the feedback tells.
    fn told(&self) -> (u32, u32) {
        let feedback = self.plant.feedback();
        (feedback.fault, feedback.state)
    }
}

fn currents(values: &[f64]) -> Actuation {
    let mut request = Actuation::default();
    request.current_a[..values.len()].copy_from_slice(values);
    request
}

fn angles(bottom: f64, top: f64) -> Actuation {
    let mut request = Actuation::default();
    request.angle_rad[..2].copy_from_slice(&[bottom, top]);
    request
}

/// Goal: commands at every limit, slewed to and fro for seconds, are no fault of a healthy driver; neither
/// cold nor with coils as warm as they may get, 109 degrees Celsius, when 48 V drive no more than 7.1 A
/// through them.
#[test]
fn a_healthy_driver_finds_no_fault_at_the_limits_of_current_slew_and_speed() {
    // Copper from 20 to 109 degrees: as much as this coefficient makes of 60 degrees.
    for (coefficient, reached) in [(0.0, 7.9), (0.00393 * 89.0 / 60.0, 7.0)] {
        let mut bench = Bench::with(&[
            ("/winding/reference_celsius", json!(0.0)),
            ("/winding/ambient_celsius", json!(60.0)),
            ("/winding/heat_capacity_j_per_k", json!(1e6)),
            ("/winding/resistance_coefficient_per_k", json!(coefficient)),
        ]);
        // From 27 ms, which a swing of 8 A takes, to half a second.
        for (turn, cycles) in [27, 30, 54, 60, 80, 120, 200, 500].into_iter().cycle().take(40).enumerate() {
            let sign = if turn % 2 == 0 { 1.0 } else { -1.0 };
            let mut request = currents(&[8.0, -8.0, 8.0, -8.0, 8.0, -8.0].map(|current| sign * current));
            request.angle_rad[..2].copy_from_slice(&[sign * 3.0, -sign * 3.0]);
            assert_eq!(bench.drive(&request, cycles), None, "{:?}", bench.plant.counts());
            if turn % 5 == 4 {
                assert_eq!(bench.drive(&currents(&[0.0; 6]), cycles), None, "{:?}", bench.plant.counts());
            }
        }
        assert_eq!(bench.told(), (fault_code::NONE, driver_state::DRIVEN));
        assert!(bench.plant.counts().current_max > reached, "{:?}", bench.plant.counts());
    }
}

/// Goal: a stuck amplifier holds what it held though the driver ramps to zero, its commander gone; the driver
/// notices within its time, cuts, and the coil is without current, whatever the amplifier would hold.
#[test]
fn a_stuck_amplifier_holds_through_the_ramp_until_the_driver_cuts_it() {
    for condition in [STUCK_CURRENT, STUCK_VOLTAGE] {
        let mut bench = Bench::with(&[]);
        bench.drive(&currents(&[4.0, -2.0]), 300);
        assert!(bench.plant.set_coil_condition(0, condition));
        // 100 ms of validity, 10 ms to a deviation of 1 A and 100 ms of it; then 10 ms to discharge.
        let noticed = bench.wait(400).expect("noticed");
        assert!((190..=215).contains(&noticed), "{noticed} ms");
        assert!((bench.current(0) - 4.0).abs() < 0.01, "held until then: {} A", bench.current(0));
        assert!(bench.current(1).abs() < 0.01, "the healthy ones ramped");
        assert_eq!(bench.told(), (fault_code::CURRENT_NOT_FOLLOWING, driver_state::DISABLED));
        assert_eq!(bench.plant.counts().last_driver_fault, Some(Fault::CurrentNotFollowing { coil: 0 }));
        bench.wait(15);
        assert_eq!(bench.current(0), 0.0);
        assert!(bench.plant.is_currentless());
    }
}

/// Goal: a current too small for the limit of a driven coil is still not left flowing when nobody asks for
/// it.
#[test]
fn a_small_stuck_current_is_cut_once_its_set_point_is_zero() {
    let mut bench = Bench::with(&[]);
    bench.drive(&currents(&[0.3]), 100);
    assert!(bench.plant.set_coil_condition(0, STUCK_CURRENT));
    assert_eq!(bench.drive(&currents(&[0.0, 1.0]), 90), None);
    assert!(bench.wait(400).is_some());
    bench.wait(15);
    assert_eq!(bench.current(0), 0.0);
}

/// Goal: after the fault has stood for its time the driver may be claimed, not before; what is still broken
/// is found again, what was mended works.
#[test]
fn a_fault_refuses_claims_while_it_stands_and_returns_until_it_is_mended() {
    let mut bench = Bench::with(&[]);
    bench.drive(&currents(&[3.0]), 100);
    assert!(bench.plant.set_coil_condition(0, STUCK_VOLTAGE));
    assert!(bench.drive(&currents(&[-3.0]), 400).is_some());
    bench.wait(20);
    assert!(!bench.claim(), "the fault stands");
    assert_eq!(bench.told(), (fault_code::CURRENT_NOT_FOLLOWING, driver_state::DISABLED));
    bench.wait(500);
    assert_eq!(bench.told(), (fault_code::NONE, driver_state::DISABLED));
    assert!(bench.claim());
    assert!(bench.drive(&currents(&[0.0]), 400).is_some(), "stuck as before");
    bench.wait(600);
    assert!(bench.plant.set_coil_condition(0, CoilCondition::Healthy));
    assert!(bench.claim());
    assert_eq!(bench.drive(&currents(&[3.0]), 400), None);
    assert!((bench.current(0) - 3.0).abs() < 1e-6);
}

#[test]
fn an_open_coil_loses_its_current_at_once_and_is_noticed() {
    let mut bench = Bench::with(&[]);
    bench.drive(&currents(&[0.0, 0.0, 0.0, 0.0, 3.0]), 100);
    assert!(bench.plant.set_coil_condition(4, CoilCondition::Open));
    assert_eq!(bench.current(4), 0.0);
    let noticed = bench.drive(&currents(&[0.0, 0.0, 0.0, 0.0, 3.0]), 400).expect("noticed");
    assert!((99..=105).contains(&noticed), "{noticed} ms");
    assert_eq!(bench.plant.counts().last_driver_fault, Some(Fault::CurrentNotFollowing { coil: 4 }));
}

/// Goal: with half of its turns shorted a coil carries what is asked and makes half the field: the rod rests
/// where half the current would let it.
#[test]
fn shorted_turns_take_their_share_of_the_field_and_not_of_the_current() {
    let rest = |condition: CoilCondition, current: f64| {
        let mut bench = Bench::with(&[]);
        assert!(bench.plant.set_coil_condition(4, condition));
        bench.drive(&currents(&[0.0, 0.0, 0.0, 0.0, current]), 4000);
        assert!((bench.current(4) - current).abs() < 1e-6 && bench.plant.counts().driver_faults == 0);
        bench.plant.truth()
    };
    let shorted = rest(CoilCondition::ShortedTurns { share: 0.5 }, 2.0);
    let half = rest(CoilCondition::Healthy, 1.0);
    let full = rest(CoilCondition::Healthy, 2.0);
    let angle = |one: usize, left: &magsteer_hal::PoseMessage, right: &magsteer_hal::PoseMessage| {
        Vector3::from(left.magnets[one].tangent())
            .angle(&Vector3::from(right.magnets[one].tangent()))
            .to_degrees()
    };
    for magnet in 0..2 {
        assert!(angle(magnet, &shorted, &half) < 1e-3);
        assert!(angle(magnet, &shorted, &full) > 1.0);
    }
}

#[test]
fn a_coil_that_gets_too_hot_is_cut_and_free_again_once_it_has_cooled() {
    let mut bench = Bench::with(&[
        ("/winding/resistance_coefficient_per_k", json!(0.00393)),
        // Half a second alone: 6 A warm it by 90 K and more.
        ("/winding/heat_capacity_j_per_k", json!(1.0)),
        ("/driver/temperature_max_celsius", json!(80.0)),
        ("/driver/temperature_release_celsius", json!(40.0)),
    ]);
    let request = currents(&[0.0, 0.0, 6.0]);
    assert!(bench.drive(&request, 2000).is_some());
    assert_eq!(bench.told(), (fault_code::OVER_TEMPERATURE, driver_state::DISABLED));
    assert_eq!(bench.plant.counts().last_driver_fault, Some(Fault::OverTemperature { coil: 2 }));
    let hottest = bench.plant.counts().coil_temperature_max.expect("coils") - 273.15;
    assert!((80.0..80.5).contains(&hottest), "{hottest} degrees Celsius");
    // From 80 to 40 with 20 around: 0.5 s ln 3.
    bench.wait(500);
    assert!(bench.plant.is_currentless());
    assert!(!bench.claim(), "still hot");
    bench.wait(60);
    assert_eq!(bench.told(), (fault_code::NONE, driver_state::DISABLED));
    assert!(bench.claim());
}

#[test]
fn a_stalled_motor_stands_and_is_noticed() {
    let mut bench = Bench::with(&[]);
    bench.drive(&angles(0.0, 0.2), 1500);
    assert!(bench.plant.set_frame_condition(1, FrameCondition::Stalled));
    // 20 degrees at 45 deg/s are 444 ms; then 500 ms.
    let noticed = bench.drive(&angles(0.0, 1.5), 2000).expect("noticed");
    assert!((940..=950).contains(&noticed), "{noticed} ms");
    assert_eq!(bench.told(), (fault_code::FRAME_NOT_FOLLOWING, driver_state::DISABLED));
    assert_eq!(bench.plant.actual().angle_rad[1], 0.2);
    assert_eq!(bench.plant.actual().angle_rad[0], 0.0);
}

#[test]
fn feedback_tells_what_is_measured_and_the_field_follows_what_is() {
    let mut bench = Bench::with(&[
        ("/amplifier/current_offset_a", json!(0.05)),
        ("/amplifier/current_step_a", json!(0.01)),
        ("/motor/backlash_deg", json!(2.0)),
        ("/motor/encoder_step_deg", json!(0.5)),
    ]);
    let mut request = currents(&[1.0, -1.0]);
    request.angle_rad[0] = 10.3_f64.to_radians();
    bench.drive(&request, 2000);
    let (actual, measured) = (*bench.plant.actual(), bench.plant.feedback().measured);
    // Currents are controlled by what is measured, so the true ones are off by the sensor's zero.
    assert!((measured.current_a[0] - 1.0).abs() < 0.011);
    assert!(((actual.current_a[0] - 1.0).abs() - 0.05).abs() < 0.01);
    assert!((measured.angle_rad[0].to_degrees() - 10.5).abs() < 1e-9);
    assert!((actual.angle_rad[0].to_degrees() - 9.3).abs() < 1e-9);
    // Where the rod rests is what the true actuation makes it.
    let mut still = bench.plant.clone();
    assert!(still.settle_at(&actual));
    let (found, expected) = (bench.plant.truth().magnets[1], still.truth().magnets[1]);
    assert!(Vector3::from(found.tangent()).angle(&Vector3::from(expected.tangent())).to_degrees() < 0.01);
}

#[test]
fn conditions_of_no_coil_or_frame_and_impossible_ones_are_refused() {
    let mut bench = Bench::with(&[]);
    assert!(!bench.plant.set_coil_condition(6, CoilCondition::Open));
    assert!(!bench.plant.set_frame_condition(2, FrameCondition::Stalled));
    for share in [-0.1, 0.95, f64::NAN] {
        assert!(!bench.plant.set_coil_condition(0, CoilCondition::ShortedTurns { share }));
    }
    assert_eq!(bench.drive(&currents(&[1.0; 6]), 300), None);
}

/// Goal: sensor errors, heat, coupling, faults and all: a run is the same every time, bit for bit.
#[test]
fn a_run_with_every_effect_repeats_bit_for_bit() {
    let run = |seed: u64| {
        let mut bench = Bench::with(&[
            ("/seed", json!(seed)),
            (
                "/amplifier",
                json!({
                    "bandwidth_hz": 200.0, "current_gain_relative": 0.002, "current_offset_a": 0.003,
                    "current_noise_a": 0.002, "current_step_a": 0.001
                }),
            ),
            ("/winding/resistance_coefficient_per_k", json!(0.00393)),
            ("/coupling", json!([{"coils": ["air-bottom", "air-top"], "coefficient": -0.1}])),
            ("/motor/backlash_deg", json!(0.05)),
        ]);
        let mut request = currents(&[1.0, -2.0, 3.0, -1.0, 2.0, -3.0]);
        request.angle_rad[..2].copy_from_slice(&[0.3, -0.3]);
        bench.drive(&request, 200);
        bench.plant.set_coil_condition(4, CoilCondition::ShortedTurns { share: 0.2 });
        bench.plant.set_coil_condition(5, STUCK_VOLTAGE);
        bench.drive(&currents(&[0.0; 6]), 300);
        (bench.plant.feedback(), bench.plant.truth(), *bench.plant.counts())
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3).0, run(4).0);
}
