//! Faults by script: a driver that goes wrong on request, so that a daemon can be seen to answer.
//!
//! **Terms.** A *fault* is a *verb* that befalls a *target*, or one *part* of it (a magnet, a coil, a frame),
//! from one moment to another. A *plan* is a file of faults with their times, counted from the driver's
//! start; others come on request. The *injector* makes them happen. It sits on the driver's own side: between
//! the driver and its channels, and between its guard and its amplifiers. So the same verbs work on any
//! driver that uses [`crate::channels::DriverEnd`] or [`crate::scripted::Loopback`], and what the daemon sees
//! is exactly what a broken driver would send.
//!
//! **Gate.** Nothing of this exists in a driver that was not given an [`Injector`], and a driver takes one
//! only when its user says so (`magsteer sim-plant --allow-faults`): then alone does the service for requests
//! exist.
//!
//! # Messages: poses and feedback
//!
//! | verb | parameters | what is published | of one part |
//! |---|---|---|---|
//! | `off` | | nothing | a magnet is not seen; a current or angle reads 0 |
//! | `stuck` | | the content of the fault's first message, under fresh sequences and stamps: the nasty case | that entry alone stays |
//! | `garbage` | `garbage` | `nan`: not a number; `huge`: 1e300 (positions, currents, angles); `quaternion`: norm 2 (poses); `random`: what could be true, new with each message | that entry alone |
//! | `slow` | `rate_hz` | at most so many messages a second, the rest is lost | the entry is renewed so often |
//! | `delayed` | `delay_ms` | everything, later: sources keep their stamps, sequences and publish stamps are fresh. What is under way at the end is lost | the entry is that old, the stamps are not |
//! | `intermittent` | `period_ms`, `off_fraction` | nothing in the first part of each period | as `off`, in the first part |
//! | `repeated` | | with each message due, the last one from before the fault, bit for bit | - |
//! | `backward` | | sequences fall by one with each message, from the last one before the fault; not below 1 | - |
//! | `wrong-epoch` | `epoch` | `other`: one other epoch, as after a restart; `every-message`: another with each | - |
//! | `wrong-version` | | a layout version that nobody speaks | - |
//!
//! Feedback includes the driver's state, its echo of commands and its counts: when it is stuck or delayed, so
//! are they.
//!
//! # Actuators
//!
//! | verb | where | what happens | of one part |
//! |---|---|---|---|
//! | `off` | after the guard | currents go to zero, frames hold | that coil or frame alone |
//! | `stuck` | after the guard | currents and angles stay where they were at the fault's begin | likewise |
//! | `garbage`, `random` alone | after the guard | set points within the limits at random, a new one each 50 ms | likewise |
//! | `slow` | after the guard | set points follow with a first-order lag of corner frequency `rate_hz` | likewise |
//! | `delayed` | after the guard | set points of `delay_ms` ago; until then those of the begin | likewise |
//! | `intermittent` | after the guard | `off` in the first part of each period | likewise |
//! | `repeated` | before the guard | with each command received, the last one from before the fault | - |
//! | `backward` | before the guard | sequences fall, from the last one before the fault | - |
//! | `wrong-epoch` | before the guard | `other`: the epoch of a former holder, one less; `every-message`: one less each time | - |
//! | `wrong-version` | before the guard | a layout version that nobody speaks | - |
//!
//! Coils may be real. Whatever acts, set points stay within the rig's limits on current, slew, angle and
//! speed. An order to cut passes both stages untouched, at once. And where nobody holds authority, zero
//! passes too, within slew: a fault may keep a daemon from ramping down, which must then cut, but it keeps no
//! current in the coils of a rig that nobody commands.
//!
//! # Coils and frames
//!
//! `open`, `shorted` (`turns_fraction`) and `stuck-amplifier` befall a `coil`, `stalled` a `frame`: physical
//! conditions, which only a simulated plant can have on request ([`Reach::Plant`]). Other drivers refuse
//! them.
//!
//! **Method.** All storage is made at construction; what is delayed stands in lines of bounded length.
//! Several faults of one target act together, in the order in which they were given. What is random comes
//! from the driver's seed. What is absent: a clock, a channel, an allocation after construction, a log.

mod checked;
mod commands;
mod conditions;
mod config;
mod content;
mod history;
mod injector;
mod kinds;
mod plan;
mod request;
mod setpoints;
mod slots;
mod stream;
#[cfg(test)]
mod tests;

pub use checked::{Fault, FaultRefusal};
pub use conditions::ConditionChange;
pub use config::{FaultConfig, FaultPlanConfig, VerbName};
pub use injector::{FaultCounts, Injector};
pub use kinds::{
    Condition, DELAY_MAX, DELAY_MIN, EpochChange, FaultTarget, FaultVerb, Garbage, PERIOD_MAX, PERIOD_MIN,
    Part, RATE_MAX, RATE_MIN, Reach, SHORTED_MAX, TIME_MAX, verbs_of,
};
pub use plan::{FaultPlan, Scheduled};
pub use request::{FaultAnswer, FaultRequest, action, refusal_text};
pub use slots::{FAULTS_MAX, FaultEvent};
pub use stream::StreamCounts;
