//! How many periods the loop missed lately, and whether that is too many.

/// Leaky bucket of missed periods.
///
/// Every missed period adds one, every period elapsed drains `fraction`: a loop that misses a smaller share
/// for ever never fills it, a single stall fills it when it lasts a whole window.
#[derive(Debug, Clone, Copy)]
pub(super) struct OverrunBucket {
    fraction: f64,
    capacity: f64,
    level: f64,
}

impl OverrunBucket {
    /// An empty bucket that drains a `fraction` of all periods and holds so many missed ones.
    pub(super) const fn new(fraction: f64, capacity: f64) -> Self {
        Self { fraction, capacity, level: 0.0 }
    }

    pub(super) fn take(&mut self, missed: u64) {
        // A stall of days need not be counted exactly here, only not overflow.
        let missed = missed as f64;
        let change = missed - self.fraction * (missed + 1.0);
        self.level = (self.level + change).clamp(0.0, self.capacity);
    }

    pub(super) fn is_full(&self) -> bool {
        self.level >= self.capacity
    }

    /// True until a loop that overran has been punctual for about half a window.
    pub(super) fn is_half_full(&self) -> bool {
        self.level > 0.5 * self.capacity
    }
}

#[cfg(test)]
mod tests {
    use super::OverrunBucket;

    /// Limits of the shipped files at 1 kHz: half of all periods over 400 ms.
    fn bucket() -> OverrunBucket {
        OverrunBucket { fraction: 0.5, capacity: 200.0, level: 0.0 }
    }

    /// Runs `cycles` cycles that each miss `missed` periods; true when the bucket filled.
    fn fills(bucket: &mut OverrunBucket, cycles: u32, missed: u64) -> bool {
        (0..cycles).any(|_| {
            bucket.take(missed);
            bucket.is_full()
        })
    }

    #[test]
    fn pauses_of_50_ms_now_and_then_do_not_trip() {
        let mut bucket = bucket();
        for _ in 0..100 {
            assert!(!fills(&mut bucket, 1, 50));
            assert!(!fills(&mut bucket, 100, 0));
        }
    }

    #[test]
    fn a_loop_that_misses_a_third_for_ever_does_not_trip() {
        let mut bucket = bucket();
        for _ in 0..10_000 {
            assert!(!fills(&mut bucket, 1, 1));
            assert!(!fills(&mut bucket, 1, 0));
        }
    }

    #[test]
    fn a_loop_that_misses_nine_of_ten_trips_within_half_a_second() {
        // 10 periods a cycle, so that 50 cycles are half a second.
        assert!(fills(&mut bucket(), 50, 9));
    }

    #[test]
    fn a_stall_as_long_as_the_window_trips_at_once() {
        assert!(fills(&mut bucket(), 1, 402));
        assert!(!fills(&mut bucket(), 1, 390));
    }
}
