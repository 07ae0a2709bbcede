//! Pieces of TOML files that commands write for a configuration to extend, or that extend one.

use std::path::{Component, Path, PathBuf};

use magsteer::config::Document;
use magsteer_hal::config::{CoilConfig, CoilTypeConfig};

/// One of `[[coils]]`.
pub fn coil_entry(coil: &CoilConfig) -> String {
    let mut text =
        format!("\n[[coils]]\nname = {}\ntype = {}\n", quoted(&coil.name), quoted(&coil.coil_type));
    for (key, value) in [
        ("azimuth_deg", coil.azimuth_deg),
        ("elevation_deg", coil.elevation_deg),
        ("distance_mm", coil.distance_mm),
    ] {
        if let Some(value) = value {
            text += &format!("{key} = {value:?}\n");
        }
    }
    for (key, value) in [("position_mm", coil.position_mm), ("axis", coil.axis)] {
        if let Some(value) = value {
            text += &format!("{key} = {value:?}\n");
        }
    }
    if let Some(frame) = &coil.frame {
        text += &format!("frame = {}\n", quoted(frame));
    }
    if let Some(gain) = coil.gain {
        text += &format!("gain = {gain:?}\n");
    }
    text
}

/// The keys of a coil type that are of its circuit.
pub fn circuit(coil_type: &CoilTypeConfig) -> String {
    format!(
        "current_max_a = {:?}\nslew_max_a_per_s = {:?}\nresistance_ohm = {:?}\ninductance_h = {:?}\nsupply_v = {:?}\n",
        coil_type.current_max_a,
        coil_type.slew_max_a_per_s,
        coil_type.resistance_ohm,
        coil_type.inductance_h,
        coil_type.supply_v
    )
}

/// Whether the simulated plant of a configuration, where it has one, is built as the configuration says, and not as another.
pub fn simulates_itself(document: &Document) -> bool {
    document.has("plant") && document.path_at("plant.nominal").is_none()
}

/// The table by which an overlay with better parameters leaves the simulated plant what it was: built as `nominal` says.
pub fn nominal_entry(nominal: &str) -> String {
    format!("\n[plant]\nnominal = {}\n", quoted(nominal))
}

/// A text as TOML writes it.
pub fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A key of a table, quoted where it must be.
pub fn key(name: &str) -> String {
    let is_bare = |letter: char| letter.is_ascii_alphanumeric() || letter == '-' || letter == '_';
    if !name.is_empty() && name.chars().all(is_bare) { name.to_owned() } else { quoted(name) }
}

/// The path of `file` as seen from the folder of `from`.
pub fn path_from(from: &Path, file: &Path) -> String {
    let absolute = |path: &Path| {
        path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_path_buf())
    };
    let folder = match from.parent() {
        Some(parent) if parent != Path::new("") => absolute(parent),
        _ => absolute(Path::new(".")),
    };
    let file = absolute(file);
    let (left, right): (Vec<Component<'_>>, Vec<Component<'_>>) =
        (folder.components().collect(), file.components().collect());
    let common = left.iter().zip(&right).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n(Component::ParentDir, left.len() - common);
    let path: PathBuf = up.chain(right[common..].iter().copied()).collect();
    path.display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_leads_from_one_folder_to_the_other() {
        let path = |from: &str, file: &str| path_from(Path::new(from), Path::new(file));
        assert_eq!(path("/no/where/out.toml", "/no/where/rig.toml"), "rig.toml");
        assert_eq!(path("/no/where/deep/out.toml", "/no/rig.toml"), "../../rig.toml");
        assert_eq!(path("/no/out.toml", "/other/rig.toml"), "../other/rig.toml");
    }

    #[test]
    fn a_name_that_is_no_bare_key_is_quoted() {
        assert_eq!(key("iron-top_1"), "iron-top_1");
        assert_eq!(key("coil 1"), "\"coil 1\"");
        assert_eq!(key(""), "\"\"");
    }
}
