//! Legendre polynomials, the basis of both centrelines: orthogonal, so that the normal equations stay well
//! conditioned.

/// Fills `values` with `P_0(x), P_1(x), ...` and `slopes` with their derivatives, by Bonnet's recurrence.
pub(super) fn legendre(x: f64, values: &mut [f64], slopes: &mut [f64]) {
    for index in 0..values.len() {
        let n = index as f64;
        (values[index], slopes[index]) = match index {
            0 => (1.0, 0.0),
            1 => (x, 1.0),
            _ => {
                let (one, two) = (values[index - 1], values[index - 2]);
                let value = ((2.0 * n - 1.0) * x * one - (n - 1.0) * two) / n;
                (value, slopes[index - 2] + (2.0 * n - 1.0) * one)
            }
        };
    }
}
