//! Circuits, current loops and windings against closed forms; the table of `docs/electrical.md`.

#[path = "../src/fixture.rs"]
mod fixture;
mod validation;

use magsteer_hal::message::POSE_PARAMETERS_MAX;
use magsteer_hal::{Actuation, COILS_MAX, Setpoint};
use magsteer_sim_plant::actuation::{
    ActuationSettings, Actuators, Amplifier, CircuitValues, Circuits, CoilCondition, CoilsSettings,
    CouplingPair, Couplings, CurrentSensorCharacter, MotorCharacter, SHORTED_MAX, WatchSettings,
    WindingCharacter,
};
use validation::{Row, hold};

/// The ends and the middle of what a plant's step may be, s.
const STEPS: [f64; 4] = [5e-5, 5e-4, 1e-3, 2e-3];
const BANDWIDTH: f64 = std::f64::consts::TAU * 200.0;
/// Copper, 1/K.
const COPPER: f64 = 0.00393;
const AMBIENT: f64 = 293.15;

/// Coils as shipped but for what a test sets: no sensor error, no fault that cuts in.
fn settings(winding: WindingCharacter, pairs: &[CouplingPair]) -> ActuationSettings {
    ActuationSettings {
        coils: CoilsSettings {
            bandwidth: BANDWIDTH,
            sensor: CurrentSensorCharacter::default(),
            winding,
            couplings: Couplings::new(6, pairs).expect("weak"),
        },
        motor: MotorCharacter { acceleration_max: 3.5, backlash: 0.0, encoder_step: 0.0 },
        frame_start: [0.0; POSE_PARAMETERS_MAX],
        watch: WatchSettings {
            current_deviation_max: 100.0,
            idle_current_max: 100.0,
            current_deviation_time: 1.0,
            angle_deviation_max: 10.0,
            angle_deviation_time: 1.0,
            temperature_max: 1000.0,
            temperature_release: 900.0,
        },
    }
}

/// Copper that warms within seconds: 20 s alone.
fn winding(coefficient: f64) -> WindingCharacter {
    WindingCharacter {
        ambient: AMBIENT,
        reference: AMBIENT,
        coefficient,
        thermal_resistance: 0.5,
        heat_capacity: 40.0,
    }
}

fn pairs() -> Vec<CouplingPair> {
    let pair = |one, other, coefficient| CouplingPair { coils: [one, other], coefficient };
    vec![pair(0, 2, -0.2), pair(1, 3, -0.1), pair(0, 1, -0.1), pair(2, 4, 0.15), pair(3, 5, 0.05)]
}

fn drive(currents: &[f64]) -> Setpoint {
    let mut wanted = Actuation { current_a: [0.0; COILS_MAX], angle_rad: [0.0; POSE_PARAMETERS_MAX] };
    wanted.current_a[..currents.len()].copy_from_slice(currents);
    Setpoint::Drive(wanted)
}

/// One coil at constant voltage: `V/R (1 - exp(-R t / L))`. As a share of `V/R`.
fn step_response_deviation(step: f64) -> f64 {
    let values = CircuitValues { resistance: 5.0, inductance: 0.1 };
    let mut circuits = Circuits::new(&[values], &[1.0], step);
    let mut voltages = [0.0; COILS_MAX];
    voltages[0] = 48.0;
    let mut most = 0.0_f64;
    for count in 1..=(0.2 / step) as u32 {
        circuits.advance(&voltages);
        let exact = -(-50.0 * f64::from(count) * step).exp_m1();
        most = most.max((circuits.currents()[0] / 9.6 - exact).abs());
    }
    most
}

/// Two unlike coils at constant voltages, by their normal modes: with `A = L^-1 R`, `s` half its trace, `q^2
/// = s^2 - det A`, `exp(-A t) = e^(-s t) (cosh(q t) 1 - sinh(q t) / q (A - s))`. As a share of the greatest
/// current.
fn coupled_response_deviation(step: f64) -> f64 {
    let coils = [
        CircuitValues { resistance: 5.0, inductance: 0.1 },
        CircuitValues { resistance: 8.0, inductance: 0.05 },
    ];
    let coefficient = -0.4_f64;
    let mut circuits = Circuits::new(&coils, &[1.0, coefficient, coefficient, 1.0], step);
    let mutual = coefficient * (0.1_f64 * 0.05).sqrt();
    let determinant = 0.1 * 0.05 - mutual * mutual;
    let a = [
        [0.05 * 5.0 / determinant, -mutual * 8.0 / determinant],
        [-mutual * 5.0 / determinant, 0.1 * 8.0 / determinant],
    ];
    let s = 0.5 * (a[0][0] + a[1][1]);
    let q = (s * s - (a[0][0] * a[1][1] - a[0][1] * a[1][0])).sqrt();
    let volts = [48.0, -20.0];
    let steady = [48.0 / 5.0, -20.0 / 8.0];
    let mut voltages = [0.0; COILS_MAX];
    voltages[..2].copy_from_slice(&volts);
    let mut most = 0.0_f64;
    for count in 1..=(0.2 / step) as u32 {
        circuits.advance(&voltages);
        let t = f64::from(count) * step;
        let (even, odd) = ((q * t).cosh(), (q * t).sinh() / q);
        let decayed = |row: usize| {
            let other = 1 - row;
            let own = even - odd * (a[row][row] - s);
            (-s * t).exp() * (own * -steady[row] - odd * a[row][other] * -steady[other])
        };
        for (row, (current, steady)) in circuits.currents().iter().zip(steady).enumerate() {
            most = most.max((current - steady - decayed(row)).abs() / 9.6);
        }
    }
    most
}

/// A described coil with its amplifier, unsaturated: `s (1 - exp(-w t))`. As a share of the set point.
fn loop_deviation(step: f64) -> f64 {
    let coil = &fixture::bigmag().coils[0];
    let values = CircuitValues { resistance: coil.resistance, inductance: coil.inductance };
    let mut circuits = Circuits::new(&[values], &[1.0], step);
    let mut amplifier = Amplifier::new(coil, BANDWIDTH, step);
    let mut most = 0.0_f64;
    for count in 1..=(0.05 / step) as u32 {
        let mut voltages = [0.0; COILS_MAX];
        voltages[0] = amplifier.follow(0.05, circuits.currents()[0]);
        circuits.advance(&voltages);
        let exact = -(-BANDWIDTH * f64::from(count) * step).exp_m1();
        most = most.max((circuits.currents()[0] / 0.05 - exact).abs());
    }
    most
}

/// A coil cut off at `i` is at zero after `L / R ln(1 + i R / V)`, in a plant at the first step that ends
/// later. By how much, in steps, it is earlier than that or later than a step after it.
fn discharge_deviation(step: f64) -> f64 {
    let mut actuators = Actuators::new(&fixture::bigmag(), &settings(winding(0.0), &[]), step, 1);
    (0..(0.5 / step) as u32).for_each(|_| {
        actuators.follow(&drive(&[8.0]));
    });
    let expected = 0.02 * (1.0 + actuators.actual().current_a[0] * 5.0 / 48.0_f64).ln() / step;
    let mut steps = 0.0;
    while actuators.actual().current_a[0] != 0.0 {
        actuators.follow(&Setpoint::Disable(Actuation::default()));
        steps += 1.0;
    }
    (expected - steps).max(steps - expected - 1.0).max(0.0)
}

/// Coupled, warming coils on waves that saturate their supplies, in the end cut off: work of the supplies
/// against heat and stored energy, as a share of the heat.
fn energy_deviation(step: f64) -> f64 {
    let mut actuators = Actuators::new(&fixture::bigmag(), &settings(winding(COPPER), &pairs()), step, 1);
    let (mut work, mut heat, mut most) = (0.0, 0.0, 0.0_f64);
    let mut resistances = [5.0; 6];
    for count in 0..(10.0 / step) as u32 {
        let time = f64::from(count) * step;
        let mut wanted = [0.0; 6];
        for (coil, wanted) in wanted.iter_mut().enumerate() {
            *wanted = 7.0 * (time * (3.0 + 5.0 * coil as f64)).sin();
        }
        let setpoint = if time < 9.9 { drive(&wanted) } else { Setpoint::Disable(Actuation::default()) };
        actuators.follow(&setpoint);
        let circuits = actuators.coils().circuits();
        work += circuits.work();
        heat += (0..6).map(|coil| circuits.heat(coil)).sum::<f64>();
        if count > 100 {
            most = most.max((work - heat - circuits.stored_energy()).abs() / heat);
        }
        for (coil, resistance) in resistances.iter_mut().enumerate() {
            *resistance = circuits.resistance(coil);
        }
    }
    assert!(resistances.iter().all(|resistance| *resistance > 5.4), "coils warmed: {resistances:?}");
    assert_eq!(actuators.coils().circuits().stored_energy(), 0.0);
    most
}

/// Constant current through copper: `C dT/dt = i^2 R(T) - (T - T_a) / Z` is linear in `T`, with the fixed
/// point `T_a + P Z / (1 - alpha P Z)` and the time constant `Z C / (1 - alpha P Z)`, `P = i^2 R_0`. Greatest
/// deviation on the way and deviation in the end, K.
fn warming_deviation() -> (f64, f64) {
    let step = 1e-3;
    let mut actuators = Actuators::new(&fixture::bigmag(), &settings(winding(COPPER), &[]), step, 1);
    let temperature = |actuators: &Actuators| actuators.temperature(0).expect("a coil");
    let rise = 25.0 * 5.0 * 0.5;
    let fixed = AMBIENT + rise / (1.0 - COPPER * rise);
    let time_constant = 20.0 / (1.0 - COPPER * rise);
    let mut most = 0.0_f64;
    let mut begin = 0.0;
    for count in 0..600_000 {
        actuators.follow(&drive(&[5.0]));
        // From when the current stands.
        if count == 500 {
            begin = temperature(&actuators);
        } else if count > 500 {
            let time = f64::from(count - 500) * step;
            let exact = fixed + (begin - fixed) * (-time / time_constant).exp();
            most = most.max((temperature(&actuators) - exact).abs());
        }
    }
    (most, (temperature(&actuators) - fixed).abs())
}

#[test]
fn electrical_page_holds_what_is_measured() {
    let most = |deviation: fn(f64) -> f64| STEPS.map(deviation).into_iter().fold(0.0, f64::max);
    let (warming, warm) = warming_deviation();
    let rows = [
        Row::new("one coil at constant voltage, of V/R", most(step_response_deviation), 1e-12, ""),
        Row::new(
            "two coupled coils by their normal modes, of V/R",
            most(coupled_response_deviation),
            1e-12,
            "",
        ),
        Row::new("current loop of first order, of the set point", most(loop_deviation), 1e-12, ""),
        Row::new("discharge of a coil cut off, beyond one step", most(discharge_deviation), 1e-6, "steps"),
        Row::new(
            "work = heat + stored, 10 s, coupled and warming, of the heat",
            most(energy_deviation),
            1e-5,
            "",
        ),
        Row::new("warming at 5 A, linear equation with R(T)", warming, 5e-3, "K"),
        // The tolerance of R, 1e-5, leaves 1e-5 of the rise of 83 K, divided by 1 - alpha P Z.
        Row::new("fixed point of temperature and R(T) at 5 A", warm, 2e-3, "K"),
    ];
    hold("electrical.md", "electrical", &rows);
}

/// Goal: while one coil ramps, its neighbour at a set point of zero stays within what the controller's gain
/// allows, and comes back.
#[test]
fn coupling_disturbs_a_neighbour_and_its_amplifier_removes_it() {
    for step in STEPS {
        let coupled = [CouplingPair { coils: [0, 2], coefficient: -0.2 }];
        let mut actuators = Actuators::new(&fixture::bigmag(), &settings(winding(0.0), &coupled), step, 1);
        let mut most = 0.0_f64;
        for count in 0..(0.4 / step) as u32 {
            let ramp = (300.0 * step * f64::from(count)).min(3.0);
            actuators.follow(&drive(&[ramp]));
            most = most.max(actuators.actual().current_a[2].abs());
        }
        // The ramp induces k L di/dt = 6 V against a sampled gain of L (1 - exp(-w t)) / t, near enough.
        let gain = 0.1 * -(-BANDWIDTH * step).exp_m1() / step;
        assert!(most > 0.3 * 6.0 / gain && most < 1.05 * 6.0 / gain, "step {step}: {most} A");
        let rest = actuators.actual().current_a[2].abs();
        assert!(rest < 1e-6, "step {step}: {rest} A");
        assert!((actuators.actual().current_a[0] - 3.0).abs() < 1e-6);
    }
}

/// Goal: the strongest coupling that is admitted leaves the loops stable at the longest step, with turns
/// shorted too.
#[test]
fn the_strongest_admitted_coupling_keeps_the_loops_stable() {
    let chain: Vec<CouplingPair> = (0..5)
        .map(|coil| CouplingPair {
            coils: [coil, coil + 1],
            coefficient: if coil % 2 == 0 { 0.165 } else { -0.165 },
        })
        .collect();
    for step in STEPS {
        for share in [0.0, 0.5, SHORTED_MAX] {
            let mut actuators = Actuators::new(&fixture::bigmag(), &settings(winding(0.0), &chain), step, 1);
            let condition = CoilCondition::ShortedTurns { share };
            assert!(actuators.set_coil_condition(2, condition));
            let wanted = [2.0, -1.0, 1.5, 0.0, -2.0, 1.0];
            for _ in 0..(1.5 / step) as u32 {
                actuators.follow(&drive(&wanted));
            }
            for (current, wanted) in actuators.actual().current_a.iter().zip(wanted) {
                assert!((current - wanted).abs() < 1e-6, "step {step}, {share} shorted: {current} A");
            }
        }
    }
}
