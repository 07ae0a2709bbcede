//! The two halves of a topic: newest value in, value out.
//!
//! A connection between two ports can fail to form when one side looks while the other is half-way through making it
//! (or belongs to another user). The transport tries again only when ports come or go; here the port is made anew,
//! at growing intervals, which makes both sides try.

use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use iceoryx2::node::{NodeListFailure, NodeView};
use iceoryx2::port::DegradationAction;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    BackpressureStrategy, CallbackProgression, IceoryxSend, Node, NodeState, PortFactory, ZeroCopySend, ipc,
};

use super::error::ChannelError;
use super::service::{Topic, retried};
use crate::hardware::WriteError;
use crate::message::{CoilCommand, CoilFeedback, Header, PoseMessage};
use crate::operator::StatusMessage;
use crate::record::RecordBatch;
use crate::time::Stamp;

/// What every message on a topic has.
pub(super) trait Message: IceoryxSend + ZeroCopySend + Debug + Copy + 'static {
    fn header(&self) -> &Header;
}

impl Message for PoseMessage {
    fn header(&self) -> &Header {
        &self.header
    }
}

impl Message for CoilFeedback {
    fn header(&self) -> &Header {
        &self.header
    }
}

impl Message for CoilCommand {
    fn header(&self) -> &Header {
        &self.header
    }
}

impl Message for StatusMessage {
    fn header(&self) -> &Header {
        &self.header
    }
}

impl Message for RecordBatch {
    fn header(&self) -> &Header {
        &self.header
    }
}

/// When a port with a failed connection may be made anew: in series of growing pauses, since one that keeps failing is
/// to a dead process whose place nobody cleared. The next failure after a quiet time starts a new series; so does the
/// quiet time itself while nothing passes the port, because the failure that ended a series may have been the other
/// side's that everybody waits for.
#[derive(Debug)]
struct Repair {
    failed: Arc<AtomicBool>,
    attempts: u32,
    not_before: Stamp,
    /// True from a failure that found a series at its end until something passes.
    gave_up: bool,
}

impl Repair {
    const PAUSE_MIN: Duration = Duration::from_millis(20);
    /// The last pause is 2.56 s.
    const ATTEMPTS_MAX: u32 = 8;
    const QUIET: Duration = Duration::from_secs(5);

    fn new() -> Self {
        let failed = Arc::new(AtomicBool::new(false));
        Self { failed, attempts: 0, not_before: Stamp::default(), gave_up: false }
    }

    fn note_failure(&self) {
        self.failed.store(true, Ordering::Relaxed);
    }

    /// A message came or went: whoever is to be reached is.
    fn note_passage(&mut self) {
        self.gave_up = false;
    }

    /// True when the port is to be made anew now.
    fn is_due(&mut self, now: Stamp) -> bool {
        let is_quiet = now.since(self.not_before) > Self::QUIET;
        let failed = self.failed.load(Ordering::Relaxed);
        if now < self.not_before || !(failed || self.gave_up && is_quiet) {
            return false;
        }
        self.failed.store(false, Ordering::Relaxed);
        if is_quiet {
            self.attempts = 0;
        }
        self.gave_up = self.attempts >= Self::ATTEMPTS_MAX;
        if self.gave_up {
            return false;
        }
        self.not_before = now.after(Self::PAUSE_MIN * 2_u32.pow(self.attempts));
        self.attempts += 1;
        true
    }
}

/// Takes messages from a topic. Belongs to the thread that made it.
#[derive(Debug)]
pub(super) struct Inlet<T: Message> {
    topic: Topic<T>,
    subscriber: Subscriber<ipc::Service, T, ()>,
    buffer: usize,
    repair: Repair,
}

impl<T: Message> Inlet<T> {
    /// Joins `topic` with a queue of `buffer` messages, without those sent before.
    pub(super) fn new(topic: Topic<T>, buffer: usize) -> Result<Self, ChannelError> {
        let repair = Repair::new();
        let name = topic.name().to_string();
        let subscriber = retried(&name, || subscriber(&topic, buffer, &repair))?;
        Ok(Self { topic, subscriber, buffer, repair })
    }

    /// The message published last among those that arrived since the former call.
    pub(super) fn newest(&mut self, now: Stamp) -> Result<Option<T>, ()> {
        let mut newest: Option<T> = None;
        let result = self.drain(now, |message| {
            let stamp = message.header().publish_stamp_ns;
            // A leftover of a dead sender may come after its follower's first.
            if newest.as_ref().is_none_or(|newest| stamp >= newest.header().publish_stamp_ns) {
                newest = Some(*message);
            }
        });
        if newest.is_some() { Ok(newest) } else { result.map(|()| None) }
    }

    /// Hands over every message that arrived since the former call, oldest first.
    pub(super) fn drain(&mut self, now: Stamp, mut take: impl FnMut(&T)) -> Result<(), ()> {
        if self.repair.is_due(now) {
            // Where making it fails the old one stays, and the failure is noted for the next time.
            match subscriber(&self.topic, self.buffer, &self.repair) {
                Ok(subscriber) => self.subscriber = subscriber,
                Err(_) => self.repair.note_failure(),
            }
        }
        // Bounded, should a sender be faster than this loop.
        for _ in 0..2 * self.buffer + 2 {
            match self.subscriber.receive() {
                Ok(Some(sample)) => {
                    let copy = *sample;
                    drop(sample);
                    self.repair.note_passage();
                    take(&copy);
                }
                Ok(None) => return Ok(()),
                Err(_) => {
                    self.repair.note_failure();
                    return Err(());
                }
            }
        }
        Ok(())
    }
}

/// Sends messages into a topic. Belongs to the thread that made it.
#[derive(Debug)]
pub(super) struct Outlet<T: Message> {
    topic: Topic<T>,
    publisher: Option<Publisher<ipc::Service, T, ()>>,
    repair: Repair,
}

impl<T: Message> Outlet<T> {
    /// Joins `topic`, of which `node` must be the only living publisher.
    pub(super) fn sole(topic: Topic<T>, node: &Node<ipc::Service>) -> Result<Self, ChannelError> {
        let outlet = Self::new(topic)?;
        let service = outlet.topic.name().to_string();
        let rival = retried(&service, || rival_publisher(&outlet.topic, node))?;
        match rival {
            Some(pid) => Err(ChannelError::Rival { service, pid }),
            None => Ok(outlet),
        }
    }

    /// Joins `topic`.
    pub(super) fn new(topic: Topic<T>) -> Result<Self, ChannelError> {
        let repair = Repair::new();
        let name = topic.name().to_string();
        let publisher = retried(&name, || {
            // Places may still be taken by processes that were killed.
            let _ = topic.try_cleanup_dead_nodes();
            publisher(&topic, &repair)
        })?;
        Ok(Self { topic, publisher: Some(publisher), repair })
    }

    /// Hands `message` to every subscriber; the one allocation of a sent message is the transport's.
    pub(super) fn send(&mut self, message: T, now: Stamp) -> Result<(), WriteError> {
        if self.repair.is_due(now) {
            // The former one goes first: a topic has a single publisher.
            self.publisher = None;
            self.publisher = publisher(&self.topic, &self.repair).ok();
            if self.publisher.is_none() {
                self.repair.note_failure();
            }
        }
        let Some(publisher) = &self.publisher else {
            return Err(WriteError::Transport);
        };
        match publisher.send_copy(message) {
            Ok(0) => Ok(()),
            Ok(_) => {
                self.repair.note_passage();
                Ok(())
            }
            Err(_) => {
                self.repair.note_failure();
                Err(WriteError::Transport)
            }
        }
    }
}

/// The living process other than `node`'s that publishes on `topic`, 0 when it has no number.
fn rival_publisher<T: Message>(
    topic: &Topic<T>,
    node: &Node<ipc::Service>,
) -> Result<Option<u32>, NodeListFailure> {
    let mut others = Vec::new();
    topic.dynamic_config().list_publishers(|publisher| {
        if publisher.node_id != *node.id() {
            others.push(publisher.node_id);
        }
        CallbackProgression::Continue
    });
    let mut rival = None;
    if !others.is_empty() {
        Node::<ipc::Service>::list(node.config(), |state| {
            if let NodeState::Alive(view) = state
                && others.contains(view.id())
            {
                let pid = view.details().as_ref().map(|details| details.process_id().value());
                rival = Some(pid.and_then(|pid| u32::try_from(pid).ok()).unwrap_or(0));
            }
            CallbackProgression::Continue
        })?;
    }
    Ok(rival)
}

fn subscriber<T: Message>(
    topic: &Topic<T>,
    buffer: usize,
    repair: &Repair,
) -> Result<Subscriber<ipc::Service, T, ()>, iceoryx2::port::subscriber::SubscriberCreateError> {
    let failed = Arc::clone(&repair.failed);
    topic
        .subscriber_builder()
        .buffer_size(buffer)
        .history_request(0)
        .set_degradation_handler(move |_, _| {
            failed.store(true, Ordering::Relaxed);
            DegradationAction::Ignore
        })
        .create()
}

fn publisher<T: Message>(
    topic: &Topic<T>,
    repair: &Repair,
) -> Result<Publisher<ipc::Service, T, ()>, iceoryx2::port::publisher::PublisherCreateError> {
    let failed = Arc::clone(&repair.failed);
    topic
        .publisher_builder()
        .max_loaned_samples(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .set_degradation_handler(move |_, _| {
            failed.store(true, Ordering::Relaxed);
            DegradationAction::Ignore
        })
        .create()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::membership::Membership;
    use super::super::service::{COMMAND, Topic, create_topic};
    use super::super::{DaemonServices, DriverEnd, Endpoint, PrivateRoot};
    use super::{ChannelError, Outlet, Repair};
    use crate::message::CoilCommand;
    use crate::scripted::example_description;
    use crate::time::Stamp;

    #[test]
    fn commander_that_holds_no_lock_is_noticed_and_named() {
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = Endpoint::new("example", Some(root.path())).expect("an endpoint");
        let _driver = DriverEnd::create(&endpoint).expect("a driver");
        let Membership { node, _sweeper } = endpoint.join(Duration::ZERO).expect("a node");
        let topic: Topic<CoilCommand> = create_topic(&node, &endpoint, COMMAND).expect("the topic");
        let rogue = Outlet::sole(topic, &node).expect("alone so far");
        let open = || DaemonServices::open(&endpoint, Duration::from_secs(5)).expect("a driver");
        let refused = open().into_ports(&example_description()).expect_err("a rival");
        let ChannelError::Rival { pid, .. } = refused else { panic!("{refused}") };
        assert_eq!(pid, std::process::id());
        drop((rogue, node));
        open().into_ports(&example_description()).expect("alone again");
    }

    /// Milliseconds at which a port is made anew when every new one fails too, while messages pass or none do.
    fn repairs(repair: &mut Repair, from: u64, to: u64, passing: bool) -> Vec<u64> {
        let at = |millisecond: u64| Stamp::from_nanoseconds(millisecond * 1_000_000);
        (from..to)
            .filter(|millisecond| {
                if passing {
                    repair.note_passage();
                }
                repair.is_due(at(*millisecond)) && {
                    repair.note_failure();
                    true
                }
            })
            .collect()
    }

    #[test]
    fn port_that_keeps_failing_while_others_are_heard_is_made_anew_in_series_that_end() {
        let mut repair = Repair::new();
        assert_eq!(repairs(&mut repair, 1000, 1100, true), [], "nothing failed");
        repair.note_failure();
        let series = [20_000, 20_020, 20_060, 20_140, 20_300, 20_620, 21_260, 22_540];
        assert_eq!(repairs(&mut repair, 20_000, 100_000, true), series);
        repair.note_failure();
        assert_eq!(
            repairs(&mut repair, 100_000, 100_050, true),
            [100_000, 100_020],
            "a new series after quiet"
        );
    }

    /// Goal: when the last failure of a series was the follower's of a killed process, it is reached all the same.
    #[test]
    fn port_that_nothing_passes_is_tried_again_after_quiet_until_something_does() {
        let mut repair = Repair::new();
        repair.note_failure();
        let made = repairs(&mut repair, 20_000, 31_000, false);
        assert_eq!(made[7..], [22_540, 30_101, 30_121, 30_161, 30_241, 30_401, 30_721]);
        // The next one connects, and messages pass.
        repair.note_passage();
        repair.failed.store(false, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(repairs(&mut repair, 31_000, 100_000, true), []);
    }
}
