//! `magsteer hal new`: a driver to begin with.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Args, ValueEnum};
use magsteer::config::{Config, Document};
use magsteer_hal::HardwareDescription;
use magsteer_hal::binding::{RigSheet, python};
use serde::Serialize;

use super::super::exit::cannot_create;
use super::super::exit::{Exit, Failure};
use super::super::{output, shipped};

/// What the driver is written in.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Language {
    /// A Cargo project over the crate `magsteer-hal`.
    Rust,
    /// A program over PyPI `iceoryx2`.
    Python,
    /// A device behind the UDP protocol, with `magsteer hal udp-driver` in front of it.
    C,
}

/// Write a driver of ideal hardware that passes conformance, with the places marked where yours goes.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer hal new my-amplifiers --lang python --config config/bigmag-planar.toml\n  \
    cat my-amplifiers/README.md"
)]
pub struct New {
    /// Name of the driver, and of its folder.
    #[arg(value_name = "NAME")]
    name: String,
    /// What it is written in.
    #[arg(long, value_enum)]
    lang: Language,
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Folder below which the driver's own is made.
    #[arg(long, value_name = "DIR", default_value = ".")]
    dir: PathBuf,
    /// For Rust: folder of the crate magsteer-hal, of the same version as this program.
    #[arg(long, value_name = "DIR", default_value = "hal")]
    hal_path: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What was written.
#[derive(Serialize)]
struct Answer {
    folder: PathBuf,
    files: Vec<PathBuf>,
}

const PYTHON_PACKAGE: [(&str, &str); 6] = [
    ("magsteer/__init__.py", include_str!("../../../hal/python/magsteer/__init__.py")),
    ("magsteer/driver.py", include_str!("../../../hal/python/magsteer/driver.py")),
    ("magsteer/endpoint.py", include_str!("../../../hal/python/magsteer/endpoint.py")),
    ("magsteer/guard.py", include_str!("../../../hal/python/magsteer/guard.py")),
    ("magsteer/operator.py", include_str!("../../../hal/python/magsteer/operator.py")),
    ("magsteer/rig.py", include_str!("../../../hal/python/magsteer/rig.py")),
];

impl New {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let allowed = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-';
        let begins_well = self.name.starts_with(|letter: char| letter.is_ascii_lowercase());
        if !begins_well || self.name.len() > 40 || !self.name.chars().all(allowed) {
            let name = &self.name;
            return Err(Failure::usage(format_args!(
                "{name}: must be up to 40 lower-case letters, digits and hyphens, a letter first"
            )));
        }
        let document = shipped::config(self.config.as_deref())?;
        let config = Config::from_document(&document)?;
        let files = match self.lang {
            Language::Rust => self.rust(&document)?,
            Language::Python => self.python(&config.description)?,
            Language::C => self.c(&config.description),
        };
        let folder = self.dir.join(&self.name);
        if folder.exists() {
            let why = anyhow!("{}: is there already", folder.display());
            return Err(Failure::with(Exit::CannotCreate, why));
        }
        let mut written = Vec::new();
        for (name, text) in files {
            let path = folder.join(name);
            write(&path, &text)?;
            written.push(path);
        }
        if self.json {
            output::json(&Answer { folder, files: written })?;
        } else {
            output::result(format_args!(
                "{} files in {}; its README.md has the commands\n",
                written.len(),
                folder.display()
            ))?;
        }
        Ok(Exit::Success)
    }

    fn filled(&self, template: &str) -> String {
        let config = self.config.as_deref().unwrap_or(Path::new("config/bigmag-planar.toml"));
        // The commands of the README are meant to be run from its folder.
        let config = std::path::absolute(config).unwrap_or_else(|_| config.to_owned());
        template
            .replace("@NAME@", &self.name)
            .replace("@VERSION@", env!("CARGO_PKG_VERSION"))
            .replace("@CONFIG@", &config.display().to_string())
    }

    fn rust(&self, document: &Document) -> anyhow::Result<Vec<(&'static str, String)>> {
        let hal = std::path::absolute(&self.hal_path)?;
        if !hal.join("Cargo.toml").is_file() {
            let found = hal.display();
            return Err(Failure::usage(format_args!(
                "{found}: no crate there; name that of magsteer-hal by --hal-path"
            )));
        }
        let manifest = self
            .filled(include_str!("../../../hal/templates/rust/Cargo.toml.in"))
            .replace("@HAL@", &hal.display().to_string());
        Ok(vec![
            ("Cargo.toml", manifest),
            ("src/main.rs", include_str!("../../../hal/templates/rust/src/main.rs").to_owned()),
            ("rig.toml", hardware_tables(&document.resolved().text)?),
            ("README.md", self.filled(include_str!("../../../hal/templates/rust/README.md.in"))),
        ])
    }

    fn python(&self, description: &HardwareDescription) -> anyhow::Result<Vec<(&'static str, String)>> {
        let sheet = serde_json::to_string_pretty(&RigSheet::of(description))?;
        let mut files = vec![
            ("driver.py", include_str!("../../../hal/python/driver.py").to_owned()),
            ("rig.json", sheet + "\n"),
            ("README.md", self.filled(include_str!("../../../hal/templates/README-python.md.in"))),
            ("magsteer/messages.py", python()),
        ];
        files.extend(PYTHON_PACKAGE.map(|(name, text)| (name, text.to_owned())));
        Ok(files)
    }

    fn c(&self, description: &HardwareDescription) -> Vec<(&'static str, String)> {
        vec![
            ("device.c", include_str!("../../../hal/templates/c/device.c").to_owned()),
            ("rig.h", rig_header(&RigSheet::of(description))),
            ("Makefile", include_str!("../../../hal/templates/c/Makefile").to_owned()),
            ("UDP.md", include_str!("../../../hal/docs/udp.md").to_owned()),
            ("README.md", self.filled(include_str!("../../../hal/templates/c/README.md.in"))),
        ]
    }
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    made.and_then(|()| std::fs::write(path, text)).map_err(|error| cannot_create(path, &error))
}

/// The tables of a configuration that describe the rig, which a driver reads.
fn hardware_tables(text: &str) -> anyhow::Result<String> {
    let mut table: toml::Table = toml::from_str(text)?;
    table.retain(|key, _| matches!(key, "rig" | "frames" | "coil_types" | "coils" | "manipulator"));
    Ok(toml::to_string(&table)?)
}

/// The rig's numbers as a C header.
fn rig_header(sheet: &RigSheet) -> String {
    let mut text =
        String::from("/* The rig's numbers, written by `magsteer hal new`; SI units, world frame. */\n");
    // Writing into a string cannot fail.
    let _ = writeln!(text, "#define RIG_NAME \"{}\"", sheet.rig);
    let _ = writeln!(text, "#define RIG_COILS {}", sheet.coils.len());
    let _ = writeln!(text, "#define RIG_FRAMES {}", sheet.frames.len());
    let _ = writeln!(text, "#define RIG_MAGNETS {}", sheet.magnets.len());
    let slew: Vec<String> = sheet.coils.iter().map(|coil| format!("{:?}", coil.slew_max_a_per_s)).collect();
    let _ =
        writeln!(text, "static const double rig_slew_max_a_per_s[RIG_COILS + 1] = {{{}}};", slew.join(", "));
    let _ =
        writeln!(text, "/* Position and orientation x, y, z, w of each magnet while the rod is straight. */");
    let _ = writeln!(text, "static const double rig_straight_rod[RIG_MAGNETS + 1][7] = {{");
    for magnet in &sheet.magnets {
        let values = magnet.position_m.iter().chain(&magnet.orientation_xyzw);
        let values: Vec<String> = values.map(|value| format!("{value:?}")).collect();
        let _ = writeln!(text, "    {{{}}}, /* {} */", values.join(", "), magnet.name);
    }
    text.push_str("};\n");
    text
}
