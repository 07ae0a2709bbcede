//! The plant as a driver process: in real time, behind the channels.
//!
//! The loop wakes at absolute deadlines, takes the newest command, steps the plant to the present and
//! publishes. After a stall of the machine it catches up, by a bounded stretch a wake-up; what lies
//! further back is left out and counted, as if the world had stood still. Stamps are the machine's
//! monotonic clock throughout.
//!
//! Told to stop, it takes no more commands: authority lapses, the guard ramps to zero, and the loop
//! ends on the measured current, or on a cut after a bounded time.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::channels::DriverEnd;
use magsteer_hal::fault::{FaultCounts, FaultEvent, Injector};
use magsteer_hal::guard::VALIDITY_MAX;

use crate::config::RealTimeConfig;
use crate::plant::{Counts, Plant};
use crate::ramp::Ramp;

/// After the longest validity a ramp may take this long before the amplifiers are cut.
const RAMP_MAX: Duration = Duration::from_secs(1);
/// Time for a coil to discharge once it is cut.
const DISCHARGE_MAX: Duration = Duration::from_secs(1);

/// What a run of the process came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Counts of the plant.
    pub counts: Counts,
    /// Simulated time left out because the process was held up for too long.
    pub left_out: Duration,
    /// Wake-ups at which time was left out.
    pub stalls: u64,
    /// Longest delay of a wake-up behind its deadline.
    pub lateness_max: Duration,
    /// Commands that broke a current or slew limit.
    pub limit_breaks: u64,
    /// Commands refused for any reason.
    pub commands_refused: u64,
    /// Messages that the transport refused.
    pub messages_unsent: u64,
    /// The last complete way to zero current after authority was lost.
    pub last_ramp: Option<Ramp>,
    /// The longest of all, from the last command that was obeyed.
    pub longest_ramp: Duration,
    /// True when the coils were at zero at the end.
    pub ended_currentless: bool,
    /// What faults by script did; `None` where they were not allowed.
    pub faults: Option<FaultCounts>,
}

/// The plant, its channels and what keeps them in time.
struct Loop<'a> {
    plant: &'a mut Plant,
    end: &'a mut DriverEnd,
    catch_up_max: Duration,
    truth_period: Duration,
    truth_due: Stamp,
    left_out: Duration,
    stalls: u64,
    lateness_max: Duration,
    messages_unsent: u64,
}

/// Runs the plant in real time until `stop` is set and the coils are at zero. Begins and ends of faults are
/// handed to `tell`, which must not wait. `wakes` counts wake-ups, for whoever watches that this goes on.
pub fn run(
    plant: &mut Plant,
    config: &RealTimeConfig,
    end: &mut DriverEnd,
    stop: &AtomicBool,
    wakes: &AtomicU64,
    tell: impl Fn(FaultEvent),
) -> Summary {
    let wake = Duration::from_micros(config.wake_us);
    let mut deadline = Stamp::now();
    plant.set_clock(deadline);
    let mut running = Loop {
        plant,
        end,
        catch_up_max: Duration::from_millis(config.catch_up_max_ms),
        truth_period: Duration::from_millis(config.truth_period_ms),
        truth_due: deadline,
        left_out: Duration::ZERO,
        stalls: 0,
        lateness_max: Duration::ZERO,
        messages_unsent: 0,
    };
    let mut stopped = None;
    loop {
        // What held the process up while it worked counts as much as what held it up while it slept.
        let due = deadline.after(wake);
        deadline = next_deadline(deadline, wake);
        thread::sleep(deadline.since(Stamp::now()));
        let now = Stamp::now();
        running.lateness_max = running.lateness_max.max(now.since(due));
        if stopped.is_none() && stop.load(Ordering::Relaxed) {
            stopped = Some(now);
        }
        running.wake(now, stopped.is_none());
        wakes.fetch_add(1, Ordering::Relaxed);
        while let Some(event) = running.end.take_fault_event() {
            tell(event);
        }
        if stopped.is_some_and(|since| running.has_ended(now.since(since))) {
            return running.summary();
        }
    }
}

/// The first deadline after now on the grid of `wake`: a late process skips whole periods.
fn next_deadline(deadline: Stamp, wake: Duration) -> Stamp {
    let behind = Stamp::now().since(deadline).as_nanos() / wake.as_nanos().max(1);
    let periods = u32::try_from(behind).unwrap_or(u32::MAX).saturating_add(1);
    deadline.after(wake.saturating_mul(periods))
}

impl Loop<'_> {
    fn wake(&mut self, now: Stamp, takes_commands: bool) {
        if let Some(command) = self.end.take_command(now)
            && takes_commands
        {
            // The guard counts what it refuses and says so in the feedback.
            let _ = self.plant.offer(&command, now);
        }
        while let Some(change) = self.end.next_condition(now) {
            self.plant.take_on(&change);
        }
        self.leave_out(now);
        let step = self.plant.step_duration();
        while self.plant.now().after(step) <= now {
            let end = &mut *self.end;
            self.plant.advance_through(|setpoint, now| end.setpoint(setpoint, now, step.as_secs_f64()));
            while let Some(message) = self.plant.take_pose() {
                let sent = self.end.publish_pose(message, Stamp::now());
                self.messages_unsent += u64::from(sent.is_err());
            }
        }
        let sent = self.end.publish_feedback(self.plant.feedback(), Stamp::now());
        self.messages_unsent += u64::from(sent.is_err());
        if now >= self.truth_due {
            let sent = self.end.publish_truth(self.plant.truth(), Stamp::now());
            self.messages_unsent += u64::from(sent.is_err());
            self.truth_due = next_deadline(self.truth_due, self.truth_period);
        }
    }

    /// Jumps over what cannot be caught up in one wake-up.
    fn leave_out(&mut self, now: Stamp) {
        let behind = now.since(self.plant.now());
        if behind > self.catch_up_max {
            let lost = behind - self.catch_up_max;
            self.left_out += lost;
            self.stalls += 1;
            self.plant.set_clock(self.plant.now().after(lost));
        }
    }

    /// Whether the coils came to zero, or all time for it is over.
    fn has_ended(&mut self, since_stop: Duration) -> bool {
        if since_stop > VALIDITY_MAX + RAMP_MAX {
            self.plant.trip();
        }
        self.plant.is_currentless() && !self.plant.is_driven()
            || since_stop > VALIDITY_MAX + RAMP_MAX + DISCHARGE_MAX
    }

    fn summary(&self) -> Summary {
        Summary {
            counts: *self.plant.counts(),
            left_out: self.left_out,
            stalls: self.stalls,
            lateness_max: self.lateness_max,
            limit_breaks: self.plant.guard().limit_breaks(),
            commands_refused: self.plant.guard().refusals().total(),
            messages_unsent: self.messages_unsent,
            last_ramp: self.plant.last_ramp(),
            longest_ramp: self.plant.longest_ramp(),
            ended_currentless: self.plant.is_currentless(),
            faults: self.end.faults().map(Injector::counts),
        }
    }
}
