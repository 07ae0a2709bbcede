//! Both ends of a rig's channels, on iceoryx2 shared memory. Nothing outside this layer names the transport.
//!
//! | channel | from, to | kind | end here |
//! |---|---|---|---|
//! | `pose`, `coil/feedback` | driver to daemon | newest value | [`DriverEnd`] creates, [`DaemonEnd`] opens |
//! | `coil/command` | daemon to driver | newest value | as above |
//! | `sim/truth` | simulated plant to whoever looks | stream | [`DriverEnd`], [`TruthObserver`] |
//! | `target/set`, `request` | operator to daemon | request and answer | [`OperatorServer`], [`OperatorClient`] |
//! | `fault` | anyone to a driver that allows faults | request and answer | [`DriverServices::allow_faults`], [`FaultClient`] |
//! | `status` | daemon to whoever looks | stream | as above |
//! | `record` | every cycle of the daemon to whoever records | stream | [`OperatorServer`], [`RecordObserver`] |
//!
//! Rules: a rig has one driver and one daemon, held by lock files that die with their process; either may restart at
//! any time, killed or not, and meets the other again without anybody clearing anything up. Nothing here waits except
//! opening, which is bounded. Per sent message the transport allocates once; receiving allocates nothing.

mod daemon;
mod distant;
mod driver;
pub(crate) mod endpoint;
mod error;
mod fault;
pub(crate) mod layout;
mod leftovers;
mod lock;
mod membership;
mod operator;
mod ports;
mod private_root;
mod probe;
mod record;
mod requests;
pub(crate) mod service;
mod tunnel;

pub use daemon::{DaemonEnd, DaemonServices};
pub use driver::{DriverEnd, DriverServices};
pub use endpoint::{Endpoint, ROOT_VARIABLE};
pub use error::{ChannelError, ClientError, FaultClientError, Role};
pub use fault::FaultClient;
pub use leftovers::{Cleared, Leftovers};
pub use operator::{IncomingRequest, OperatorClient, OperatorServer, OperatorServices, TruthObserver};
pub use private_root::PrivateRoot;
pub use probe::ProbeEnd;
pub use record::{RecordLoss, RecordObserver};
pub use tunnel::{SharedEnd, TunnelFacts, WatchedEnd};
