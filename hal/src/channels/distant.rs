//! Stamps of a rig on another machine, told by this machine's clock.
//!
//! **Problem.** A message's stamps count on the monotonic clock of the machine that made it. That of another
//! machine began at another moment, and runs a little faster or slower: an age taken across the two says
//! nothing.
//!
//! **Method.** A message arrives here later than it was published there, by the way between them and by
//! whatever held it up. The least difference between arrival here and publication there is the clocks' offset
//! and the shortest way. Stamps are moved by it: an age is then what came on top of the shortest way, and a
//! message that was held up shows it. So that clocks which drift apart do not add up to an age, the offset
//! may grow again, at [`DRIFT_MAX`]. After a new start of the publisher, perhaps of its machine, it is found
//! anew.

use crate::message::Header;
use crate::time::Stamp;

/// The most by which a clock runs faster than another: 1 part in this; ten times what crystals differ by.
const DRIFT_MAX: i128 = 1_000;

/// What is known of another machine's clock.
#[derive(Debug, Default)]
pub(super) struct DistantClock {
    known: Option<Known>,
}

#[derive(Debug, Clone, Copy)]
struct Known {
    /// The publisher's life.
    epoch: u64,
    /// To be added to a stamp, ns.
    offset: i128,
    /// Arrival of the newest message, ns of this machine's clock.
    heard: i128,
}

impl DistantClock {
    /// Moves the stamps of a message that arrived at `now` to this machine's clock; none comes to lie in the
    /// future.
    pub(super) fn localise(&mut self, header: &mut Header, now: Stamp) {
        let arrival = i128::from(now.nanoseconds());
        let measured = arrival - i128::from(header.publish_stamp_ns);
        let offset = match self.known.filter(|known| known.epoch == header.epoch) {
            Some(known) => measured.min(known.offset + (arrival - known.heard).max(0) / DRIFT_MAX),
            None => measured,
        };
        self.known = Some(Known { epoch: header.epoch, offset, heard: arrival });
        for stamp in [&mut header.source_stamp_ns, &mut header.publish_stamp_ns, &mut header.valid_until_ns] {
            // Zero is no stamp.
            if *stamp != 0 {
                let moved = (i128::from(*stamp) + offset).clamp(0, i128::from(u64::MAX));
                *stamp = u64::try_from(moved).unwrap_or(u64::MAX);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{DistantClock, Header, Stamp};

    const MS: u64 = 1_000_000;

    fn header(epoch: u64, published: u64) -> Header {
        Header { epoch, source_stamp_ns: published - MS, publish_stamp_ns: published, ..Header::default() }
    }

    /// Age in nanoseconds that a message has here, published and arrived at these moments of the two clocks.
    fn age(clock: &mut DistantClock, epoch: u64, published: u64, arrived: u64) -> u64 {
        let mut header = header(epoch, published);
        clock.localise(&mut header, Stamp::from_nanoseconds(arrived));
        assert_eq!(header.publish_stamp_ns - header.source_stamp_ns, MS, "both move alike");
        assert!(header.publish_stamp_ns <= arrived, "not from the future");
        assert_eq!(header.valid_until_ns, 0, "zero is no stamp");
        arrived - header.publish_stamp_ns
    }

    /// Goal: whether the other machine was started long before this one or after it.
    #[test]
    fn age_is_what_came_on_top_of_the_shortest_way() {
        for (there, here) in [(3_600_000 * MS, 50 * MS), (50 * MS, 3_600_000 * MS)] {
            let mut clock = DistantClock::default();
            assert_eq!(age(&mut clock, 1, there, here + 9 * MS), 0, "the first is taken as it comes");
            assert_eq!(age(&mut clock, 1, there + 20 * MS, here + 24 * MS), 0, "a shorter way");
            let held_up = age(&mut clock, 1, there + 40 * MS, here + 744 * MS);
            assert!((699 * MS..=700 * MS).contains(&held_up), "{held_up} ns");
        }
    }

    /// Goal: a viewer may stay for days.
    #[test]
    fn clocks_that_drift_apart_by_one_in_ten_thousand_do_not_add_up_to_an_age() {
        for faster in [false, true] {
            let mut clock = DistantClock::default();
            let oldest = (0..100_000).map(|message: u64| {
                let there = 1_000 * MS + message * 20 * MS;
                let drift = message * 20 * MS / 10_000;
                let here = 9_000 * MS + message * 20 * MS;
                age(&mut clock, 1, there, if faster { here + drift } else { here - drift })
            });
            assert_eq!(oldest.max(), Some(0), "faster: {faster}");
        }
    }

    #[test]
    fn publisher_that_begins_anew_is_measured_anew() {
        let mut clock = DistantClock::default();
        assert_eq!(age(&mut clock, 1, 3_600_000 * MS, 100 * MS), 0);
        // Its machine was started anew: its clock stands near zero.
        assert_eq!(age(&mut clock, 2, 5_000 * MS, 20_000 * MS), 0);
        assert_eq!(age(&mut clock, 2, 5_020 * MS, 20_020 * MS), 0);
    }
}
