//! The two halves of a topic: newest value in, value out.
//!
//! A connection between two ports can fail to form when one side looks while the other is half-way through making it
//! (or belongs to another user). The transport tries again only when ports come or go; here the port is made anew,
//! at growing intervals, which makes both sides try.

use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use iceoryx2::port::DegradationAction;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{BackpressureStrategy, IceoryxSend, PortFactory, ZeroCopySend, ipc};

use super::error::ChannelError;
use super::service::{Topic, retried};
use crate::hardware::WriteError;
use crate::message::{CoilCommand, CoilFeedback, Header, PoseMessage};
use crate::operator::StatusMessage;
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

/// When a port with a failed connection may be made anew.
#[derive(Debug)]
struct Repair {
    failed: Arc<AtomicBool>,
    pause: Duration,
    not_before: Stamp,
}

impl Repair {
    const PAUSE_MIN: Duration = Duration::from_millis(20);
    const PAUSE_MAX: Duration = Duration::from_secs(5);

    fn new() -> Self {
        Self {
            failed: Arc::new(AtomicBool::new(false)),
            pause: Self::PAUSE_MIN,
            not_before: Stamp::default(),
        }
    }

    /// True when the port is to be made anew now.
    fn is_due(&mut self, now: Stamp) -> bool {
        if !self.failed.load(Ordering::Relaxed) || now < self.not_before {
            return false;
        }
        self.failed.store(false, Ordering::Relaxed);
        let was_sound_for = now.since(self.not_before);
        self.pause = if was_sound_for > Self::PAUSE_MAX { Self::PAUSE_MIN } else { self.pause };
        self.not_before = now.after(self.pause);
        self.pause = (self.pause * 2).min(Self::PAUSE_MAX);
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
                Err(_) => self.repair.failed.store(true, Ordering::Relaxed),
            }
        }
        // Bounded, should a sender be faster than this loop.
        for _ in 0..2 * self.buffer + 2 {
            match self.subscriber.receive() {
                Ok(Some(sample)) => {
                    let copy = *sample;
                    drop(sample);
                    take(&copy);
                }
                Ok(None) => return Ok(()),
                Err(_) => {
                    self.repair.failed.store(true, Ordering::Relaxed);
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
    pub(super) fn new(topic: Topic<T>) -> Result<Self, ChannelError> {
        let repair = Repair::new();
        let name = topic.name().to_string();
        let publisher = retried(&name, || {
            // The place of the only publisher may still be taken by one that was killed.
            let _ = topic.try_cleanup_dead_nodes();
            publisher(&topic, &repair)
        })?;
        Ok(Self { topic, publisher: Some(publisher), repair })
    }

    /// Hands `message` to every subscriber; the one allocation of a sent message is the transport's.
    pub(super) fn send(&mut self, message: T, now: Stamp) -> Result<(), WriteError> {
        if self.repair.is_due(now) {
            // The former one must go first: the topic may allow a single publisher.
            self.publisher = None;
            self.publisher = publisher(&self.topic, &self.repair).ok();
            if self.publisher.is_none() {
                self.repair.failed.store(true, Ordering::Relaxed);
            }
        }
        let Some(publisher) = &self.publisher else {
            return Err(WriteError::Transport);
        };
        publisher.send_copy(message).map(|_| ()).map_err(|_| {
            self.repair.failed.store(true, Ordering::Relaxed);
            WriteError::Transport
        })
    }
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
