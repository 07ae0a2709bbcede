//! How deep idle CPUs may sleep: a request to the kernel that holds for as long as its file stays open.

use std::fs::File;
use std::io::{self, Read, Seek, Write};

use super::realtime::RealtimeItem;

/// Where the kernel takes bounds on the time to wake; pm_qos_interface in its documentation.
const IDLE_DEVICE: &str = "/dev/cpu_dma_latency";

/// A bound on how long any CPU may take to wake, for as long as this lives: the kernel then keeps idle CPUs
/// out of states that take longer to leave.
#[derive(Debug)]
pub struct IdleBound {
    _device: Option<File>,
    /// What was asked for, and what holds.
    pub item: RealtimeItem,
}

impl IdleBound {
    /// Asks for a bound in microseconds and reads back the one in force, which is the least that anybody
    /// asked for.
    #[must_use]
    pub fn hold(latency_us: u32) -> Self {
        let (device, held) = match Self::ask(latency_us) {
            Ok((device, held)) => (Some(device), Ok(held)),
            Err(error) => (None, Err(error)),
        };
        let granted = held.as_ref().is_ok_and(|held| (0..=i64::from(latency_us)).contains(&i64::from(*held)));
        let got = held.as_ref().map_or_else(|_| "left to the kernel".to_owned(), |held| format!("{held} us"));
        let mend = format!("sudo chgrp $(id -gn) {IDLE_DEVICE} && sudo chmod g+rw {IDLE_DEVICE}");
        let wanted = format!("{latency_us} us");
        Self {
            _device: device,
            item: RealtimeItem::new("idle latency", wanted, got, granted, held.err(), &mend),
        }
    }

    fn ask(latency_us: u32) -> io::Result<(File, i32)> {
        let mut device = File::options().read(true).write(true).open(IDLE_DEVICE)?;
        let bound = i32::try_from(latency_us).unwrap_or(i32::MAX);
        device.write_all(&bound.to_ne_bytes())?;
        let mut held = [0; 4];
        device.rewind()?;
        device.read_exact(&mut held)?;
        Ok((device, i32::from_ne_bytes(held)))
    }
}

#[cfg(test)]
mod tests {
    use super::IdleBound;

    /// Goal: whatever the rights of the user who runs this test, the item says whether the bound holds.
    #[test]
    fn a_bound_on_idling_is_held_or_refused_with_what_mends_it() {
        let bound = IdleBound::hold(10_000);
        assert_eq!(bound.item.wanted, "10000 us");
        assert_eq!(bound.item.granted, bound.item.why_not.is_none(), "{:?}", bound.item);
        assert_eq!(bound.item.granted, bound.item.got != "left to the kernel", "{:?}", bound.item);
    }
}
