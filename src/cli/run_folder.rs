//! Where the files of a run go.

use std::time::SystemTime;

use magsteer::daemon::recorder::compact;

/// `NAME-YYYYMMDD-HHMMSS`, UTC.
pub fn dated(name: &str) -> String {
    format!("{name}-{}", compact(SystemTime::now()))
}
