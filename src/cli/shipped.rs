//! The files that come with the program, for who names none.

use std::path::Path;

use magsteer::config::{Document, Problems};

const CONFIG: &str = "config/bigmag-planar.toml";
const CONFIG_TEXT: &str = include_str!("../../config/bigmag-planar.toml");

/// The configuration `file`; without one the default rig's, from the working directory or else from this program.
pub fn config(file: Option<&Path>) -> Result<Document, Problems> {
    document(file, CONFIG, CONFIG_TEXT)
}

fn document(file: Option<&Path>, default: &str, text: &str) -> Result<Document, Problems> {
    match file {
        Some(file) => Document::load(file),
        None if Path::new(default).exists() => Document::load(Path::new(default)),
        None => Document::from_text(format!("{default} (in this program)"), text),
    }
}
