//! A planar swing by other means: a chain of rigid links with their absolute angles as coordinates.
//!
//! | symbol | meaning |
//! |---|---|
//! | `a_i` | angle of link `i` above the horizontal |
//! | `l_i`, `m_i`, `J_i` | its length, mass and inertia about its centre |
//! | `k_i` | stiffness of the joint before it, the clamp's for the first |
//! | `tau` | Kelvin-Voigt time constant |
//!
//! A section is cut into equal links with joints `EI/h`, and `2 EI/h` where it meets the clamp or a magnet, half a link away;
//! a magnet is one link. Nothing stretches or shears. Lagrange's equations are
//!
//! `sum_j A_ij [cos(a_i - a_j) a_j'' + sin(a_i - a_j) a_j'^2] = -g S_i cos a_i - joints (k, k tau)`
//!
//! with `A_ii = J_i + m_i l_i^2/4 + l_i^2 M_i`, `A_ij = l_i S_j` for `i < j`, `S_i = l_i (m_i/2 + M_i)`, over `l_i` in `A_ij`, and `M_i` the
//! mass beyond link `i`. Time: the stiffly stable Runge-Kutta method of order 4 with five implicit stages and `1/4` on its
//! diagonal (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.6).

use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use nalgebra::{DMatrix, DVector};

const GAMMA: f64 = 0.25;
const STAGES: [&[f64]; 5] = [
    &[],
    &[1.0 / 2.0],
    &[17.0 / 50.0, -1.0 / 25.0],
    &[371.0 / 1360.0, -137.0 / 2720.0, 15.0 / 544.0],
    &[25.0 / 24.0, -49.0 / 48.0, 125.0 / 16.0, -85.0 / 12.0],
];

pub struct Links {
    length: Vec<f64>,
    /// `A`.
    inertia: DMatrix<f64>,
    /// `g S`.
    weight: DVector<f64>,
    /// Of the joints, as a matrix on the angles.
    stiffness: DMatrix<f64>,
    tau: f64,
    angle: DVector<f64>,
    speed: DVector<f64>,
}

impl Links {
    /// At rest, straight and level; every section cut into `cuts` links.
    pub fn new(description: &ManipulatorDescription, cuts: usize, gravity: f64, tau: f64) -> Self {
        let (mut length, mut mass, mut spin, mut joint) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut pending: Option<f64> = None;
        for part in &description.parts {
            match part {
                PartDescription::Section(section) => {
                    let h = section.length / cuts as f64;
                    let stiffness = section.bending_stiffness / h;
                    for cut in 0..cuts {
                        length.push(h);
                        mass.push(section.mass_per_length * h);
                        spin.push(
                            section.mass_per_length * h * (h * h / 12.0 + section.radius.powi(2) / 4.0),
                        );
                        joint.push(if cut == 0 { 2.0 * stiffness } else { stiffness });
                    }
                    pending = Some(2.0 * stiffness);
                }
                PartDescription::Magnet(magnet) => {
                    length.push(magnet.length);
                    mass.push(magnet.mass);
                    spin.push(magnet.mass * (3.0 * magnet.radius.powi(2) + magnet.length.powi(2)) / 12.0);
                    joint.push(pending.expect("a magnet after a section"));
                }
            }
        }
        let count = length.len();
        let beyond = |i: usize| mass[i + 1..].iter().sum::<f64>();
        let first_moment = |i: usize| length[i] * (0.5 * mass[i] + beyond(i));
        let inertia = DMatrix::from_fn(count, count, |i, j| {
            if i == j {
                spin[i] + length[i].powi(2) * (0.25 * mass[i] + beyond(i))
            } else {
                length[i.min(j)] * first_moment(i.max(j))
            }
        });
        let mut stiffness = DMatrix::zeros(count, count);
        for (i, k) in joint.iter().enumerate() {
            stiffness[(i, i)] += k;
            if i > 0 {
                stiffness[(i - 1, i - 1)] += k;
                stiffness[(i, i - 1)] -= k;
                stiffness[(i - 1, i)] -= k;
            }
        }
        Self {
            inertia,
            weight: DVector::from_fn(count, |i, _| gravity * first_moment(i)),
            stiffness,
            tau,
            angle: DVector::zeros(count),
            speed: DVector::zeros(count),
            length,
        }
    }

    /// `A cos(a_i - a_j)`, and what its product with the accelerations must be.
    fn equations(&self, angle: &DVector<f64>, speed: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (sine, cosine) = (angle.map(f64::sin), angle.map(f64::cos));
        let count = angle.len();
        let mass = DMatrix::from_fn(count, count, |i, j| {
            self.inertia[(i, j)] * (cosine[i] * cosine[j] + sine[i] * sine[j])
        });
        let square = speed.component_mul(speed);
        let (by_sine, by_cosine) = (square.component_mul(&sine), square.component_mul(&cosine));
        let swirl = sine.component_mul(&(&self.inertia * by_cosine))
            - cosine.component_mul(&(&self.inertia * by_sine));
        let joints = &self.stiffness * (angle + speed * self.tau);
        (mass, -swirl - cosine.component_mul(&self.weight) - joints)
    }

    /// Advances by one step.
    pub fn step(&mut self, step: f64) {
        let reach = step * GAMMA;
        let (mass, force) = self.equations(&self.angle, &self.speed);
        // Inertia, joints and their damping steer the iteration; weight and swirl follow it.
        let steer = &mass + &self.stiffness * (reach * self.tau + reach * reach);
        let steer = steer.cholesky().expect("positive definite");
        let mut guess = steer.solve(&force);
        let (mut speeds, mut accelerations): (Vec<DVector<f64>>, Vec<DVector<f64>>) =
            (Vec::new(), Vec::new());
        for row in STAGES {
            let (mut angle_base, mut speed_base) = (self.angle.clone(), self.speed.clone());
            for ((share, speed), acceleration) in row.iter().zip(&speeds).zip(&accelerations) {
                angle_base += speed * (share * step);
                speed_base += acceleration * (share * step);
            }
            for iteration in 0.. {
                let speed = &speed_base + &guess * reach;
                let (mass, force) = self.equations(&(&angle_base + &speed * reach), &speed);
                let correction = steer.solve(&(force - mass * &guess));
                guess += &correction;
                // In angles: far below what is compared.
                if correction.amax() * reach * reach < 1e-13 {
                    break;
                }
                assert!(iteration < 200, "the stage did not converge");
            }
            speeds.push(&speed_base + &guess * reach);
            accelerations.push(guess.clone());
        }
        let last = STAGES[4];
        for ((share, speed), acceleration) in
            last.iter().chain(std::iter::once(&GAMMA)).zip(&speeds).zip(&accelerations)
        {
            self.angle += speed * (share * step);
            self.speed += acceleration * (share * step);
        }
    }

    /// Of the free end, along and above the clamp's axis.
    pub fn tip(&self) -> [f64; 2] {
        let sum =
            |of: fn(f64) -> f64| self.length.iter().zip(self.angle.iter()).map(|(l, a)| l * of(*a)).sum();
        [sum(f64::cos), sum(f64::sin)]
    }
}
