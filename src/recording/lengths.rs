//! Whether a record can be as long as it says: asked before the library that decodes it believes a length.
//!
//! A length that is a lie makes the library reserve as many bytes, up to 4 GiB, which a small machine answers by
//! ending the process; an attachment shorter than its own head makes it panic. Layout: the MCAP specification,
//! version 0 (<https://mcap.dev/spec>); numbers are little-endian, a *string* is its length in four bytes and its
//! bytes, a *map* its length in bytes and pairs of strings.

use mcap::records::op;

/// A part of a record.
#[derive(Debug, Clone, Copy)]
enum Part {
    /// So many bytes of fixed meaning.
    Fixed(usize),
    String,
    Map,
}

/// The parts that a record of this kind begins with, in order, the data behind them aside; `None` for kinds that are
/// of no use to a reader which needs no index.
const fn parts(code: u8) -> Option<&'static [Part]> {
    use Part::{Fixed, Map, String};
    Some(match code {
        op::HEADER => &[String, String],
        op::FOOTER => &[Fixed(20)],
        op::SCHEMA => &[Fixed(2), String, String, Fixed(4)],
        op::CHANNEL => &[Fixed(4), String, String, Map],
        op::MESSAGE => &[Fixed(22)],
        op::CHUNK => &[Fixed(28), String, Fixed(8)],
        // Times, name, type, length of the data; and behind that a checksum.
        op::ATTACHMENT => &[Fixed(16), String, String, Fixed(12)],
        op::METADATA => &[String, Map],
        _ => return None,
    })
}

/// True for records that a reader looks into.
pub const fn is_of_use(code: u8) -> bool {
    parts(code).is_some()
}

/// True when every length that the record names lies within it.
pub fn fit(code: u8, body: &[u8]) -> bool {
    let mut rest = body;
    parts(code).unwrap_or_default().iter().all(|part| match part {
        Part::Fixed(length) => take(&mut rest, *length).is_some(),
        Part::String => take_counted(&mut rest).is_some(),
        Part::Map => take_counted(&mut rest).is_some_and(|mut map| {
            while !map.is_empty() {
                if take_counted(&mut map).is_none() {
                    return false;
                }
            }
            true
        }),
    })
}

fn take<'a>(rest: &mut &'a [u8], length: usize) -> Option<&'a [u8]> {
    let (taken, behind) = rest.split_at_checked(length)?;
    *rest = behind;
    Some(taken)
}

/// Bytes behind their length.
fn take_counted<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = take(rest, 4)?.try_into().map(u32::from_le_bytes).ok()?;
    take(rest, usize::try_from(length).ok()?)
}

#[cfg(test)]
mod tests {
    use super::{fit, is_of_use, op};

    fn string(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    #[test]
    fn a_length_beyond_the_record_does_not_fit_and_every_cut_of_a_whole_one_neither() {
        let map = string(&format!("{}{}", "\u{1}\0\0\0k", "\u{1}\0\0\0v"));
        let channel = [vec![0; 4], string("/rig/cycle"), string("cdr"), map].concat();
        assert!(fit(op::CHANNEL, &channel));
        assert!((0..channel.len()).all(|end| !fit(op::CHANNEL, &channel[..end])));
        // The length of the value within the map, behind the key.
        let mut lies = channel.clone();
        let at = channel.len() - 5;
        lies[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(!fit(op::CHANNEL, &lies));
        let attachment =
            [vec![0; 16], string("config.toml"), string("application/toml"), vec![0; 8]].concat();
        assert!(!fit(op::ATTACHMENT, &attachment), "the checksum is missing");
        assert!(fit(op::ATTACHMENT, &[attachment, vec![0; 4]].concat()));
    }

    #[test]
    fn indices_are_of_no_use() {
        assert!(is_of_use(op::CHUNK) && is_of_use(op::METADATA));
        assert!(
            ![op::CHUNK_INDEX, op::MESSAGE_INDEX, op::STATISTICS, op::DATA_END].into_iter().any(is_of_use)
        );
    }
}
