//! What a field of a recorded cycle can be: how it is written, read, named in ROS and listed in a table.

use super::cdr::{CdrError, Decoder, Encoder};

/// One number of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A count, code or time.
    Count(u64),
    /// A measure; not a number where there is none.
    Real(f64),
}

/// Of what a field has entries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Per {
    /// One value a cycle.
    Cycle,
    /// A value a coil.
    Coil,
    /// A value a frame.
    Frame,
    /// A value, or three or four, a magnet.
    Magnet,
    /// A value an answer.
    Answer,
}

/// A field's type.
pub trait Value: Sized {
    /// Its type in ROS.
    const ROS: &'static str;
    /// Endings of the names of what an entry is made of.
    const PARTS: &'static [&'static str];
    /// True for counts, codes and times.
    const IS_COUNT: bool;

    /// Writes it.
    fn put(&self, encoder: &mut Encoder);

    /// Reads it.
    ///
    /// # Errors
    /// When the message ends early or holds a length that cannot be true.
    fn take(decoder: &mut Decoder<'_>) -> Result<Self, CdrError>;
}

/// Lists the numbers of a field.
pub trait List {
    /// Adds every number, in order.
    fn list(&self, to: &mut Vec<Number>);
}

macro_rules! primitive {
    ($type:ident, $ros:literal, $number:ident, $is_count:literal) => {
        impl Value for $type {
            const ROS: &'static str = $ros;
            const PARTS: &'static [&'static str] = &[""];
            const IS_COUNT: bool = $is_count;

            fn put(&self, encoder: &mut Encoder) {
                encoder.$type(*self);
            }

            fn take(decoder: &mut Decoder<'_>) -> Result<Self, CdrError> {
                decoder.$type()
            }
        }

        impl List for $type {
            fn list(&self, to: &mut Vec<Number>) {
                to.push(Number::$number((*self).into()));
            }
        }

        impl Value for Vec<$type> {
            const ROS: &'static str = concat!($ros, "[]");
            const PARTS: &'static [&'static str] = &[""];
            const IS_COUNT: bool = $is_count;

            fn put(&self, encoder: &mut Encoder) {
                encoder.length(self.len());
                self.iter().for_each(|value| encoder.$type(*value));
            }

            fn take(decoder: &mut Decoder<'_>) -> Result<Self, CdrError> {
                let length = decoder.length()?;
                (0..length).map(|_| decoder.$type()).collect()
            }
        }

        impl List for Vec<$type> {
            fn list(&self, to: &mut Vec<Number>) {
                to.extend(self.iter().map(|value| Number::$number((*value).into())));
            }
        }
    };
}

primitive!(u64, "uint64", Count, true);
primitive!(u32, "uint32", Count, true);
primitive!(f64, "float64", Real, false);

/// Vectors lie flat, one after another.
macro_rules! vectors {
    ($count:literal, $parts:expr) => {
        impl Value for Vec<[f64; $count]> {
            const ROS: &'static str = "float64[]";
            const PARTS: &'static [&'static str] = &$parts;
            const IS_COUNT: bool = false;

            fn put(&self, encoder: &mut Encoder) {
                encoder.length($count * self.len());
                self.iter().flatten().for_each(|value| encoder.f64(*value));
            }

            fn take(decoder: &mut Decoder<'_>) -> Result<Self, CdrError> {
                let length = decoder.length()?;
                if length % $count != 0 {
                    return Err(CdrError::Length(length));
                }
                let mut vectors = Vec::with_capacity(length / $count);
                for _ in 0..length / $count {
                    let mut vector = [0.0; $count];
                    for value in &mut vector {
                        *value = decoder.f64()?;
                    }
                    vectors.push(vector);
                }
                Ok(vectors)
            }
        }

        impl List for Vec<[f64; $count]> {
            fn list(&self, to: &mut Vec<Number>) {
                to.extend(self.iter().flatten().map(|value| Number::Real(*value)));
            }
        }
    };
}

vectors!(3, ["_x", "_y", "_z"]);
vectors!(4, ["_x", "_y", "_z", "_w"]);
