//! Gathers cycles into batches and publishes them: the telemetry thread's end of every recording.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::channels::OperatorServer;
use magsteer_hal::record::{BATCH_CYCLES, RecordBatch};

use super::cycle_record::CycleRecord;
use super::wire::cycle_message;

/// A batch that is not full is published when its first cycle is older than this.
const AGE_MAX: Duration = Duration::from_millis(20);

/// Cycles on their way to whoever records them.
#[derive(Debug)]
pub(super) struct RecordFeed {
    batch: Box<RecordBatch>,
    /// When the batch began.
    since: Stamp,
}

impl RecordFeed {
    /// Nothing gathered yet; `config_digest` as [`RecordBatch::config_digest`].
    pub(super) fn new(config_digest: u64) -> Self {
        let batch = Box::new(RecordBatch { config_digest, ..RecordBatch::default() });
        Self { batch, since: Stamp::default() }
    }

    /// Takes over one cycle.
    pub(super) fn take(&mut self, record: &CycleRecord, server: &mut OperatorServer, now: Stamp) {
        if self.batch.count == 0 {
            self.since = now;
        }
        // A full batch was published, so there is room.
        if let Some(place) = self.batch.cycles.get_mut(self.batch.count as usize) {
            *place = cycle_message(record);
            self.batch.count += 1;
        }
        if self.batch.count as usize == BATCH_CYCLES {
            self.publish(server, now);
        }
    }

    /// Notes how many cycles never came here, and whether real time is missing.
    pub(super) fn note(&mut self, dropped: u64, realtime_missing: bool) {
        self.batch.dropped = dropped;
        self.batch.realtime_missing = realtime_missing.into();
    }

    /// Publishes what has waited long enough.
    pub(super) fn look(&mut self, server: &mut OperatorServer, now: Stamp) {
        if self.batch.count > 0 && now.since(self.since) >= AGE_MAX {
            self.publish(server, now);
        }
    }

    /// Publishes the rest and says that nothing follows.
    pub(super) fn end(&mut self, dropped: u64, server: &mut OperatorServer, now: Stamp) {
        self.batch.dropped = dropped;
        self.batch.is_last = 1;
        self.publish(server, now);
    }

    fn publish(&mut self, server: &mut OperatorServer, now: Stamp) {
        let batch = &mut self.batch;
        batch.header.source_stamp_ns = batch.used().first().map_or(0, |cycle| cycle.tick.now_ns);
        // What the transport refuses shows as a hole wherever it is received.
        let _ = server.publish_record(batch, now);
        batch.begin += u64::from(batch.count);
        batch.count = 0;
    }
}
