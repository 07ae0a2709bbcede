//! A motor that turns a frame: within speed, acceleration and range, through a gear with play, seen by an
//! encoder.
//!
//! | symbol | meaning |
//! |---|---|
//! | `p`, `u` | angle of the motor, rad; its speed over the last step, rad/s |
//! | `D` | way to go: set point, held within the frame's range, minus `p` |
//! | `U`, `A` | greatest speed, rad/s, and acceleration, rad/s^2 |
//! | `f`, `b` | angle of the frame, rad; play of the gear, rad |
//! | `t` | the step, s |
//!
//! The speed is constant over a step and changes between steps by at most `A t`: `p <- p + t u`. A motor at
//! speed `u` that brakes from the next step on still needs the way
//!
//! `t ((m + 1) u - A t m (m + 1) / 2)`, `m = floor(u / (A t))`,                                   (13)
//!
//! which rises with `u`, so that the greatest speed from which it stops within `D` is
//!
//! `u = D / ((m + 1) t) + A t m / 2`, `m = floor((sqrt(1 + 8 D / (A t^2)) - 1) / 2)`              (14)
//!
//! taken as far as `U` and `A t` allow: a trapezoid over time that is exact at every step. It meets a
//! standing set point without overshoot and then stands; a set point that turns back is overrun only by what
//! no brake could help.
//!
//! The frame lags the motor by the gear's play, `f` in `[p - b/2, p + b/2]`, moving only when pushed (15).
//! The encoder sits at the motor and rounds `p` to its step (16): what is measured is off by as much as both.

use magsteer_hal::description::FrameDescription;

use super::condition::FrameCondition;
use super::sensor::quantised;

/// What motors, gears and encoders are like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorCharacter {
    /// `A`, rad/s^2.
    pub acceleration_max: f64,
    /// `b`, rad.
    pub backlash: f64,
    /// Step of the encoder, rad; 0 for none.
    pub encoder_step: f64,
}

/// One frame's motor.
#[derive(Debug, Clone)]
pub struct Motor {
    character: MotorCharacter,
    least: f64,
    greatest: f64,
    speed_max: f64,
    step: f64,
    angle: f64,
    speed: f64,
    frame_angle: f64,
    condition: FrameCondition,
}

impl Motor {
    /// Standing at `start`, rad, or at the end of its range that is nearest. `step` in s.
    #[must_use]
    pub fn new(frame: &FrameDescription, character: MotorCharacter, start: f64, step: f64) -> Self {
        let angle = start.clamp(frame.angle_min, frame.angle_max);
        Self {
            character,
            least: frame.angle_min,
            greatest: frame.angle_max,
            speed_max: frame.speed_max,
            step,
            angle,
            speed: 0.0,
            frame_angle: angle,
            condition: FrameCondition::Healthy,
        }
    }

    /// True angle of the frame, rad.
    #[must_use]
    pub fn frame_angle(&self) -> f64 {
        self.frame_angle
    }

    /// What the encoder says, rad.
    #[must_use]
    pub fn measured_angle(&self) -> f64 {
        quantised(self.angle, self.character.encoder_step) // (16)
    }

    /// Sets what is wrong with it.
    pub fn set_condition(&mut self, condition: FrameCondition) {
        self.condition = condition;
    }

    /// Moves towards an angle, rad, for one step.
    pub fn follow(&mut self, setpoint: f64) {
        match self.condition {
            FrameCondition::Healthy => self.turn(setpoint.clamp(self.least, self.greatest)),
            FrameCondition::Stalled => self.speed = 0.0,
        }
        let play = 0.5 * self.character.backlash;
        self.frame_angle = self.frame_angle.clamp(self.angle - play, self.angle + play); // (15)
    }

    fn turn(&mut self, wanted: f64) {
        // Rounding of the way to go may not keep it from braking as it planned to: some 1e-8 of a step's
        // change of speed.
        const ROUNDING: f64 = 1e-6;
        let (step, speed_step) = (self.step, self.character.acceleration_max * self.step);
        let change_max = speed_step * (1.0 + ROUNDING);
        let way = wanted - self.angle;
        let (distance, sign) = (way.abs(), 1.0_f64.copysign(way));
        let brake_steps = (0.5 * ((1.0 + 8.0 * distance / (speed_step * step)).sqrt() - 1.0)).floor();
        let stoppable = distance / ((brake_steps + 1.0) * step) + 0.5 * speed_step * brake_steps; // (14)
        // Along the way to go; negative when it still moves the other way.
        let before = sign * self.speed;
        let reachable = stoppable.min(self.speed_max).clamp(before - change_max, before + change_max);
        self.speed = sign * reachable;
        if reachable == stoppable && brake_steps == 0.0 {
            // The whole way in one step: without the rounding of its sum.
            self.angle = wanted;
        } else {
            self.angle += step * self.speed;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    const STEPS: [f64; 4] = [5e-5, 5e-4, 1e-3, 2e-3];
    const PLAIN: MotorCharacter = MotorCharacter { acceleration_max: 3.5, backlash: 0.0, encoder_step: 0.0 };

    fn motor(character: MotorCharacter, step: f64) -> Motor {
        Motor::new(&fixture::bigmag().frames[0], character, 0.0, step)
    }

    /// Turns for a step; asserts that speed and acceleration stay within their limits.
    fn follow(motor: &mut Motor, setpoint: f64) {
        let (angle, speed) = (motor.angle, motor.speed);
        motor.follow(setpoint);
        assert!((motor.angle - angle - motor.step * motor.speed).abs() < 1e-15, "speed is not what moves it");
        assert!(motor.speed.abs() <= motor.speed_max * (1.0 + 1e-12));
        let most = motor.character.acceleration_max * motor.step * (1.0 + 2e-6);
        assert!((motor.speed - speed).abs() <= most, "{} to {} rad/s", speed, motor.speed);
        assert!((motor.least..=motor.greatest).contains(&motor.angle));
    }

    /// Goal: a long way takes the time of the trapezoid, `D / U + U / A`, up to a step for each of its three
    /// pieces; the motor never goes past the set point, nor back, and then stands on it.
    #[test]
    fn a_long_turn_is_a_trapezoid_without_overshoot() {
        for step in STEPS {
            let mut motor = motor(PLAIN, step);
            let (wanted, speed_max) = (0.9, motor.speed_max);
            let expected = wanted / speed_max + speed_max / PLAIN.acceleration_max;
            let mut steps = 0;
            while motor.angle != wanted {
                let before = motor.angle;
                follow(&mut motor, wanted);
                assert!(motor.angle > before && motor.angle <= wanted, "step {step}");
                steps += 1;
            }
            let took = f64::from(steps) * step;
            assert!(
                took >= expected - step && took <= expected + 3.0 * step,
                "{took} s, expected {expected}"
            );
            for _ in 0..100 {
                follow(&mut motor, wanted);
                assert!(motor.angle == wanted && motor.speed == 0.0);
            }
        }
    }

    #[test]
    fn short_turns_of_any_length_end_on_their_set_point_without_overshoot() {
        for step in STEPS {
            for exponent in 0..60 {
                let wanted = 0.3 * 0.7_f64.powi(exponent);
                let mut motor = motor(PLAIN, step);
                for _ in 0..(1.0 / step) as usize {
                    follow(&mut motor, wanted);
                    assert!(motor.angle <= wanted);
                }
                assert!(motor.angle == wanted && motor.speed == 0.0, "step {step}, {wanted} rad");
            }
        }
    }

    #[test]
    fn a_slow_set_point_is_followed_at_its_speed_without_chatter() {
        for step in STEPS {
            for speed in [1e-4, 0.01, 0.3, 0.78] {
                let mut motor = motor(PLAIN, step);
                for count in 1..=(1.0 / step) as u32 {
                    let before = motor.speed;
                    follow(&mut motor, speed * step * f64::from(count));
                    assert!(
                        motor.speed >= before - 1e-9,
                        "step {step}, {speed} rad/s: slowed to {}",
                        motor.speed
                    );
                }
                assert!((motor.speed - speed).abs() < 1e-6, "step {step}: {} rad/s", motor.speed);
            }
        }
    }

    #[test]
    fn a_set_point_that_wanders_is_followed_within_all_limits_and_met_in_the_end() {
        for step in STEPS {
            let mut motor = motor(PLAIN, step);
            for count in 0..(20.0 / step) as u32 {
                let time = f64::from(count) * step;
                follow(&mut motor, 4.0 * (3.0 * time).sin() * (7.1 * time).cos());
            }
            for _ in 0..(10.0 / step) as u32 {
                follow(&mut motor, -1.25);
            }
            assert!(motor.angle == -1.25 && motor.speed == 0.0, "step {step}");
        }
    }

    /// Goal: the bound that `plant.driver.frame_error_max_deg` is checked against.
    #[test]
    fn a_motor_turned_back_at_full_speed_lags_by_three_braking_ways() {
        let mut motor = motor(PLAIN, 5e-4);
        let (speed, bound) = (motor.speed_max, 1.5 * motor.speed_max.powi(2) / PLAIN.acceleration_max);
        let (mut setpoint, mut direction, mut most) = (0.0, 1.0, 0.0_f64);
        for count in 0..60_000 {
            // Turns back at intervals that differ.
            if count % (400 + 37 * (count / 4000)) == 0 {
                direction = -direction;
            }
            setpoint = (setpoint + direction * speed * 5e-4_f64).clamp(-3.0, 3.0);
            follow(&mut motor, setpoint);
            most = most.max((setpoint - motor.angle).abs());
        }
        assert!(most > 0.9 * bound && most < bound + 2.0 * speed * 5e-4, "{most} rad, bound {bound}");
    }

    #[test]
    fn a_turn_beyond_the_range_ends_at_its_end() {
        let mut motor = motor(PLAIN, 5e-4);
        (0..20_000).for_each(|_| follow(&mut motor, 10.0));
        assert_eq!(motor.frame_angle(), fixture::bigmag().frames[0].angle_max);
    }

    #[test]
    fn the_frame_lags_by_half_the_play_and_stands_while_the_motor_crosses_it() {
        let character = MotorCharacter { backlash: 0.02, ..PLAIN };
        let mut motor = motor(character, 5e-4);
        (0..4000).for_each(|_| follow(&mut motor, 0.5));
        assert!((motor.frame_angle() - 0.49).abs() < 1e-15 && motor.measured_angle() == 0.5);
        (0..4000).for_each(|_| follow(&mut motor, 0.485));
        assert!((motor.frame_angle() - 0.49).abs() < 1e-15, "inside the play nothing pushes");
        (0..4000).for_each(|_| follow(&mut motor, 0.4));
        assert!((motor.frame_angle() - 0.41).abs() < 1e-15);
    }

    #[test]
    fn the_encoder_sees_the_motor_in_whole_steps() {
        let character = MotorCharacter { backlash: 0.02, encoder_step: 1e-3, ..PLAIN };
        let mut motor = motor(character, 5e-4);
        for _ in 0..1000 {
            follow(&mut motor, 0.1234);
            let digits = motor.measured_angle() / 1e-3;
            assert!((digits - digits.round()).abs() < 1e-9);
            assert!((motor.measured_angle() - motor.angle).abs() <= 0.5e-3 * (1.0 + 1e-9));
        }
        assert!((motor.measured_angle() - 0.123).abs() < 1e-12);
    }

    #[test]
    fn a_stalled_motor_stands_until_it_is_freed() {
        let mut motor = motor(PLAIN, 5e-4);
        (0..200).for_each(|_| follow(&mut motor, 0.5));
        motor.set_condition(FrameCondition::Stalled);
        let angle = motor.frame_angle();
        (0..200).for_each(|_| motor.follow(0.5));
        assert_eq!((motor.frame_angle(), motor.speed), (angle, 0.0));
        motor.set_condition(FrameCondition::Healthy);
        (0..4000).for_each(|_| follow(&mut motor, 0.5));
        assert_eq!(motor.frame_angle(), 0.5);
    }
}
