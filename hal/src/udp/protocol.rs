//! The three datagrams, little-endian, as bytes.

use crate::message::{Actuation, COILS_MAX, MAGNETS_MAX, MagnetPose, POSE_PARAMETERS_MAX};

/// First in a request: "MSR1".
const REQUEST: [u8; 4] = *b"MSR1";
/// First in an answer: "MSA1".
const ANSWER: [u8; 4] = *b"MSA1";
/// First in poses: "MSP1".
const POSES: [u8; 4] = *b"MSP1";

/// Bytes before the values of a request or an answer.
const HEAD: usize = 24;
/// Bytes before the magnets of poses.
const POSES_HEAD: usize = 24;
/// Bytes of one magnet.
const MAGNET: usize = 64;

/// No datagram is longer.
pub const DATAGRAM_MAX: usize = POSES_HEAD + MAGNET * MAGNETS_MAX;

/// What a request asks for; the codes of [`Request::kind`].
pub mod kind {
    /// Follow the set points.
    pub const FOLLOW: u32 = 1;
    /// Take the current away at once.
    pub const CUT: u32 = 2;
}

/// State of a device; the codes of [`Answer::state`].
pub mod device_state {
    /// Follows set points.
    pub const FOLLOWING: u32 = 0;
    /// No request came in time: ramped or ramping to zero by itself.
    pub const EXPIRED: u32 = 1;
    /// Cut.
    pub const CUT: u32 = 2;
}

/// A datagram that is not what it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a datagram of {length} bytes is no {expected} of this rig")]
pub struct MalformedDatagram {
    /// What was awaited.
    pub expected: &'static str,
    /// Bytes received.
    pub length: usize,
}

/// From driver to device, each cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Rises with every request, over restarts too.
    pub sequence: u64,
    /// One of [`kind`].
    pub kind: u32,
    /// Without a later request within so long the device goes to zero by itself.
    pub validity_us: u32,
    /// Set points.
    pub actuation: Actuation,
}

/// From device to driver, one for each request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// That of the request.
    pub sequence: u64,
    /// One of [`device_state`].
    pub state: u32,
    /// The device's own fault code, 0 for none.
    pub fault: u32,
    /// Measured values.
    pub actuation: Actuation,
}

/// From device to driver, whenever the tracker saw something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Poses {
    /// Rises with every such datagram.
    pub sequence: u64,
    /// From exposure to sending.
    pub age_us: u32,
    /// Entries of `magnets` in use.
    pub magnet_count: u32,
    /// Base to tip.
    pub magnets: [MagnetPose; MAGNETS_MAX],
}

impl Request {
    /// Bytes of the datagram for a rig of so many coils and frames.
    #[must_use]
    pub fn encode(&self, coils: usize, frames: usize) -> Vec<u8> {
        let words = (self.kind, self.validity_us);
        values(REQUEST, self.sequence, words, &self.actuation, coils, frames)
    }

    /// Reads a datagram.
    ///
    /// # Errors
    /// When it is none for a rig of so many coils and frames.
    pub fn decode(bytes: &[u8], coils: usize, frames: usize) -> Result<Self, MalformedDatagram> {
        let malformed = MalformedDatagram { expected: "request", length: bytes.len() };
        let read = read_values(REQUEST, bytes, coils, frames).ok_or(malformed)?;
        let (sequence, (kind, validity_us), actuation) = read;
        Ok(Self { sequence, kind, validity_us, actuation })
    }
}

impl Answer {
    /// Bytes of the datagram for a rig of so many coils and frames.
    #[must_use]
    pub fn encode(&self, coils: usize, frames: usize) -> Vec<u8> {
        values(ANSWER, self.sequence, (self.state, self.fault), &self.actuation, coils, frames)
    }

    /// Reads a datagram.
    ///
    /// # Errors
    /// When it is none for a rig of so many coils and frames.
    pub fn decode(bytes: &[u8], coils: usize, frames: usize) -> Result<Self, MalformedDatagram> {
        let malformed = MalformedDatagram { expected: "answer", length: bytes.len() };
        let (sequence, (state, fault), actuation) =
            read_values(ANSWER, bytes, coils, frames).ok_or(malformed)?;
        Ok(Self { sequence, state, fault, actuation })
    }
}

impl Poses {
    /// Bytes of the datagram.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(DATAGRAM_MAX);
        bytes.extend(POSES);
        bytes.extend(self.age_us.to_le_bytes());
        bytes.extend(self.sequence.to_le_bytes());
        bytes.extend(self.magnet_count.to_le_bytes());
        bytes.extend([0; 4]);
        for magnet in self.magnets.iter().take(self.magnet_count as usize) {
            bytes.extend(
                magnet
                    .position_m
                    .iter()
                    .chain(&magnet.orientation_xyzw)
                    .flat_map(|value| value.to_le_bytes()),
            );
            bytes.extend(magnet.valid.to_le_bytes());
            bytes.extend([0; 4]);
        }
        bytes
    }

    /// Reads a datagram.
    ///
    /// # Errors
    /// When it is none for a rig of so many magnets.
    pub fn decode(bytes: &[u8], magnets: usize) -> Result<Self, MalformedDatagram> {
        let malformed = MalformedDatagram { expected: "poses", length: bytes.len() };
        let is_whole = bytes.len() == POSES_HEAD + MAGNET * magnets && bytes.starts_with(&POSES);
        if !is_whole || magnets > MAGNETS_MAX || word(bytes, 16) as usize != magnets {
            return Err(malformed);
        }
        let mut poses = Self {
            sequence: long(bytes, 8),
            age_us: word(bytes, 4),
            magnet_count: word(bytes, 16),
            magnets: [MagnetPose::default(); MAGNETS_MAX],
        };
        for (index, magnet) in poses.magnets.iter_mut().take(magnets).enumerate() {
            let at = POSES_HEAD + index * MAGNET;
            magnet.position_m = [0, 1, 2].map(|axis| real(bytes, at + 8 * axis));
            magnet.orientation_xyzw = [3, 4, 5, 6].map(|axis| real(bytes, at + 8 * axis));
            magnet.valid = word(bytes, at + 56);
        }
        Ok(poses)
    }
}

fn values(
    magic: [u8; 4],
    sequence: u64,
    words: (u32, u32),
    actuation: &Actuation,
    coils: usize,
    frames: usize,
) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(DATAGRAM_MAX);
    bytes.extend(magic);
    bytes.extend(words.0.to_le_bytes());
    bytes.extend(sequence.to_le_bytes());
    bytes.extend(words.1.to_le_bytes());
    // At most 32 and 8.
    #[expect(clippy::cast_possible_truncation, reason = "at most 32 and 8")]
    for count in [coils as u16, frames as u16] {
        bytes.extend(count.to_le_bytes());
    }
    let currents = actuation.current_a.iter().take(coils);
    let angles = actuation.angle_rad.iter().take(frames);
    bytes.extend(currents.chain(angles).flat_map(|value| value.to_le_bytes()));
    bytes
}

fn read_values(
    magic: [u8; 4],
    bytes: &[u8],
    coils: usize,
    frames: usize,
) -> Option<(u64, (u32, u32), Actuation)> {
    let is_whole = bytes.len() == HEAD + 8 * (coils + frames) && bytes.starts_with(&magic);
    if !is_whole || coils > COILS_MAX || frames > POSE_PARAMETERS_MAX {
        return None;
    }
    let counts = word(bytes, 20);
    if (counts & 0xffff) as usize != coils || (counts >> 16) as usize != frames {
        return None;
    }
    let mut actuation = Actuation::default();
    for (index, current) in actuation.current_a.iter_mut().take(coils).enumerate() {
        *current = real(bytes, HEAD + 8 * index);
    }
    for (index, angle) in actuation.angle_rad.iter_mut().take(frames).enumerate() {
        *angle = real(bytes, HEAD + 8 * (coils + index));
    }
    Some((long(bytes, 8), (word(bytes, 4), word(bytes, 16)), actuation))
}

/// Bytes from `at` on; zeros past the end, which no caller reaches.
fn part<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    let mut part = [0; N];
    for (to, from) in part.iter_mut().zip(bytes.iter().skip(at)) {
        *to = *from;
    }
    part
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(part(bytes, at))
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(part(bytes, at))
}

fn real(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(part(bytes, at))
}

#[cfg(test)]
mod tests {
    use super::{Answer, Poses, Request, kind};
    use crate::message::{Actuation, MAGNETS_MAX, MagnetPose};

    fn actuation() -> Actuation {
        let mut actuation = Actuation::default();
        actuation.current_a[..3].copy_from_slice(&[1.5, -2.0, 0.25]);
        actuation.angle_rad[..2].copy_from_slice(&[0.5, -0.125]);
        actuation
    }

    #[test]
    fn datagrams_come_back_as_they_went() {
        let request =
            Request { sequence: 1 << 40, kind: kind::FOLLOW, validity_us: 50_000, actuation: actuation() };
        assert_eq!(Request::decode(&request.encode(3, 2), 3, 2), Ok(request));
        let answer = Answer { sequence: 7, state: 1, fault: 9, actuation: actuation() };
        assert_eq!(Answer::decode(&answer.encode(3, 2), 3, 2), Ok(answer));
        let mut magnets = [MagnetPose::default(); MAGNETS_MAX];
        magnets[1] = MagnetPose {
            position_m: [0.1, 0.2, 0.3],
            orientation_xyzw: [0.0, 0.6, 0.0, 0.8],
            valid: 1,
            ..MagnetPose::default()
        };
        let poses = Poses { sequence: 3, age_us: 5_000, magnet_count: 2, magnets };
        assert_eq!(Poses::decode(&poses.encode(), 2), Ok(poses));
    }

    /// Goal: the bytes are those of the specification, which other languages are written after.
    #[test]
    fn request_has_the_bytes_of_the_specification() {
        let request = Request { sequence: 0x0102, kind: 1, validity_us: 0x0304, actuation: actuation() };
        let bytes = request.encode(3, 2);
        assert_eq!(bytes.len(), 24 + 5 * 8);
        assert_eq!(bytes[..24], *b"MSR1\x01\0\0\0\x02\x01\0\0\0\0\0\0\x04\x03\0\0\x03\0\x02\0");
        assert_eq!(bytes[24..32], 1.5_f64.to_le_bytes());
        assert_eq!(bytes[48..56], 0.5_f64.to_le_bytes());
    }

    #[test]
    fn datagrams_of_another_rig_or_cut_short_are_refused() {
        let request = Request { sequence: 1, kind: 1, validity_us: 1, actuation: actuation() };
        let bytes = request.encode(3, 2);
        assert!(Request::decode(&bytes, 2, 3).is_err());
        for length in 0..bytes.len() {
            assert!(Request::decode(&bytes[..length], 3, 2).is_err(), "{length}");
        }
        assert!(Answer::decode(&bytes, 3, 2).is_err(), "a request is no answer");
        assert!(Poses::decode(&bytes, 1).is_err());
    }
}
