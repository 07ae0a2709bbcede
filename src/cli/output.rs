//! Results on standard output, messages on standard error.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};

use serde::Serialize;

/// Prints a result. A reader that went away is an error, not a panic.
pub fn result(text: impl Display) -> io::Result<()> {
    let mut output = io::stdout().lock();
    let written = write!(output, "{text}").and_then(|()| output.flush());
    written.map_err(|error| io::Error::new(error.kind(), format!("standard output: {error}")))
}

/// Prints one object on one line.
pub fn json(value: &impl Serialize) -> anyhow::Result<()> {
    Ok(result(format_args!("{}\n", serde_json::to_string(value)?))?)
}

/// Tells the user what went wrong. Nothing can be done when standard error is closed.
pub fn error(message: impl Display) {
    let label = if coloured() { "\x1b[1;31merror:\x1b[0m" } else { "error:" };
    let _ = writeln!(io::stderr().lock(), "{label} {message}");
}

/// Tells the user something on the way.
pub fn note(message: impl Display) {
    let _ = writeln!(io::stderr().lock(), "{message}");
}

/// Colour is for terminals, and not when `NO_COLOR` is set to anything (<https://no-color.org>).
fn coloured() -> bool {
    let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    io::stderr().is_terminal() && !refused
}
