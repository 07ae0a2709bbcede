//! The daemon's cycles as a stream that anyone may record or watch.

use std::time::Duration;

use super::endpoint::Endpoint;
use super::error::{ChannelError, Role};
use super::membership::Membership;
use super::ports::{Inlet, Outlet};
use super::service::{RECORD, Topic, Wait, open_topic};
use super::tunnel::is_distant;
use crate::hardware::WriteError;
use crate::record::RecordBatch;
use crate::send::HeaderWriter;
use crate::time::Stamp;

/// Nobody here is a control loop: it may wait for a connection to form.
const CONNECTION_WAIT: Duration = Duration::from_millis(100);

/// Publishes cycles. Part of the end that serves operators.
#[derive(Debug)]
pub(super) struct RecordOutlet {
    outlet: Outlet<RecordBatch>,
    header: HeaderWriter,
}

impl RecordOutlet {
    /// Joins the topic; `epoch` is the daemon's life.
    pub(super) fn new(topic: Topic<RecordBatch>, epoch: u64) -> Result<Self, ChannelError> {
        Ok(Self { outlet: Outlet::new(topic)?, header: HeaderWriter::new(epoch) })
    }

    pub(super) fn publish(&mut self, batch: &mut RecordBatch, now: Stamp) -> Result<(), WriteError> {
        self.header.write(&mut batch.header, now);
        self.outlet.send(*batch, now)
    }
}

/// What an observer missed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordLoss {
    /// Batches that were published and not received.
    pub batches: u64,
    /// Times that the daemon began anew: its cycles are another run's.
    pub restarts: u64,
}

/// Receives the daemon's cycles. Belongs to the thread that made it. A slow one loses the oldest batches and
/// counts them; it never makes the daemon wait.
#[derive(Debug)]
pub struct RecordObserver {
    inlet: Inlet<RecordBatch>,
    last: Option<(u64, u64)>,
    loss: RecordLoss,
    is_distant: bool,
    _membership: Membership,
}

impl RecordObserver {
    /// Finds the rig's daemon, for which it waits up to `wait`. Batches published from now on are received.
    ///
    /// # Errors
    /// When no daemon appears in time, or the transport fails.
    pub fn open(endpoint: &Endpoint, wait: Duration) -> Result<Self, ChannelError> {
        let membership = endpoint.join(CONNECTION_WAIT)?;
        let topic = open_topic(&membership.node, endpoint, RECORD, Role::Daemon, &Wait::new(wait))?;
        let inlet = Inlet::new(topic, RECORD.buffer)?;
        let is_distant = is_distant(endpoint);
        Ok(Self { inlet, last: None, loss: RecordLoss::default(), is_distant, _membership: membership })
    }

    /// Hands over every batch that arrived since the former call, oldest first, up to a queue of 128.
    pub fn drain(&mut self, now: Stamp, mut take: impl FnMut(&RecordBatch)) {
        let Self { inlet, last, loss, .. } = self;
        // What cannot be received is not new; what is lost by it shows in the next sequence.
        let _ = inlet.drain(now, |batch| {
            let (epoch, sequence) = (batch.header.epoch, batch.header.sequence);
            match *last {
                Some((same, before)) if same == epoch => {
                    loss.batches += sequence.saturating_sub(before).saturating_sub(1);
                }
                Some(_) => loss.restarts += 1,
                None => {}
            }
            *last = Some((epoch, sequence));
            take(batch);
        });
    }

    /// True when the rig is on another machine and reaches this one through a tunnel: stamps in its cycles are
    /// those of that machine's clock.
    #[must_use]
    pub fn is_distant(&self) -> bool {
        self.is_distant
    }

    /// What was missed so far.
    #[must_use]
    pub fn loss(&self) -> RecordLoss {
        self.loss
    }
}
