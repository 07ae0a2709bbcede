//! What a driver or client in another language needs: the layouts of all messages, names and settings of the
//! services, and a rig's numbers.
//!
//! [`python()`] writes them as a module of ctypes structures, [`reference()`] as a page for people; [`RigSheet`] is a rig as one JSON
//! object.

mod layout;
mod python;
mod reference;
mod sheet;

pub(crate) use layout::HasKind;
pub use layout::{Field, Kind, Layout, layouts, schema_hash, type_names};
pub use python::{LEFT_OUT, python};
pub use reference::reference;
pub use sheet::{CoilSheet, FrameSheet, MagnetSheet, RigSheet};
