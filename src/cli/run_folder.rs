//! Where the files of a run go.

pub use super::exit::cannot_create;

/// `NAME-YYYYMMDD-HHMMSS`, UTC.
pub fn dated(name: &str) -> String {
    let now = time::OffsetDateTime::now_utc();
    format!(
        "{name}-{:04}{:02}{:02}-{:02}{:02}{:02}",
        now.year(),
        u8::from(now.month()),
        now.day(),
        now.hour(),
        now.minute(),
        now.second()
    )
}
