//! Why poses or feedback were refused, as three counts of a record, and back in words.

use magsteer_hal::Absent;
use magsteer_hal::record::AbsenceMessage;

/// A refusal as code and two details, expected and actual where it has both.
pub(super) fn absence(absent: Option<Absent>) -> (u64, u64, u64) {
    let numbers = AbsenceMessage::new(absent);
    (numbers.code.into(), numbers.expected, numbers.actual)
}

/// What a person reads for a refusal of poses or feedback, from its three columns; `None` for 0.
#[must_use]
pub fn refusal_text(code: u64, expected: u64, actual: u64) -> Option<String> {
    Some(match code {
        0 => return None,
        1 => "nothing received yet".to_owned(),
        2 => format!("layout version {actual} received, {expected} expected"),
        3 => format!("{actual} entries received, {expected} expected"),
        4 => format!("a value of entry {actual} is not usable"),
        5 => format!("sequence went from {expected} to {actual}"),
        6 => format!("stamp lies {actual} ns in the future"),
        7 => format!("magnet {actual} was not seen"),
        8 => format!("validity ran out {actual} ns ago"),
        9 => format!("epoch {actual} published before the last accepted message of epoch {expected}"),
        10 => "the transport failed to deliver".to_owned(),
        11 => format!("description {actual:016x} at the driver, {expected:016x} here"),
        other => format!("a reason that this version does not know ({other})"),
    })
}
