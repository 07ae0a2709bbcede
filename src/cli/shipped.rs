//! The configuration that is meant when none is named.

use std::path::Path;

use magsteer::config::{Document, Problems};

/// The rig that is meant when none is named.
const CONFIG: &str = "config/bigmag-planar.toml";
/// The same, for a working directory that does not have it.
const CONFIG_TEXT: &str = include_str!("../../config/bigmag-planar.toml");

/// Reads the file named, else the default one, else the copy of it in this program.
pub fn config(file: Option<&Path>) -> Result<Document, Problems> {
    let default = Path::new(CONFIG);
    match file {
        Some(file) => Document::load(file),
        None if default.exists() => Document::load(default),
        None => Document::from_text(format!("{CONFIG} (in this program)"), CONFIG_TEXT),
    }
}
