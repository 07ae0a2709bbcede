//! One source of a multipole electromagnet model. Symbols and equations as in the page of `mpem`.

use nalgebra::Vector3;

/// A point about which a potential is expanded.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Name in its coil.
    pub name: String,
    /// Line of the file at which it stands, 1 first; 0 when it comes from no file.
    pub line: usize,
    /// Position p, m, world.
    pub position: Vector3<f64>,
    /// Unit direction z, world.
    pub direction: Vector3<f64>,
    /// Rising coefficients `A_n`, n = 1 first, T m^(1-n) / A.
    pub rising: Vec<f64>,
    /// Falling coefficients `B_n`, n = 1 first, T m^(n+2) / A.
    pub falling: Vec<f64>,
}

impl Source {
    /// The source of our series: `coefficients` are `a_n`, n = 1 first, T m^(n+2) / A, about `position`
    /// along the unit vector `direction`.
    #[must_use]
    pub fn of_series(
        name: &str,
        position: Vector3<f64>,
        direction: Vector3<f64>,
        coefficients: &[f64],
    ) -> Self {
        let falling = coefficients.iter().zip(factors()).map(|(a, factor)| factor * a).collect(); // (M3)
        Self { name: name.to_owned(), line: 0, position, direction, rising: Vec::new(), falling }
    }

    /// The falling terms as our series about `position` along `direction`: `a_n`, n = 1 first.
    #[must_use]
    pub fn series(&self) -> Vec<f64> {
        self.falling.iter().zip(factors()).map(|(b, factor)| b / factor).collect() // (M3)
    }

    /// Field at `point` (m, world) for 1 A, T/A. Not finite at the source itself where it has falling terms.
    ///
    /// The gradient of (M1) along `n = d / r` and across, where `grad c = (z - c n) / r`:
    ///
    /// - falling: `sum_n B_n r^-(n+2) ((n+1) P_n n - P_n' (z - c n))`
    /// - rising: `-sum_n A_n r^(n-1) (n P_n n + P_n' (z - c n))`
    #[must_use]
    pub fn field(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let d = point - self.position;
        let r = d.norm();
        // At the source itself a rising term of order 1 is `-A_1 z`, whatever the direction.
        let along = if r > 0.0 { d / r } else { self.direction };
        let c = along.dot(&self.direction);
        let across = self.direction - along * c;
        let mut field = Vector3::zeros();
        let (mut before, mut polynomial) = (1.0, c);
        let (mut slope_before, mut slope) = (0.0, 1.0);
        let (mut rising, mut falling) = (1.0, 1.0 / (r * r * r));
        for index in 0..self.rising.len().max(self.falling.len()) {
            let n = (index + 1) as f64;
            if let Some(b) = self.falling.get(index) {
                field += (along * ((n + 1.0) * polynomial) - across * slope) * (b * falling); // (M2)
            }
            if let Some(a) = self.rising.get(index) {
                field -= (along * (n * polynomial) + across * slope) * (a * rising); // (M2)
            }
            (before, polynomial) = (polynomial, ((2.0 * n + 1.0) * c * polynomial - n * before) / (n + 1.0));
            (slope_before, slope) = (slope, slope_before + (2.0 * n + 1.0) * before);
            (rising, falling) = (rising * r, falling / r);
        }
        field
    }

    /// The same source with its direction turned round.
    #[must_use]
    pub fn turned_round(&self) -> Self {
        let turned = |terms: &[f64]| {
            // (M4)
            terms.iter().enumerate().map(|(index, b)| if index % 2 == 0 { -b } else { *b }).collect()
        };
        Self {
            direction: -self.direction,
            rising: turned(&self.rising),
            falling: turned(&self.falling),
            ..self.clone()
        }
    }

    /// The same source without the highest coefficients that are zero.
    #[must_use]
    pub(super) fn trimmed(&self) -> Self {
        let trimmed = |terms: &[f64]| {
            let count = terms.iter().rposition(|term| *term != 0.0).map_or(0, |last| last + 1);
            terms[..count].to_vec()
        };
        Self { rising: trimmed(&self.rising), falling: trimmed(&self.falling), ..self.clone() }
    }
}

/// `(-1)^(n+1) n!` for n = 1, 2, ...                                                                  (M3)
fn factors() -> impl Iterator<Item = f64> {
    (1..).scan(-1.0, |factor, n: u32| {
        *factor *= -f64::from(n);
        Some(*factor)
    })
}
