//! The pose sensor that is mounted, of whichever kind.

use magsteer_hal::description::ManipulatorDescription;
use magsteer_hal::shape::{CurvatureError, SettingsError};
use magsteer_hal::{PoseMessage, Stamp};

use super::exposures::{Exposures, Timing};
use super::fibre::{Fibre, FibreCharacter};
use super::stereo::{Stereo, StereoCharacter};
use super::tracker::{Tracker, TrackerCharacter};
use crate::rod::Rod;

/// What a sensor is like.
#[derive(Debug, Clone, PartialEq)]
pub enum SensorSettings {
    /// Sees the magnets' poses directly.
    Tracker(Timing, TrackerCharacter),
    /// Two or more cameras that see points on the rod's surface.
    Stereo(Timing, StereoCharacter),
    /// Feels curvature along the rod.
    Fibre(Timing, FibreCharacter),
}

/// Why a sensor cannot be mounted.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SensorError {
    /// The reconstruction from points cannot be set up for this rod.
    #[error(transparent)]
    Cloud(#[from] SettingsError),
    /// The stations of the fibre do not fit this rod.
    #[error(transparent)]
    Curvature(#[from] CurvatureError),
}

#[derive(Debug, Clone)]
enum Kind {
    Tracker(Box<Tracker>),
    Stereo(Box<Stereo>),
    Fibre(Box<Fibre>),
}

/// A sensor at work.
#[derive(Debug, Clone)]
pub struct PoseSensor {
    exposures: Exposures,
    kind: Kind,
}

impl PoseSensor {
    /// A sensor whose first exposure is at `start`. It knows the manipulator as described, whatever the true
    /// one is like.
    ///
    /// # Errors
    /// When the shape of this manipulator cannot be reconstructed from what the sensor sees.
    pub fn new(
        settings: &SensorSettings,
        manipulator: &ManipulatorDescription,
        seed: u64,
        start: Stamp,
    ) -> Result<Self, SensorError> {
        let (timing, kind) = match settings {
            SensorSettings::Tracker(timing, character) => {
                (timing, Kind::Tracker(Box::new(Tracker::new(*character, seed))))
            }
            SensorSettings::Stereo(timing, character) => {
                (timing, Kind::Stereo(Box::new(Stereo::new(character, manipulator, seed)?)))
            }
            SensorSettings::Fibre(timing, character) => {
                (timing, Kind::Fibre(Box::new(Fibre::new(*character, manipulator, seed)?)))
            }
        };
        Ok(Self { exposures: Exposures::new(*timing, start), kind })
    }

    /// Starts anew at `start`, the next exposure one period after it: exposures under way are lost.
    pub fn restart(&mut self, start: Stamp) {
        self.exposures.restart(start);
    }

    /// True when an exposure falls on or before `now`; [`Self::expose`] then takes it.
    #[must_use]
    pub fn wants_exposure(&self, now: Stamp) -> bool {
        self.exposures.wants(now)
    }

    /// Takes one exposure of the true rod at `now`. Of one that is lost the camera reconstructs nothing.
    pub fn expose(&mut self, rod: &Rod, now: Stamp) {
        let dropout = self.exposures.dropout_probability();
        let message = match &mut self.kind {
            Kind::Tracker(tracker) => tracker.see(rod, dropout),
            Kind::Stereo(stereo) => stereo.see(rod, dropout),
            Kind::Fibre(fibre) => fibre.feel(rod, dropout),
        };
        self.exposures.expose(message, now);
    }

    /// The oldest message that is due at `now`, if any; its header has only the source stamp.
    pub fn take_due(&mut self, now: Stamp) -> Option<PoseMessage> {
        self.exposures.take_due(now)
    }
}
