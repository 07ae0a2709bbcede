//! A motor that turns a frame: follows an angle within its speed and range.

use magsteer_hal::description::FrameDescription;

/// One frame's motor.
#[derive(Debug, Clone)]
pub struct Motor {
    least: f64,
    greatest: f64,
    /// Greatest change of angle in one step, rad.
    reach: f64,
    angle: f64,
}

impl Motor {
    /// Standing at zero, or at the end of its range that is nearest. `step` in s.
    #[must_use]
    pub fn new(frame: &FrameDescription, step: f64) -> Self {
        Self {
            least: frame.angle_min,
            greatest: frame.angle_max,
            reach: frame.speed_max * step,
            angle: 0.0_f64.clamp(frame.angle_min, frame.angle_max),
        }
    }

    /// Present angle, rad.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// Moves towards an angle, rad, for one step.
    pub fn follow(&mut self, setpoint: f64) {
        let wanted = setpoint.clamp(self.least, self.greatest);
        self.angle += (wanted - self.angle).clamp(-self.reach, self.reach);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn motor_takes_the_time_that_its_speed_needs_and_stops_at_its_range() {
        let frame = &fixture::bigmag().frames[0];
        let step = 5e-4;
        let mut motor = Motor::new(frame, step);
        // 45 deg/s: 30 degrees take 2/3 s.
        let steps = (30.0 / 45.0 / step) as usize;
        for _ in 0..steps {
            let before = motor.angle();
            motor.follow(30.0_f64.to_radians());
            assert!((motor.angle() - before).abs() <= frame.speed_max * step * (1.0 + 1e-12));
            assert!(motor.angle() < 30.0_f64.to_radians());
        }
        motor.follow(30.0_f64.to_radians());
        assert!((motor.angle() - 30.0_f64.to_radians()).abs() < 1e-12);
        (0..20_000).for_each(|_| motor.follow(10.0));
        assert_eq!(motor.angle(), frame.angle_max);
    }
}
