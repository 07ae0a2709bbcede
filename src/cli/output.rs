//! Results on standard output, messages on standard error.

use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write};

use magsteer::config::Problems;
use serde::Serialize;

/// Most problems that are told at once: whoever mends these sees the next.
const PROBLEMS_MAX: usize = 20;

/// Whoever read standard output went away, as `head` does once it has its lines. It had enough: a command
/// that has nothing to do but to tell ends quietly and well.
#[derive(Debug, thiserror::Error)]
#[error("standard output was closed")]
struct ReaderGone;

/// Prints a result.
///
/// # Errors
/// When it cannot be written; a reader that went away is told apart by [`is_reader_gone`].
pub fn result(text: impl Display) -> io::Result<()> {
    let mut output = io::stdout().lock();
    let written = write!(output, "{text}").and_then(|()| output.flush());
    written.map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => io::Error::new(ErrorKind::BrokenPipe, ReaderGone),
        kind => io::Error::new(kind, format!("standard output: {error}")),
    })
}

/// True when nothing failed but that the reader of standard output went away.
pub fn is_reader_gone(error: &anyhow::Error) -> bool {
    let cause = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
    cause.is_some_and(|cause| cause.is::<ReaderGone>())
}

/// A result as told, to a reader that went away too: for a command whose exit code says more than its words.
///
/// # Errors
/// Whatever else kept it from being told.
pub fn told(told: anyhow::Result<()>) -> anyhow::Result<()> {
    told.or_else(|error| if is_reader_gone(&error) { Ok(()) } else { Err(error) })
}

/// A number with so many digits behind the point; what rounds to zero has no sign.
pub fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
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

/// Tells the user what is wrong with a file, each problem as an error of its own; of very many the first.
pub fn problems(problems: &Problems) {
    let problems = problems.as_slice();
    problems.iter().take(PROBLEMS_MAX).for_each(error);
    if let Some(rest) = problems.len().checked_sub(PROBLEMS_MAX).filter(|rest| *rest > 0) {
        error(format_args!("{rest} more: mend these first"));
    }
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

#[cfg(test)]
mod tests {
    use super::fixed;

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        let written = [-0.004, -0.006, 0.004, -12.0, -0.0, f64::NAN].map(|value| fixed(value, 2));
        assert_eq!(written, ["0.00", "-0.01", "0.00", "-12.00", "0.00", "NaN"]);
    }
}
