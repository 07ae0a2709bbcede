//! A driver with the real command guard and ideal amplifiers, in a thread of the test. Its magnets stand along z and never move.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use magsteer_hal::channels::{DriverEnd, Endpoint};
use magsteer_hal::{
    CoilFeedback, CommandGuard, HardwareDescription, MagnetPose, POSE_PARAMETERS_MAX, PoseMessage, Stamp,
};

/// Where it sees every magnet, m.
pub const POSITION_M: [f64; 3] = [0.001, -0.002, 0.003];

/// A driver in a thread of its own, until ended.
pub struct Driver {
    stop: Arc<AtomicBool>,
    state: Arc<AtomicU32>,
    thread: Option<JoinHandle<CommandGuard>>,
}

impl Driver {
    /// Starts on a rig of its own root.
    pub fn start(endpoint: &Endpoint, description: HardwareDescription) -> Self {
        let (stop, state) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
        let (endpoint, stop_inside, state_inside) = (endpoint.clone(), Arc::clone(&stop), Arc::clone(&state));
        let inside = move || drive(&endpoint, &description, &stop_inside, &state_inside);
        let thread = std::thread::spawn(inside);
        Self { stop, state, thread: Some(thread) }
    }

    /// One of [`magsteer_hal::message::driver_state`].
    pub fn state(&self) -> u32 {
        self.state.load(Ordering::Relaxed)
    }

    /// Stops it, without a ramp, and returns its guard with the counts.
    pub fn end(mut self) -> CommandGuard {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().expect("ended once").join().expect("the driver does not panic")
    }
}

fn drive(
    endpoint: &Endpoint,
    description: &HardwareDescription,
    stop: &AtomicBool,
    state: &AtomicU32,
) -> CommandGuard {
    let magnet_count = u32::try_from(description.magnets().count()).expect("a few");
    let mut end = DriverEnd::create(endpoint).expect("the root is this test's own");
    let mut guard = CommandGuard::new(description, &[0.0; POSE_PARAMETERS_MAX]);
    let orientation_xyzw = [0.0, 0.0, 0.0, 1.0];
    let upright = MagnetPose { position_m: POSITION_M, orientation_xyzw, valid: 1, ..MagnetPose::default() };
    while !stop.load(Ordering::Relaxed) {
        let now = Stamp::now();
        if let Some(command) = end.take_command(now) {
            // Refusals are counted by the guard.
            let _ = guard.offer(&command, now);
        }
        let setpoint = guard.setpoint(now, 1e-3);
        state.store(guard.state(), Ordering::Relaxed);
        let mut pose = PoseMessage { magnet_count, magnets: [upright; 8], ..PoseMessage::default() };
        pose.header.source_stamp_ns = now.nanoseconds();
        end.publish_pose(pose, now).expect("the transport works");
        let mut feedback = CoilFeedback { measured: *setpoint.actuation(), ..CoilFeedback::default() };
        feedback.header.source_stamp_ns = now.nanoseconds();
        guard.report(&mut feedback);
        end.publish_feedback(feedback, now).expect("the transport works");
        std::thread::sleep(Duration::from_millis(1));
    }
    guard
}
