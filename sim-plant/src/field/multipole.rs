//! Field of the published multipole series, from derivatives of Legendre polynomials.
//!
//! Order `k` of the paper's eq. (4) is the gradient of `a_k (-1)^(k+1) k! r^-(k+1) P_k(c)`:
//!
//! | symbol | meaning |
//! |---|---|
//! | `p`, `r` | point from the expansion point, its distance |
//! | `x`, `u` | component of `p` along the coil axis `e`, squared distance from the axis |
//! | `c` | `x / r` |
//! | `P_k` | Legendre polynomial; `P'`, `P''` its derivatives |
//! | `a_k` | coefficient per ampere, T m^(k+2) / A |
//!
//! `B_k = a_k (-1)^k k! r^-(k+2) [ -(k+1) P_k p / r + P_k' (e - c p / r) ]`                     (F10)
//!
//! With `(k+1) P_k + c P_k' = P'_(k+1)` the sum over orders takes the form `B = q p + w e`,
//! `q = -sum A_k r^-(k+3) P'_(k+1)`, `w = sum A_k r^-(k+2) P'_k`, `A_k = a_k (-1)^k k!`. This `q` is that of
//! `axial`, so that `b = q x + w`, and with `dq = q_r dr + q_c dc`
//!
//! `t = q_r / r - c q_c / r^2`, `s = x t + q_c / r`.
//!
//! Recurrences: `k P'_(k+1) = (2k+1) c P'_k - (k+1) P'_(k-1)`, `P''_(k+1) = P''_(k-1) + (2k+1) P'_k`.

use magsteer_hal::config::ORDER_MAX;

use super::axial::Axial;

/// The series of one coil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multipole {
    /// `A_k` of the module's head.
    factors: [f64; ORDER_MAX],
    order: usize,
}

impl Multipole {
    /// The series with coefficients `a_k`, k = 1 first, T m^(k+2) / A; those beyond [`ORDER_MAX`] are left
    /// out.
    #[must_use]
    pub fn new(coefficients: &[f64]) -> Self {
        let mut factors = [0.0; ORDER_MAX];
        let mut signed_factorial = 1.0;
        for (index, (factor, coefficient)) in factors.iter_mut().zip(coefficients).enumerate() {
            signed_factorial *= -((index + 1) as f64);
            *factor = signed_factorial * coefficient;
        }
        Self { factors, order: coefficients.len().min(ORDER_MAX) }
    }

    /// Field of 1 A at `x` along the axis and squared distance `u` from it, m and m^2.
    #[must_use]
    pub fn at(&self, x: f64, u: f64) -> Axial {
        // Loops of known length are unrolled; BigMag has order 4.
        match self.order {
            0..=2 => self.sum::<2>(x, u),
            3 | 4 => self.sum::<4>(x, u),
            5 | 6 => self.sum::<6>(x, u),
            _ => self.sum::<ORDER_MAX>(x, u),
        }
    }

    fn sum<const N: usize>(&self, x: f64, u: f64) -> Axial {
        let reciprocal = 1.0 / (x * x + u).sqrt();
        let c = x * reciprocal;
        // P' and P'' of the orders k - 1 and k, from order 0 and 1.
        let (mut d_last, mut d_now) = (0.0, 1.0);
        let (mut dd_last, mut dd_now) = (0.0, 0.0);
        let (mut q, mut q_r, mut q_c, mut w) = (0.0, 0.0, 0.0, 0.0);
        let mut power = reciprocal * reciprocal;
        for (index, factor) in self.factors[..N].iter().enumerate() {
            let k = (index + 1) as f64;
            let ratio = const { reciprocals() }[index];
            let d_next = (2.0 + ratio) * c * d_now - (1.0 + ratio) * d_last;
            let dd_next = dd_last + (2.0 * k + 1.0) * d_now;
            power *= reciprocal; // r^-(k+2)
            let along_axis = factor * power;
            w += along_axis * d_now; // (F10)
            q -= along_axis * d_next; // (F10), but for 1 / r
            q_r += (k + 3.0) * along_axis * d_next;
            q_c -= along_axis * dd_next;
            (d_last, d_now) = (d_now, d_next);
            (dd_last, dd_now) = (dd_now, dd_next);
        }
        let square = reciprocal * reciprocal;
        let radial = q * reciprocal;
        let bend = (q_r - c * q_c) * square * reciprocal;
        Axial { along: radial * x + w, radial, slope: x * bend + q_c * square, bend }
    }
}

/// `1 / k`, k = 1 first.
const fn reciprocals() -> [f64; ORDER_MAX] {
    let mut values = [0.0; ORDER_MAX];
    let mut index = 0;
    while index < ORDER_MAX {
        values[index] = 1.0 / (index + 1) as f64;
        index += 1;
    }
    values
}
