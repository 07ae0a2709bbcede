//! A far side of ideal hardware: amplifiers of first order with a watchdog of their own, frames that go
//! where they are told, a straight rod.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::binding::RigSheet;
use crate::description::HardwareDescription;
use crate::message::{Actuation, COILS_MAX, MAGNETS_MAX, MagnetPose};
use crate::send::count;
use crate::time::Stamp;

use super::protocol::{Answer, DATAGRAM_MAX, Poses, Request, device_state, kind};

/// How the device behaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedConfig {
    /// Of the amplifiers' current control.
    pub time_constant: Duration,
    /// Between two poses.
    pub pose_period: Duration,
}

/// A device behind a UDP socket.
#[derive(Debug)]
pub struct SimulatedDevice {
    socket: UdpSocket,
    config: SimulatedConfig,
    coils: usize,
    frames: usize,
    slew: Vec<f64>,
    magnets: [MagnetPose; MAGNETS_MAX],
    magnet_count: u32,
    /// Set points as the watchdog leaves them.
    wanted: Actuation,
    measured: Actuation,
    sequence: u64,
    state: u32,
    deadline: Stamp,
    stepped: Stamp,
    pose_due: Stamp,
    pose_sequence: u64,
    driver: Option<SocketAddr>,
}

impl SimulatedDevice {
    /// Listens at `address`; port 0 takes any free one.
    ///
    /// # Errors
    /// When the address cannot be had.
    pub fn bind(
        description: &HardwareDescription,
        address: SocketAddr,
        config: SimulatedConfig,
    ) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_read_timeout(Some(Duration::from_millis(1)))?;
        let mut magnets = [MagnetPose::default(); MAGNETS_MAX];
        for (pose, sheet) in magnets.iter_mut().zip(RigSheet::of(description).magnets) {
            pose.position_m = sheet.position_m;
            pose.orientation_xyzw = sheet.orientation_xyzw;
            pose.valid = 1;
        }
        let now = Stamp::now();
        Ok(Self {
            socket,
            config,
            coils: description.coils.len(),
            frames: description.frames.len(),
            slew: description.coils.iter().map(|coil| coil.slew_max).collect(),
            magnets,
            magnet_count: count(description.magnets().count(), MAGNETS_MAX),
            wanted: Actuation::default(),
            measured: Actuation::default(),
            sequence: 0,
            state: device_state::EXPIRED,
            deadline: now,
            stepped: now,
            pose_due: now,
            pose_sequence: 0,
            driver: None,
        })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Measured currents, A.
    #[must_use]
    pub const fn currents(&self) -> &[f64; COILS_MAX] {
        &self.measured.current_a
    }

    /// Serves until `stop` is set.
    pub fn serve(&mut self, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            self.serve_once();
        }
    }

    /// Waits a millisecond for a request, answers it, lets time pass.
    pub fn serve_once(&mut self) {
        let mut bytes = [0; DATAGRAM_MAX + 1];
        let received = self.socket.recv_from(&mut bytes);
        let now = Stamp::now();
        self.step(now);
        if let Ok((length, from)) = received
            && let Ok(request) = Request::decode(&bytes[..length], self.coils, self.frames)
        {
            self.take(&request, from, now);
        }
        self.publish_poses(now);
    }

    fn take(&mut self, request: &Request, from: SocketAddr, now: Stamp) {
        let values = request.actuation.current_a.iter().chain(&request.actuation.angle_rad);
        // A former one that was under way, or nonsense: not answered.
        if request.sequence <= self.sequence || !values.into_iter().all(|value| value.is_finite()) {
            return;
        }
        self.sequence = request.sequence;
        self.driver = Some(from);
        if request.kind == kind::FOLLOW {
            self.wanted = request.actuation;
            self.state = device_state::FOLLOWING;
            self.deadline = now.after(Duration::from_micros(u64::from(request.validity_us)));
        } else {
            self.wanted.current_a = [0.0; COILS_MAX];
            self.measured.current_a = [0.0; COILS_MAX];
            self.state = device_state::CUT;
        }
        let answer =
            Answer { sequence: request.sequence, state: self.state, fault: 0, actuation: self.measured };
        // A driver that went away is not told.
        let _ = self.socket.send_to(&answer.encode(self.coils, self.frames), from);
    }

    /// Lets time pass up to `now`: the watchdog ramps set points down, currents follow with a lag.
    fn step(&mut self, now: Stamp) {
        let period = now.since(self.stepped).as_secs_f64();
        self.stepped = now;
        if self.state == device_state::FOLLOWING && now >= self.deadline {
            self.state = device_state::EXPIRED;
        }
        if self.state == device_state::EXPIRED {
            for (wanted, slew) in self.wanted.current_a.iter_mut().zip(&self.slew) {
                *wanted -= wanted.clamp(-slew * period, slew * period);
            }
        }
        let share = 1.0 - (-period / self.config.time_constant.as_secs_f64()).exp();
        for (measured, wanted) in self.measured.current_a.iter_mut().zip(&self.wanted.current_a) {
            *measured += share * (wanted - *measured);
        }
        self.measured.angle_rad = self.wanted.angle_rad;
    }

    fn publish_poses(&mut self, now: Stamp) {
        let Some(driver) = self.driver else { return };
        if now < self.pose_due {
            return;
        }
        self.pose_due = now.after(self.config.pose_period);
        self.pose_sequence += 1;
        let poses = Poses {
            sequence: self.pose_sequence,
            age_us: 0,
            magnet_count: self.magnet_count,
            magnets: self.magnets,
        };
        // As above.
        let _ = self.socket.send_to(&poses.encode(), driver);
    }
}
