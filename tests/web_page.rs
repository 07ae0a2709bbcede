//! The page of `magsteer web` in headless Chromium: `tests/scripts/web_page.py` drives it as a person would.
#![cfg(all(feature = "web", feature = "sim"))]

use std::path::Path;
use std::process::Command;

/// What the script ends with on a machine without a browser.
const SKIPPED: i32 = 77;

#[test]
fn page_steers_stops_survives_a_daemons_restart_and_asks_nothing_of_other_machines() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut script = Command::new("python3");
    script.arg(here.join("tests/scripts/web_page.py"));
    script.arg("--magsteer").arg(env!("CARGO_BIN_EXE_magsteer"));
    script.arg("--config").arg(here.join("config/bigmag-planar.toml"));
    if let Some(folder) = std::env::var_os("MAGSTEER_SCREENS") {
        script.arg("--screens").arg(folder);
    }
    let output = match script.output() {
        Ok(output) => output,
        Err(error) => {
            println!("skipped: python3 cannot be run: {error}");
            return;
        }
    };
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}{}", String::from_utf8_lossy(&output.stderr));
    let code = output.status.code();
    assert!(code == Some(0) || code == Some(SKIPPED), "{code:?}");
    assert!(code == Some(SKIPPED) || text.contains("ok: none of"), "every check was made");
}
