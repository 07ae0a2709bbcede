//! The last records in one piece of memory, allocated and touched once.

/// The newest `capacity` records of equal size.
#[derive(Debug)]
pub struct Ring {
    bytes: Vec<u8>,
    record_bytes: usize,
    capacity: usize,
    /// Where the next record goes.
    next: usize,
    count: usize,
}

impl Ring {
    /// An empty ring, its memory touched; `None` when the system has not that much.
    pub fn new(record_bytes: usize, capacity: usize) -> Option<Self> {
        let size = record_bytes.checked_mul(capacity)?;
        let mut bytes = Vec::new();
        bytes.try_reserve_exact(size).ok()?;
        // Written, not merely reserved: no page is missing when the first records come.
        bytes.resize(size, u8::MAX);
        Some(Self { bytes, record_bytes, capacity, next: 0, count: 0 })
    }

    /// Memory, bytes.
    pub fn size(&self) -> usize {
        self.bytes.len()
    }

    /// Records kept.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Room for one more record, in place of the oldest when there is none; the caller fills it.
    pub fn push(&mut self) -> &mut [u8] {
        let at = self.next * self.record_bytes;
        self.next = if self.next + 1 >= self.capacity { 0 } else { self.next + 1 };
        self.count = (self.count + 1).min(self.capacity);
        &mut self.bytes[at..at + self.record_bytes]
    }

    /// Every record, the oldest first.
    pub fn records(&self) -> impl Iterator<Item = &[u8]> {
        let first = if self.count < self.capacity { 0 } else { self.next };
        let (newer, older) = self.bytes[..self.count * self.record_bytes].split_at(first * self.record_bytes);
        let whole = self.record_bytes.max(1);
        older.chunks_exact(whole).chain(newer.chunks_exact(whole))
    }

    /// Forgets every record.
    pub fn clear(&mut self) {
        (self.next, self.count) = (0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::Ring;

    fn push(ring: &mut Ring, value: u32) {
        ring.push().copy_from_slice(&value.to_le_bytes());
    }

    fn values(ring: &Ring) -> Vec<u32> {
        ring.records().map(|record| u32::from_le_bytes(record.try_into().expect("four bytes"))).collect()
    }

    /// Goal: over several wraps, at every count, the newest are kept, in order.
    #[test]
    fn a_ring_keeps_the_newest_in_their_order_however_often_it_wraps() {
        for capacity in [1, 2, 7] {
            let mut ring = Ring::new(4, capacity).expect("a few bytes");
            for pushed in 0..5 * capacity as u32 {
                push(&mut ring, pushed);
                let first = (pushed + 1).saturating_sub(capacity as u32);
                assert_eq!(values(&ring), (first..=pushed).collect::<Vec<_>>());
                assert_eq!(ring.count(), values(&ring).len());
            }
        }
    }

    #[test]
    fn a_cleared_ring_begins_anew_in_the_same_memory() {
        let mut ring = Ring::new(4, 3).expect("a few bytes");
        (0..5).for_each(|value| push(&mut ring, value));
        ring.clear();
        assert_eq!((values(&ring), ring.size()), (vec![], 12));
        push(&mut ring, 9);
        assert_eq!(values(&ring), [9]);
    }

    #[test]
    fn more_memory_than_there_is_gives_none() {
        assert!(Ring::new(usize::MAX, 2).is_none());
        assert!(Ring::new(1 << 40, 1 << 20).is_none());
    }
}
