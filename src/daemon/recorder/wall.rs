//! Times of day as people and other programs read them: RFC 3339, UTC, microseconds.
//!
//! Dates from days by Howard Hinnant, *chrono-compatible low-level date algorithms* (2013): years begin in
//! March, so that the leap day comes last.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use magsteer_hal::Stamp;

const SECONDS_A_DAY: u64 = 86_400;

/// When `stamp` was, by the clock on the wall as it goes now.
pub fn wall_time(stamp: Stamp) -> SystemTime {
    let (now, wall) = (Stamp::now(), SystemTime::now());
    let ago = wall.checked_sub(now.since(stamp)).unwrap_or(UNIX_EPOCH);
    ago.checked_add(stamp.since(now)).unwrap_or(wall)
}

/// `2026-11-22T09:14:19.012345Z`. Times before 1970 read as 1970 begins.
#[must_use]
pub fn rfc_3339(time: SystemTime) -> String {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    let (days, second) = (since.as_secs() / SECONDS_A_DAY, since.as_secs() % SECONDS_A_DAY);
    let (year, month, day) = date(days);
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    let micros = since.subsec_micros();
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{micros:06}Z")
}

/// `20261122-091419`, for names of files.
#[must_use]
pub fn compact(time: SystemTime) -> String {
    let text = rfc_3339(time);
    let whole = text.split_once('.').map_or(text.as_str(), |(whole, _)| whole);
    whole.replace(['-', ':'], "").replace('T', "-")
}

/// Year, month and day, `days` after the first of January 1970.
fn date(days: u64) -> (u64, u64, u64) {
    // Eras of 400 years, 146097 days each; the first of March of year 0 lies 719468 days before 1970.
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted / 146_097, shifted % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    (400 * era + year_of_era + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, UNIX_EPOCH};

    use magsteer_hal::Stamp;

    use super::{compact, date, rfc_3339, wall_time};

    /// Goal: against times known from elsewhere, `date -u -d @...`.
    #[test]
    fn known_seconds_have_known_dates() {
        let cases = [
            (0, "1970-01-01T00:00:00.000000Z"),
            (951_782_399, "2000-02-28T23:59:59.000000Z"),
            (951_782_400, "2000-02-29T00:00:00.000000Z"),
            (951_868_800, "2000-03-01T00:00:00.000000Z"),
            (1_709_164_800, "2024-02-29T00:00:00.000000Z"),
            (1_795_252_459, "2026-11-21T09:14:19.000000Z"),
            (4_107_542_400, "2100-03-01T00:00:00.000000Z"),
        ];
        for (seconds, text) in cases {
            assert_eq!(rfc_3339(UNIX_EPOCH + Duration::from_secs(seconds)), text);
        }
        let time = UNIX_EPOCH + Duration::from_micros(1_795_252_459_000_042);
        assert_eq!(rfc_3339(time), "2026-11-21T09:14:19.000042Z");
        assert_eq!(compact(time), "20261121-091419");
    }

    /// Goal: an independent count, day by day over five centuries.
    #[test]
    fn days_follow_one_another_as_in_the_calendar() {
        let (mut year, mut month, mut day) = (1970, 1, 1);
        for days in 0..183_000 {
            assert_eq!(date(days), (year, month, day), "{days}");
            let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
            let length = match month {
                2 => 28 + u64::from(leap),
                4 | 6 | 9 | 11 => 30,
                _ => 31,
            };
            day += 1;
            if day > length {
                (day, month) = (1, month + 1);
            }
            if month > 12 {
                (month, year) = (1, year + 1);
            }
        }
    }

    #[test]
    fn stamps_lie_on_the_wall_as_far_apart_as_they_are() {
        let now = Stamp::now();
        let earlier = Stamp::from_nanoseconds(now.nanoseconds().saturating_sub(5_000_000_000));
        let apart = wall_time(now).duration_since(wall_time(earlier)).expect("in order");
        assert!(apart >= now.since(earlier), "time only passes between two looks: {apart:?}");
    }
}
