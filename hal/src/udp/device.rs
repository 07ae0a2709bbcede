//! The driver's side of the UDP protocol, as a [`Device`].

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use crate::description::HardwareDescription;
use crate::driver::{Device, Measurement};
use crate::message::{Actuation, PoseMessage};
use crate::time::Stamp;

use super::protocol::{Answer, DATAGRAM_MAX, Poses, Request, device_state, kind};

/// Datagrams taken in one cycle: a far side that floods must not hold the loop.
const DATAGRAMS_MAX: usize = 64;
/// An answer that took longer says nothing of the present: the next one is under way.
const ANSWER_AGE_MAX: Duration = Duration::from_millis(50);
/// Reported when the device went to zero by itself though requests were sent: it did not get them in time.
const FAULT_EXPIRED: u32 = 0x8000_0001;

/// Amplifiers, motors and tracker behind one UDP socket. Nothing here waits.
#[derive(Debug)]
pub struct UdpDevice {
    socket: UdpSocket,
    coils: usize,
    frames: usize,
    magnets: usize,
    validity_us: u32,
    /// Rises over restarts: it starts at the monotonic clock.
    sequence: u64,
    /// When the newest requests were sent, for the stamps of their answers.
    sent: [(u64, Stamp); 16],
    answered: u64,
    pose_sequence: u64,
    measurement: Option<Measurement>,
    poses: Option<PoseMessage>,
    /// True while the newest set points let current flow.
    carries_current: bool,
    malformed: u64,
}

impl UdpDevice {
    /// Speaks with the device at `address` from a port of the system's choice. Without a request for
    /// `validity` the
    /// device goes to zero by itself.
    ///
    /// # Errors
    /// When no socket can be had.
    pub fn connect(
        description: &HardwareDescription,
        address: SocketAddr,
        validity: Duration,
    ) -> io::Result<Self> {
        let local: SocketAddr =
            if address.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0_u16; 8], 0).into() };
        let socket = UdpSocket::bind(local)?;
        // Datagrams from elsewhere are dropped by the kernel from now on.
        socket.connect(address)?;
        socket.set_nonblocking(true)?;
        let mut device = Self {
            socket,
            coils: description.coils.len(),
            frames: description.frames.len(),
            magnets: description.magnets().count(),
            validity_us: u32::try_from(validity.as_micros()).unwrap_or(u32::MAX),
            sequence: Stamp::now().nanoseconds(),
            sent: [(0, Stamp::default()); 16],
            answered: 0,
            pose_sequence: 0,
            measurement: None,
            poses: None,
            carries_current: false,
            malformed: 0,
        };
        // Asks where the frames stand. Its set points are not looked at.
        device.request(kind::CUT, &Actuation::default());
        Ok(device)
    }

    /// Datagrams that were none of this protocol.
    #[must_use]
    pub const fn malformed(&self) -> u64 {
        self.malformed
    }

    fn request(&mut self, kind: u32, actuation: &Actuation) {
        self.sequence += 1;
        let request =
            Request { sequence: self.sequence, kind, validity_us: self.validity_us, actuation: *actuation };
        self.sent[usize::try_from(self.sequence % 16).unwrap_or(0)] = (self.sequence, Stamp::now());
        // One that is lost is followed by the next; a device that gets none goes to zero.
        let _ = self.socket.send(&request.encode(self.coils, self.frames));
    }

    fn receive(&mut self) {
        let mut bytes = [0; DATAGRAM_MAX + 1];
        for _ in 0..DATAGRAMS_MAX {
            let received = match self.socket.recv(&mut bytes) {
                Ok(length) => &bytes[..length],
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return,
                // A device that is not there yet: the system tells of a refused datagram, once each.
                Err(_) => continue,
            };
            if let Ok(answer) = Answer::decode(received, self.coils, self.frames) {
                self.take_answer(&answer);
            } else if let Ok(poses) = Poses::decode(received, self.magnets) {
                self.take_poses(&poses);
            } else {
                self.malformed += 1;
            }
        }
    }

    fn take_answer(&mut self, answer: &Answer) {
        let (sequence, sent) = self.sent[usize::try_from(answer.sequence % 16).unwrap_or(0)];
        // Late, twice, or to a former driver.
        if sequence != answer.sequence || answer.sequence <= self.answered {
            return;
        }
        self.answered = answer.sequence;
        if Stamp::now().since(sent) > ANSWER_AGE_MAX {
            return;
        }
        let expired = answer.state == device_state::EXPIRED && self.carries_current;
        let fault = if answer.fault == 0 && expired { FAULT_EXPIRED } else { answer.fault };
        // It measured after the request was sent; so the stamp is never too young.
        self.measurement = Some(Measurement { stamp: sent, actuation: answer.actuation, fault });
    }

    fn take_poses(&mut self, poses: &Poses) {
        // A device that starts anew counts from the begin.
        if poses.sequence == self.pose_sequence {
            return;
        }
        self.pose_sequence = poses.sequence;
        let exposed = Stamp::now().before(Duration::from_micros(u64::from(poses.age_us)));
        let mut message = PoseMessage {
            magnet_count: poses.magnet_count,
            magnets: poses.magnets,
            ..PoseMessage::default()
        };
        message.header.source_stamp_ns = exposed.nanoseconds();
        self.poses = Some(message);
    }
}

impl Device for UdpDevice {
    fn follow(&mut self, setpoint: &Actuation, _period_s: f64) {
        self.carries_current = setpoint.current_a.iter().any(|current| *current != 0.0);
        self.request(kind::FOLLOW, setpoint);
    }

    fn cut(&mut self) {
        self.carries_current = false;
        self.request(kind::CUT, &Actuation::default());
    }

    fn measure(&mut self) -> Option<Measurement> {
        self.receive();
        if self.answered == 0 {
            // Nobody answered yet: ask again.
            self.request(kind::CUT, &Actuation::default());
        }
        self.measurement.take()
    }

    fn poses(&mut self) -> Option<PoseMessage> {
        self.poses.take()
    }
}
