//! A run in 64 bits: SHA-256 over every cycle's commands and true poses, its first 8 bytes.
//!
//! Taken over bits, not values: what differs in the last place of one number of one cycle has another digest.

use magsteer_hal::{HardwareDescription, PoseMessage};
use sha2::{Digest, Sha256};

use super::cycle_record::CycleRecord;

/// The digest of a run under way.
#[derive(Debug, Clone)]
pub struct RunDigest {
    hasher: Sha256,
    /// One cycle's bytes, so that the hasher is fed once a cycle.
    bytes: Vec<u8>,
    coils: usize,
    frames: usize,
}

impl RunDigest {
    /// The digest of nothing, for a rig.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        Self {
            hasher: Sha256::new(),
            bytes: Vec::with_capacity(1024),
            coils: description.coils.len(),
            frames: description.frames.len(),
        }
    }

    /// Takes one cycle: the order and what was admitted, in the entries in use, and the true pose of each
    /// magnet.
    pub fn take(&mut self, record: &CycleRecord, truth: &PoseMessage) {
        self.bytes.clear();
        self.bytes.extend(record.order.unwrap_or(u32::MAX).to_le_bytes());
        let currents = &record.admitted.current_a[..self.coils];
        let angles = &record.admitted.angle_rad[..self.frames];
        let magnets = &truth.magnets[..truth.magnet_count as usize];
        let poses =
            magnets.iter().flat_map(|magnet| magnet.position_m.iter().chain(&magnet.orientation_xyzw));
        for value in currents.iter().chain(angles).chain(poses) {
            self.bytes.extend(value.to_bits().to_le_bytes());
        }
        self.hasher.update(&self.bytes);
    }

    /// Sixteen hexadecimal digits.
    #[must_use]
    pub fn finish(self) -> String {
        self.hasher.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }
}
