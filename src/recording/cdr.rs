//! CDR, the encoding of ROS 2 messages: little-endian, every primitive at a multiple of its own size, counted
//! from behind the four bytes that name the encoding.
//!
//! Source: OMG, *Common Object Request Broker Architecture*, part 2, clause 9.3 (CDR transfer syntax), in the
//! form of version 1 that ROS 2 uses.

/// Plain CDR, little-endian, no options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
/// Longest sequence or text that is believed, entries.
const LENGTH_MAX: usize = 1 << 20;

/// A message that does not decode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// It ends before its last value.
    #[error("ends early")]
    Short,
    /// Another encoding than little-endian CDR.
    #[error("is not little-endian CDR")]
    Encoding,
    /// A length that cannot be true.
    #[error("has a sequence of {0} entries")]
    Length(usize),
    /// A text that is not UTF-8, or does not end.
    #[error("has a text that is none")]
    Text,
}

/// Writes one message.
#[derive(Debug)]
pub struct Encoder {
    bytes: Vec<u8>,
}

impl Encoder {
    /// A message without values, in memory that held a former one.
    pub fn reusing(mut bytes: Vec<u8>) -> Self {
        bytes.clear();
        bytes.extend(LITTLE_ENDIAN);
        Self { bytes }
    }

    /// The whole message.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }

    fn align(&mut self, size: usize) {
        let used = self.bytes.len() - LITTLE_ENDIAN.len();
        self.bytes.resize(self.bytes.len() + used.next_multiple_of(size) - used, 0);
    }

    /// An `uint8`.
    pub fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    /// An `uint32`, an `int32` of the same bits, or a length.
    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    /// An `uint64`.
    pub fn u64(&mut self, value: u64) {
        self.align(8);
        self.bytes.extend(value.to_le_bytes());
    }

    /// A `float64`, bit for bit.
    pub fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    /// The length of a sequence.
    pub fn length(&mut self, length: usize) {
        self.u32(u32::try_from(length).unwrap_or(u32::MAX));
    }

    /// A `string`.
    pub fn text(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }
}

/// Reads one message.
#[derive(Debug)]
pub struct Decoder<'a> {
    values: &'a [u8],
    at: usize,
}

impl<'a> Decoder<'a> {
    /// At the first value of a message.
    ///
    /// # Errors
    /// When it is not little-endian CDR.
    pub fn new(bytes: &'a [u8]) -> Result<Self, CdrError> {
        let (head, values) = bytes.split_at_checked(LITTLE_ENDIAN.len()).ok_or(CdrError::Short)?;
        if head[..2] == LITTLE_ENDIAN[..2] { Ok(Self { values, at: 0 }) } else { Err(CdrError::Encoding) }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], CdrError> {
        let begin = self.at.next_multiple_of(N);
        let bytes = self.values.get(begin..begin + N).ok_or(CdrError::Short)?;
        self.at = begin + N;
        bytes.try_into().map_err(|_| CdrError::Short)
    }

    /// An `uint8`.
    ///
    /// # Errors
    /// When the message has ended, as for every value.
    pub fn u8(&mut self) -> Result<u8, CdrError> {
        self.take::<1>().map(|[byte]| byte)
    }

    /// An `uint32`.
    ///
    /// # Errors
    /// When the message has ended.
    pub fn u32(&mut self) -> Result<u32, CdrError> {
        self.take().map(u32::from_le_bytes)
    }

    /// An `uint64`.
    ///
    /// # Errors
    /// When the message has ended.
    pub fn u64(&mut self) -> Result<u64, CdrError> {
        self.take().map(u64::from_le_bytes)
    }

    /// A `float64`, bit for bit.
    ///
    /// # Errors
    /// When the message has ended.
    pub fn f64(&mut self) -> Result<f64, CdrError> {
        self.u64().map(f64::from_bits)
    }

    /// The length of a sequence.
    ///
    /// # Errors
    /// When the message has ended, or the length cannot be true.
    pub fn length(&mut self) -> Result<usize, CdrError> {
        let length = self.u32()? as usize;
        if length <= LENGTH_MAX { Ok(length) } else { Err(CdrError::Length(length)) }
    }

    /// A `string`.
    ///
    /// # Errors
    /// When it does not end, or is not UTF-8.
    pub fn text(&mut self) -> Result<&'a str, CdrError> {
        let length = self.length()?;
        let bytes = self.values.get(self.at..self.at + length).ok_or(CdrError::Short)?;
        self.at += length;
        let text = bytes.strip_suffix(&[0]).ok_or(CdrError::Text)?;
        std::str::from_utf8(text).map_err(|_| CdrError::Text)
    }
}

#[cfg(test)]
mod tests {
    use super::{CdrError, Decoder, Encoder};

    /// Goal: against bytes written down by hand from the rules: alignment counts from behind the head.
    #[test]
    fn values_stand_at_multiples_of_their_size_behind_the_head() {
        let mut encoder = Encoder::reusing(vec![9; 3]);
        encoder.u8(7);
        encoder.u32(1);
        encoder.text("ab");
        encoder.f64(1.0);
        let bytes = encoder.finish();
        let expected = [
            &[0, 1, 0, 0][..],
            &[7, 0, 0, 0],
            &[1, 0, 0, 0],
            &[3, 0, 0, 0, b'a', b'b', 0, 0],
            // 15 bytes so far: the number begins at 16.
            &1.0_f64.to_le_bytes(),
        ]
        .concat();
        assert_eq!(bytes, expected);
        let mut decoder = Decoder::new(&bytes).expect("a message");
        assert_eq!((decoder.u8(), decoder.u32(), decoder.text()), (Ok(7), Ok(1), Ok("ab")));
        assert_eq!((decoder.f64(), decoder.u8()), (Ok(1.0), Err(CdrError::Short)));
    }

    #[test]
    fn messages_that_are_none_are_refused() {
        assert_eq!(Decoder::new(&[0, 1, 0]).err(), Some(CdrError::Short));
        assert_eq!(Decoder::new(&[0, 0, 0, 0, 1]).err(), Some(CdrError::Encoding));
        let mut long = Decoder::new(&[0, 1, 0, 0, 255, 255, 255, 255]).expect("a head");
        assert_eq!(long.text(), Err(CdrError::Length(u32::MAX as usize)));
        let mut open = Decoder::new(&[0, 1, 0, 0, 1, 0, 0, 0, b'a']).expect("a head");
        assert_eq!(open.text(), Err(CdrError::Text));
    }
}
