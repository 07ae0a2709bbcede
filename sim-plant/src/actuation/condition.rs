//! What can be wrong with a coil or a frame, as states that may be set at any time.

/// Largest share of a coil's turns that may be shorted: beyond it little is left of a coil.
pub const SHORTED_MAX: f64 = 0.9;

/// The state of a coil and its amplifier.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum CoilCondition {
    /// As described.
    #[default]
    Healthy,
    /// The circuit is broken: the current is gone at once and none flows, whatever the amplifier does.
    Open,
    /// Some turns are shorted: field per ampere and resistance fall by the share, inductance with its square.
    ShortedTurns {
        /// Of all turns, 0 to [`SHORTED_MAX`].
        share: f64,
    },
    /// The amplifier goes on with what it did when it got stuck, whatever it is asked. Only a cut of the
    /// bridge ends it; put to work again, it does the same again.
    StuckAmplifier {
        /// What it holds.
        holds: Held,
    },
}

/// What a stuck amplifier holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// Its voltage: the current goes on to where that voltage leads.
    Voltage,
    /// Its current.
    Current,
}

/// The state of a frame and its motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrameCondition {
    /// As described.
    #[default]
    Healthy,
    /// The motor stands, whatever it is asked.
    Stalled,
}

impl CoilCondition {
    /// False for a share outside its range.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        match self {
            Self::ShortedTurns { share } => (0.0..=SHORTED_MAX).contains(share),
            Self::Healthy | Self::Open | Self::StuckAmplifier { .. } => true,
        }
    }

    /// Share of the turns that work.
    #[must_use]
    pub fn turns(&self) -> f64 {
        match self {
            Self::ShortedTurns { share } => 1.0 - share,
            Self::Healthy | Self::Open | Self::StuckAmplifier { .. } => 1.0,
        }
    }
}
