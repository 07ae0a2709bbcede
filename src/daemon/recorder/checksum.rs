//! CRC-32 as of Ethernet, gzip and PNG: finds every error of up to 32 bits in a row, and others but for one
//! in 2^32.
//!
//! Reflected, polynomial 0xEDB88320, begins and ends inverted; a table of 256 entries (Sarwate 1988).

/// One step of every byte.
const TABLE: [u32; 256] = table();

const fn table() -> [u32; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut rest = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            rest = if rest & 1 == 1 { (rest >> 1) ^ 0xEDB8_8320 } else { rest >> 1 };
            bit += 1;
        }
        table[byte] = rest;
        byte += 1;
    }
    table
}

/// A checksum under way.
#[derive(Debug, Clone, Copy)]
pub struct Crc32(u32);

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

impl Crc32 {
    /// Of no bytes yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(!0)
    }

    /// Goes on with `bytes`.
    #[must_use]
    pub fn with(self, bytes: &[u8]) -> Self {
        let step = |rest: u32, byte: &u8| (rest >> 8) ^ TABLE[usize::from((rest as u8) ^ byte)];
        Self(bytes.iter().fold(self.0, step))
    }

    /// The checksum.
    #[must_use]
    pub const fn value(self) -> u32 {
        !self.0
    }
}

#[cfg(test)]
mod tests {
    use super::Crc32;

    /// Goal: the published check value, and that pieces add up.
    #[test]
    fn nine_digits_have_the_published_checksum_in_any_pieces() {
        let digits = b"123456789";
        for cut in 0..=digits.len() {
            let (first, second) = digits.split_at(cut);
            assert_eq!(Crc32::new().with(first).with(second).value(), 0xCBF4_3926);
        }
        assert_eq!(Crc32::new().value(), 0);
    }

    #[test]
    fn every_single_flipped_bit_changes_it() {
        let mut bytes: Vec<u8> = (0..200).collect();
        let right = Crc32::new().with(&bytes).value();
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert_ne!(Crc32::new().with(&bytes).value(), right, "bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}
