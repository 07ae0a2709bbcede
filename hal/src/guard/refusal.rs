//! Why a driver does not obey a command, and how often it did not.

/// Why a command was refused; nothing changed in the driver but the counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Another layout version.
    #[error("layout version {actual}")]
    Schema {
        /// Version received.
        actual: u32,
    },
    /// Not as many coils or frames as the rig has.
    #[error("{actual} {what}, {expected} expected")]
    Count {
        /// `coils` or `frames`.
        what: &'static str,
        /// Count of the description.
        expected: u32,
        /// Count received.
        actual: u32,
    },
    /// A code that is none of [`crate::message::order`].
    #[error("unknown order {actual}")]
    Order {
        /// Code received.
        actual: u32,
    },
    /// A current or angle that is not finite.
    #[error("{what} {index} is not finite")]
    NotFinite {
        /// `current` or `angle`.
        what: &'static str,
        /// Which coil or frame.
        index: u32,
    },
    /// Published in the future of this machine's clock.
    #[error("published {ahead_ns} ns in the future")]
    FutureStamp {
        /// By how much.
        ahead_ns: u64,
    },
    /// Its validity ran out before it arrived, or it has none.
    #[error("validity ran out {late_ns} ns ago")]
    Expired {
        /// How long ago.
        late_ns: u64,
    },
    /// The sequence did not rise within its epoch.
    #[error("sequence went from {last} to {actual}")]
    Sequence {
        /// Last accepted sequence.
        last: u64,
        /// Sequence received.
        actual: u64,
    },
    /// Nobody holds authority: claim it first.
    #[error("no authority is held: claim it first")]
    NoAuthority,
    /// Authority is held by another epoch or token.
    #[error("authority is held by epoch {holder}")]
    Held {
        /// Epoch of the holder.
        holder: u64,
    },
    /// The former holder's currents are still ramping to zero.
    #[error("currents are still ramping to zero")]
    NotAtZero,
    /// A claim with an epoch that does not rise over all granted before.
    #[error("epoch {actual} does not rise over {last}")]
    Epoch {
        /// Highest epoch granted.
        last: u64,
        /// Epoch received.
        actual: u64,
    },
    /// A claim that asks for current.
    #[error("claim asks for current in coil {coil}")]
    ClaimNotZero {
        /// Which coil.
        coil: u32,
    },
}

/// Number of reasons in [`Refusal`].
const REASONS: usize = 12;

/// Refused commands by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RefusalCounts {
    counts: [u64; REASONS],
}

impl RefusalCounts {
    /// Refusals for the reason of `example`, whatever its details.
    #[must_use]
    pub const fn of(&self, example: &Refusal) -> u64 {
        self.counts[reason(example)]
    }

    /// Refusals for any reason.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    pub(super) const fn add(&mut self, refusal: &Refusal) {
        self.counts[reason(refusal)] += 1;
    }
}

const fn reason(refusal: &Refusal) -> usize {
    match refusal {
        Refusal::Schema { .. } => 0,
        Refusal::Count { .. } => 1,
        Refusal::Order { .. } => 2,
        Refusal::NotFinite { .. } => 3,
        Refusal::FutureStamp { .. } => 4,
        Refusal::Expired { .. } => 5,
        Refusal::Sequence { .. } => 6,
        Refusal::NoAuthority => 7,
        Refusal::Held { .. } => 8,
        Refusal::NotAtZero => 9,
        Refusal::Epoch { .. } => 10,
        Refusal::ClaimNotZero { .. } => 11,
    }
}
