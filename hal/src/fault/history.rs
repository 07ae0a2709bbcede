//! What was lately, in a line of bounded length.

use std::collections::VecDeque;
use std::time::Duration;

use super::kinds::DELAY_MAX;

/// Entries that follow another one sooner than this are left out. So the line holds the longest delay
/// whatever the rate, and never grows: at more than 2 kHz what is delayed also becomes rarer.
const SPACING: Duration = Duration::from_micros(500);

/// The longest delay in entries, and some more for those at both ends.
const ENTRIES: usize = (DELAY_MAX.as_micros() / SPACING.as_micros()) as usize + 4;

/// Values with the time at which they came, counted from the driver's start.
#[derive(Debug, Clone)]
pub(super) struct History<T> {
    entries: VecDeque<(Duration, T)>,
}

impl<T: Copy> History<T> {
    pub(super) fn new() -> Self {
        Self { entries: VecDeque::with_capacity(ENTRIES) }
    }

    /// Takes note of a value; times must not fall.
    pub(super) fn push(&mut self, time: Duration, value: T) {
        if self.entries.back().is_some_and(|(last, _)| time.saturating_sub(*last) < SPACING) {
            return;
        }
        if self.entries.len() == ENTRIES {
            self.entries.pop_front();
        }
        self.entries.push_back((time, value));
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
    }

    /// The value that was newest at `time`.
    pub(super) fn at(&self, time: Duration) -> Option<&T> {
        let later = self.entries.partition_point(|(noted, _)| *noted <= time);
        later.checked_sub(1).and_then(|index| self.entries.get(index)).map(|(_, value)| value)
    }

    /// The first entry after `after` and not after `until`.
    pub(super) fn next(&self, after: Duration, until: Duration) -> Option<(Duration, T)> {
        let index = self.entries.partition_point(|(noted, _)| *noted <= after);
        self.entries.get(index).filter(|(noted, _)| *noted <= until).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::{DELAY_MAX, Duration, ENTRIES, History};

    #[test]
    fn line_never_grows_and_reaches_back_over_the_longest_delay() {
        for step in [Duration::from_micros(50), Duration::from_micros(500), Duration::from_micros(700)] {
            let mut history = History::new();
            let mut time = Duration::ZERO;
            let capacity = history.entries.capacity();
            for number in 0_u32..50_000 {
                time += step;
                history.push(time, number);
            }
            assert_eq!((history.entries.capacity(), history.entries.len()), (capacity, ENTRIES));
            let (oldest, _) = history.entries[0];
            assert!(oldest <= time - DELAY_MAX, "{step:?}");
        }
    }

    #[test]
    fn entries_are_found_by_their_times() {
        let mut history = History::new();
        let at = Duration::from_millis;
        for (time, value) in [(10, 'a'), (20, 'b'), (30, 'c')] {
            history.push(at(time), value);
        }
        assert_eq!(history.at(at(9)), None);
        assert_eq!((history.at(at(10)), history.at(at(29))), (Some(&'a'), Some(&'b')));
        assert_eq!(history.at(at(99)), Some(&'c'));
        assert_eq!(history.next(at(10), at(30)), Some((at(20), 'b')));
        assert_eq!(history.next(at(10), at(19)), None);
        history.clear();
        assert_eq!(history.at(at(99)), None);
    }
}
