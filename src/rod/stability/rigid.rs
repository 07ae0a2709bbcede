//! A magnet in the second variation: no unknowns of its own, only stiffness.

use crate::magnetics::FieldGradient;
use crate::math::Triple;
use crate::rod::magnet::Magnet;
use crate::rod::pass::MagnetPass;
use crate::rod::state::State;

use super::stiffness::{Pose, Square, Stiffness, pulled_back, skew, sway};

/// A magnet between its ends.
#[derive(Debug, Clone)]
pub(super) struct Rigid {
    /// Index of the part.
    pub part: usize,
    /// Index of the magnet.
    pub magnet: usize,
    /// From its start to its end, m.
    arm: Triple,
    /// Its own stiffness, by displacements of its start.
    own: Stiffness,
}

impl Rigid {
    pub(super) fn new(part: usize, magnet: usize) -> Self {
        Self { part, magnet, arm: Triple::default(), own: Stiffness::default() }
    }

    /// Takes over where the magnet is and what acts on it (z4); `ends` are the states at its ends.
    pub(super) fn update(&mut self, magnet: &Magnet, at: &MagnetPass, ends: [&State; 2]) {
        let tangent = at.frame.tangent;
        let dipole = at.frame.to_world(magnet.moment_body);
        let field = Triple::from(at.field);
        let half = 0.5 * magnet.length;
        let gradient = rows(&at.gradient);
        let stiffness = rows(&at.second_gradient.contract(&dipole.into()));
        let turned = skew(dipole);
        let by_field = sway(dipole, field);
        let by_forces = sway((ends[0].force + ends[1].force).scaled(half), tangent);
        let mut own = Stiffness::default();
        for i in 0..3 {
            let mixed: [f64; 3] =
                core::array::from_fn(|j| (0..3).map(|k| gradient[i][k] * turned[k][j]).sum());
            own[i].position = Triple::from(stiffness[i].map(|entry| -entry));
            own[i].rotation = Triple::from(mixed);
            let turning: [f64; 3] = core::array::from_fn(|j| by_field[i][j] + by_forces[i][j]);
            own[3 + i].rotation = Triple::from(turning);
        }
        // The other half of the mixed terms.
        let [x, y, z] = [own[0].rotation, own[1].rotation, own[2].rotation];
        own[3].position = Triple::new(x.x, y.x, z.x);
        own[4].position = Triple::new(x.y, y.y, z.y);
        own[5].position = Triple::new(x.z, y.z, z.z);
        self.own = pulled_back(&own, tangent.scaled(half)); // (z4)
        self.arm = tangent.scaled(magnet.length);
    }

    /// The stiffness at its start, from that at its end.
    pub(super) fn condense(&self, beyond: &Stiffness) -> Stiffness {
        let mut stiffness = pulled_back(beyond, self.arm);
        for (row, own) in stiffness.iter_mut().zip(&self.own) {
            row.position = row.position + own.position;
            row.rotation = row.rotation + own.rotation;
        }
        stiffness
    }

    pub(super) fn pull(&self, wrench: Pose) -> Pose {
        wrench.pulled_back(self.arm)
    }

    pub(super) fn push(&self, start: Pose) -> Pose {
        start.pushed_on(self.arm)
    }
}

fn rows(gradient: &FieldGradient) -> Square {
    let FieldGradient { xx, xy, xz, yy, yz } = *gradient;
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, -(xx + yy)]]
}
