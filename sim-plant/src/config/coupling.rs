//! `[[plant.coupling]]`.

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::actuation::{CouplingPair, Couplings, EIGENVALUE_MIN};

/// One of `[[plant.coupling]]`: two coils that share flux. It is taken as the same at every angle of the
/// frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingConfig {
    /// Names of two different coils; no two entries name the same two.
    pub coils: [String; 2],
    /// Mutual inductance over the geometric mean of both inductances, -1 to 1, positive where currents that
    /// are positive by the description support each other's flux. All together must leave the matrix of
    /// coefficients with its eigenvalues above 0.7.
    pub coefficient: f64,
}

/// The matrix of all couplings; `None` when one was refused.
pub(super) fn couplings(
    pairs: &[CouplingConfig],
    description: &HardwareDescription,
    checks: &mut Checks,
) -> Option<Couplings> {
    let mut found = Checks::new();
    let mut known: Vec<CouplingPair> = Vec::with_capacity(pairs.len());
    for (index, pair) in pairs.iter().enumerate() {
        let key = format!("plant.coupling[{index}]");
        found.within(format!("{key}.coefficient"), pair.coefficient, -1.0, 1.0);
        let Some(coils) = pair.indices(description) else {
            let value = pair.coils.join(", ");
            found.require(false, format!("{key}.coils"), value, "the names of two different coils");
            continue;
        };
        let is_new = !known.iter().any(|known| known.coils == coils);
        let value = pair.coils.join(", ");
        found.require(is_new, format!("{key}.coils"), value, "two coils that no other entry names");
        known.push(CouplingPair { coils, coefficient: pair.coefficient });
    }
    let couplings = found.is_clean().then(|| Couplings::new(description.coils.len(), &known));
    if let Some(Err(index)) = couplings {
        let pair = &pairs[index];
        let expected = format!(
            "weaker: {} and {}, with the entries before, bring the least eigenvalue of the matrix of coefficients to {} or below",
            pair.coils[0], pair.coils[1], EIGENVALUE_MIN
        );
        found.require(false, format!("plant.coupling[{index}].coefficient"), pair.coefficient, expected);
    }
    checks.extend(found.into_result(()).err().unwrap_or_default());
    couplings?.ok()
}

impl CouplingConfig {
    /// Both coils' places in the description, the lesser first.
    fn indices(&self, description: &HardwareDescription) -> Option<[usize; 2]> {
        let index = |name: &String| description.coils.iter().position(|coil| coil.name == *name);
        let (one, other) = (index(&self.coils[0])?, index(&self.coils[1])?);
        (one != other).then_some([one.min(other), one.max(other)])
    }
}
