//! A hand on two sticks and a dead-man button: which way the magnets turn, and when they may.
//!
//! Up and down turn a magnet about the axis of the targets, left and right towards that axis and away from it. Nothing moves unless
//! the button is held; letting go holds at once.

use magsteer::control::Directions;
use nalgebra::{Rotation3, Unit, Vector3};

/// Deflection below which a stick counts as centred, of 1.
const DEAD_ZONE: f64 = 0.1;
/// Farther than this the targets must not run ahead of the magnets, rad: a stick that is held does not wind up.
const LEAD_MAX: f64 = 0.35;

/// One stick, -1 to 1 each; down and right are positive, as the kernel has it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stick {
    pub x: f64,
    pub y: f64,
}

/// What both sticks and the button say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Grip {
    pub sticks: [Stick; 2],
    /// The dead-man button.
    pub held: bool,
}

/// What is to be asked of the daemon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// Nothing.
    Nothing,
    /// The button was pressed: go on from here.
    Take(Directions),
    /// Steer there.
    Steer(Directions),
    /// The button was let go.
    LetGo,
}

/// Turns deflections into targets.
#[derive(Debug)]
pub struct Hand {
    axis: Unit<Vector3<f64>>,
    /// At full deflection, rad/s.
    speed: f64,
    /// Index of the magnet of each stick.
    magnets: [Option<usize>; 2],
    directions: Directions,
    held: bool,
}

impl Hand {
    /// A hand that holds nothing; `magnets` are the indices of the magnets that the sticks turn.
    pub fn new(axis: Unit<Vector3<f64>>, speed: f64, magnets: [Option<usize>; 2]) -> Self {
        Self { axis, speed, magnets, directions: Directions::default(), held: false }
    }

    /// What `grip` asks for, `period` s after the last; `measured` is where the magnets are.
    pub fn order(&mut self, grip: &Grip, measured: &Directions, period: f64) -> Order {
        let was_held = std::mem::replace(&mut self.held, grip.held);
        match (was_held, grip.held) {
            (false, false) => Order::Nothing,
            (true, false) => Order::LetGo,
            (false, true) => {
                self.directions = *measured;
                Order::Take(self.directions)
            }
            (true, true) => {
                for (stick, magnet) in grip.sticks.iter().zip(self.magnets) {
                    if let Some(magnet) = magnet {
                        self.turn(magnet, stick, &measured[magnet], period);
                    }
                }
                Order::Steer(self.directions)
            }
        }
    }

    fn turn(&mut self, magnet: usize, stick: &Stick, measured: &[f64; 3], period: f64) {
        let present = Vector3::from(self.directions[magnet]);
        let step = self.speed * period;
        let about = Rotation3::from_axis_angle(&self.axis, -beyond(stick.y) * step);
        let towards = Unit::try_new(present.cross(&self.axis), 1e-6);
        let towards = towards.map_or_else(Rotation3::identity, |axis| {
            Rotation3::from_axis_angle(&axis, beyond(stick.x) * step)
        });
        let turned = about * (towards * present);
        if turned.angle(&Vector3::from(*measured)) <= LEAD_MAX {
            self.directions[magnet] = turned.into();
        }
    }
}

/// A deflection without its dead zone.
fn beyond(deflection: f64) -> f64 {
    let beyond = (deflection.abs() - DEAD_ZONE).max(0.0) / (1.0 - DEAD_ZONE);
    beyond.min(1.0).copysign(deflection)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 0.02;
    const SPEED: f64 = 0.5;

    fn hand() -> Hand {
        Hand::new(Vector3::y_axis(), SPEED, [Some(0), Some(1)])
    }

    fn along_x() -> Directions {
        let mut directions = Directions::default();
        directions[..2].fill([1.0, 0.0, 0.0]);
        directions
    }

    fn grip(x: f64, y: f64, held: bool) -> Grip {
        Grip { sticks: [Stick { x, y }, Stick::default()], held }
    }

    #[test]
    fn nothing_moves_unless_the_button_is_held_and_letting_go_is_told_once() {
        let (mut hand, measured) = (hand(), along_x());
        let pushed = |held| grip(0.0, -1.0, held);
        assert_eq!(hand.order(&pushed(false), &measured, PERIOD), Order::Nothing);
        assert_eq!(hand.order(&pushed(true), &measured, PERIOD), Order::Take(measured));
        assert!(matches!(hand.order(&pushed(true), &measured, PERIOD), Order::Steer(to) if to != measured));
        assert_eq!(hand.order(&pushed(false), &measured, PERIOD), Order::LetGo);
        assert_eq!(hand.order(&pushed(false), &measured, PERIOD), Order::Nothing);
        assert_eq!(
            hand.order(&pushed(true), &measured, PERIOD),
            Order::Take(measured),
            "from where the magnets are"
        );
    }

    /// Goal: full deflection turns at the speed, each stick its magnet, up about the axis and right towards it.
    #[test]
    fn full_deflection_turns_at_the_speed_in_the_stated_sense() {
        let measured = along_x();
        for (x, y, towards) in [
            (0.0, -1.0, -Vector3::z()),
            (0.0, 1.0, Vector3::z()),
            (1.0, 0.0, Vector3::y()),
            (-1.0, 0.0, -Vector3::y()),
        ] {
            let mut hand = hand();
            hand.order(&grip(x, y, true), &measured, PERIOD);
            let Order::Steer(to) = hand.order(&grip(x, y, true), &measured, PERIOD) else { panic!("held") };
            let turned = Vector3::from(to[0]);
            assert!((turned.angle(&Vector3::x()) - SPEED * PERIOD).abs() < 1e-12, "{x} {y}: {turned}");
            assert!(turned.dot(&towards) > 0.0, "{x} {y}: {turned}");
            assert_eq!(to[1], measured[1], "the other stick is centred");
        }
    }

    #[test]
    fn centred_sticks_turn_nothing_and_held_ones_do_not_run_far_ahead() {
        let (mut hand, measured) = (hand(), along_x());
        hand.order(&grip(0.0, 0.0, true), &measured, PERIOD);
        assert_eq!(hand.order(&grip(0.09, -0.09, true), &measured, PERIOD), Order::Steer(measured));
        let mut last = measured;
        for _ in 0..1_000 {
            if let Order::Steer(to) = hand.order(&grip(0.3, -1.0, true), &measured, PERIOD) {
                last = to;
            }
        }
        let lead = Vector3::from(last[0]).angle(&Vector3::x());
        assert!(lead <= LEAD_MAX && lead > 0.9 * LEAD_MAX, "{lead}");
    }
}
