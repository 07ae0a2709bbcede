//! Contact of the rod with a wall, by a smooth penalty.
//!
//! | symbol | meaning |
//! |---|---|
//! | `y` | a point of contact on the rod's axis: each node, both ends of each magnet, the tip |
//! | `r`, `l` | the rod's radius there, and the length that the point stands for |
//! | `g(y)`, `n` | distance from the wall, and its gradient ([`super::wall`]) |
//! | `p` | depth, `r - g(y)`; contact where it is positive |
//! | `k`, `w` | the wall's stiffness, N/m^2 (force a length and a depth), and the depth over which it sets in |
//! | `c`, `f`, `s` | damping, s/m; friction coefficient; speed of creep, m/s |
//!
//! `U(p) = k l p^3 / (6 w)` up to `p = w`, then `k l ((p - w/2)^2 / 2 + w^2 / 24)`: the force grows with the square of the depth at
//! first, so that its slope is continuous, and then with the depth                               (vii)
//!
//! Over a step, indices as in [`super::dynamics`], and with `z = d + R T x a` the displacement of a point at `a` from its body's centre of mass:
//!
//! ```text
//! N = (U(p1) - U(p0)) / (p1 - p0) max(0, 1 + c (p1 - p0) / t)           (viii)
//! n' = n(half) + z (p0 - p1 - n(half) . z) / z^2                        (ix)
//! F = N (n' - f u / sqrt(u^2 + s^2)),  u = (z - n' (n' . z)) / t        (x)
//! ```
//!
//! With (ix) the work `F . z` is the change of `U`, with its sign, less what damping and friction take, up to rounding: contact
//! feeds no energy to the rod. Damping and friction only take: `c` makes a wall push harder against what comes than after what
//! goes, and never pull (Hunt and Crossley, J. Applied Mechanics 42, 1975).
//!
//! Friction is Coulomb's above the speed `s` and viscous below it: a rod that sticks in truth creeps here, with less than `s`.
//! It acts on the axis, so that it does not roll the rod. Rest ([`Rod::settle`]) is that without friction.

use nalgebra::{Matrix3, Matrix6, Vector3};

use super::balance::stack;
use super::chain::ContactPoint;
use super::dynamics::Rod;
use super::element::blocks;
use super::motion::Motion;
use super::rotation::{matrix, skew};
use super::wall::Wall;

/// How a wall gives way. SI units; symbols as in the module's head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// `k`, N/m^2: force a length of rod and a depth.
    pub stiffness: f64,
    /// `w`, m.
    pub rounding: f64,
    /// `c`, s/m.
    pub damping: f64,
    /// `f`.
    pub friction: f64,
    /// `s`, m/s.
    pub creep_speed: f64,
}

/// A wall and how it gives way.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Where it is.
    pub wall: Wall,
    /// How it gives way.
    pub surface: Surface,
}

/// What the wall does to the rod.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Greatest depth of any point at present, m; zero when nothing touches.
    pub depth_max: f64,
    /// Sum of the wall's forces on the rod in the last step, N, world.
    pub force: Vector3<f64>,
}

/// Share of a body's inertial stiffness by which a contact may have changed since the tangent was made.
const STIFFNESS_CHANGE: f64 = 0.02;

/// A wall about a rod, and each point's state.
#[derive(Debug, Clone)]
pub(super) struct Contacts {
    contact: Contact,
    points: Vec<PointState>,
    /// Rest is sought without friction.
    friction_is_off: bool,
}

#[derive(Debug, Clone, Copy)]
struct PointState {
    /// Depth at the step's beginning.
    depth: f64,
    /// Of the running iteration.
    load: Load,
    /// Of the iteration that made the tangent.
    load_at_tangent: Load,
}

/// What a point feels, and how that follows its displacement.
#[derive(Debug, Clone, Copy)]
struct Load {
    force: Vector3<f64>,
    /// `F . z` without the change of `U`: damping, then friction; both are losses where negative.
    damping_work: f64,
    friction_work: f64,
    /// `-dF/dz`.
    stiffness: Matrix3<f64>,
}

impl Load {
    fn none() -> Self {
        let zero = Vector3::zeros();
        Self { force: zero, damping_work: 0.0, friction_work: 0.0, stiffness: Matrix3::zeros() }
    }
}

/// A point's displacement over a step, and its depths and normal.
struct Passage {
    displacement: Vector3<f64>,
    depths: [f64; 2],
    normal: Vector3<f64>,
}

impl Surface {
    /// `U`, J, at a depth of a point that stands for `length`.
    fn energy(&self, depth: f64, length: f64) -> f64 {
        let (k, w) = (self.stiffness * length, self.rounding);
        if depth <= 0.0 {
            0.0
        } else if depth < w {
            k * depth.powi(3) / (6.0 * w) // (vii)
        } else {
            k * (0.5 * (depth - 0.5 * w).powi(2) + w * w / 24.0)
        }
    }

    /// `dU/dp`.
    fn pressure(&self, depth: f64, length: f64) -> f64 {
        let (k, w) = (self.stiffness * length, self.rounding);
        if depth <= 0.0 {
            0.0
        } else if depth < w {
            k * depth * depth / (2.0 * w)
        } else {
            k * (depth - 0.5 * w)
        }
    }

    /// `(U(p1) - U(p0)) / (p1 - p0)` and its derivative by `p1`.
    fn mean_pressure(&self, [before, after]: [f64; 2], length: f64) -> (f64, f64) {
        let change = after - before;
        if change.abs() < 1e-6 * self.rounding {
            // Differences of the energy would lose their digits; the midpoint is off by the square of the change.
            let middle = 0.5 * (before + after);
            let probe = 1e-3 * self.rounding;
            let slope = (self.pressure(middle + probe, length) - self.pressure(middle - probe, length))
                / (2.0 * probe);
            return (self.pressure(middle, length), 0.5 * slope);
        }
        let mean = (self.energy(after, length) - self.energy(before, length)) / change;
        (mean, (self.pressure(after, length) - mean) / change)
    }

    /// (viii) to (x) for a point that stands for `length`.
    fn load(&self, passage: &Passage, length: f64, friction: f64, step: f64) -> Load {
        let Passage { displacement, depths, normal } = passage;
        let (mean, slope) = self.mean_pressure(*depths, length);
        let sinking = depths[1] - depths[0];
        let damping = (1.0 + self.damping * sinking / step).max(0.0);
        let push = mean * damping; // (viii)
        let square = displacement.norm_squared();
        let missing = -sinking - normal.dot(displacement);
        let normal = if square > 0.0 { normal + displacement * (missing / square) } else { *normal }; // (ix)
        let slip = (displacement - normal * normal.dot(displacement)) / step;
        let speed = (slip.norm_squared() + self.creep_speed.powi(2)).sqrt();
        let drag = slip * (-friction * push / speed);
        let steepness = if damping > 0.0 { slope * damping + mean * self.damping / step } else { 0.0 };
        let across = Matrix3::identity() - normal * normal.transpose();
        let sliding = across - slip * slip.transpose() / (speed * speed);
        Load {
            force: normal * push + drag, // (x)
            damping_work: (mean - push) * sinking,
            friction_work: drag.dot(displacement),
            stiffness: normal * normal.transpose() * steepness + sliding * (friction * push / (speed * step)),
        }
    }
}

impl Contacts {
    fn friction(&self) -> f64 {
        if self.friction_is_off { 0.0 } else { self.contact.surface.friction }
    }

    fn depth(&self, point: &ContactPoint, motion: &Motion) -> f64 {
        point.radius - self.contact.wall.clearance(&motion.pose.along(point.offset)).gap
    }
}

impl Rod {
    /// Puts a wall about the rod, or takes it away; there is none at first.
    pub fn set_contact(&mut self, contact: Option<Contact>) {
        let state = PointState { depth: 0.0, load: Load::none(), load_at_tangent: Load::none() };
        self.contacts = contact.map(|contact| Contacts {
            contact,
            points: vec![state; self.chain.contact_points.len()],
            friction_is_off: false,
        });
        self.tangent_is_kept = false;
        self.refresh_depths();
    }

    /// What the wall does to the rod; `None` without a wall.
    #[must_use]
    pub fn touch(&self) -> Option<Touch> {
        let contacts = self.contacts.as_ref()?;
        let depth_max = contacts.points.iter().map(|state| state.depth).fold(0.0, f64::max);
        let force = contacts.points.iter().map(|state| state.load.force).sum();
        Some(Touch { depth_max, force })
    }

    pub(super) fn set_friction_off(&mut self, is_off: bool) {
        if let Some(contacts) = &mut self.contacts {
            contacts.friction_is_off = is_off;
        }
    }

    /// Energy stored in the wall at present, J.
    pub(super) fn energy_of_contact(&self) -> f64 {
        let Some(contacts) = &self.contacts else { return 0.0 };
        let points = self.chain.contact_points.iter().zip(&contacts.points);
        points.map(|(point, state)| contacts.contact.surface.energy(state.depth, point.length)).sum()
    }

    /// Depths at the step's beginning.
    pub(super) fn refresh_depths(&mut self) {
        let Some(mut contacts) = self.contacts.take() else { return };
        for (index, point) in self.chain.contact_points.iter().enumerate() {
            contacts.points[index].depth = contacts.depth(point, &self.motions[point.body]);
        }
        self.contacts = Some(contacts);
    }

    /// Forces of the wall about the bodies' centres of mass, added to the residual; drops the tangent when it does not know them.
    pub(super) fn add_contacts(&mut self) {
        let Some(contacts) = &mut self.contacts else { return };
        let friction = contacts.friction();
        let step = self.stepping.step;
        let Contact { wall, surface } = &contacts.contact;
        for (point, state) in self.chain.contact_points.iter().zip(&mut contacts.points) {
            let motion = &self.motions[point.body];
            let end = motion.end.along(point.offset);
            let depth = point.radius - wall.clearance(&end).gap;
            if state.depth <= 0.0 && depth <= 0.0 {
                state.load = Load::none();
            } else {
                let half = motion.half.along(point.offset);
                let arm = half - motion.half.position;
                let displacement = motion.shift + (motion.half.rotation * motion.turn).cross(&arm);
                let passage = Passage {
                    displacement,
                    depths: [state.depth, depth],
                    normal: wall.clearance(&half).normal,
                };
                state.load = surface.load(&passage, point.length, friction, step);
                self.residual[point.body] += stack(&state.load.force, &arm.cross(&state.load.force));
            }
            let inertial = 2.0 * self.chain.bodies[point.body].mass / (step * step);
            let change = (state.load.stiffness - state.load_at_tangent.stiffness).amax();
            self.tangent_is_kept &= change <= STIFFNESS_CHANGE * inertial;
        }
    }

    /// The wall's share of the tangent, as of the last residual.
    pub(super) fn add_contacts_to_tangent(&mut self) {
        let Some(contacts) = &mut self.contacts else { return };
        for (point, state) in self.chain.contact_points.iter().zip(&mut contacts.points) {
            state.load_at_tangent = state.load;
            if state.load.force == Vector3::zeros() {
                continue;
            }
            let rotation = matrix(&self.motions[point.body].half.rotation);
            let stiffness = rotation.tr_mul(&(state.load.stiffness * rotation));
            let arm = skew(&Vector3::new(0.0, 0.0, point.offset));
            let turned = stiffness * arm;
            let block: Matrix6<f64> = blocks(&stiffness, &-turned, &(arm * stiffness), &-(arm * turned));
            self.tangent.add_diagonal(point.body, &block);
        }
    }

    /// True when a wall pushes in the running iteration.
    pub(super) fn is_touching(&self) -> bool {
        let touches = |state: &PointState| state.load.force != Vector3::zeros();
        self.contacts.as_ref().is_some_and(|contacts| contacts.points.iter().any(touches))
    }

    /// Losses of the step that was just solved, to damping and to friction, J.
    pub(super) fn losses_of_contact(&self) -> (f64, f64) {
        let Some(contacts) = &self.contacts else { return (0.0, 0.0) };
        contacts.points.iter().fold((0.0, 0.0), |(damping, friction), state| {
            (damping - state.load.damping_work, friction - state.load.friction_work)
        })
    }
}
