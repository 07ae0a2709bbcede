//! A rig watched from another machine.
//!
//! **Problem.** Channels are shared memory: they end at the machine. Whoever sits elsewhere wants to watch
//! and to record; nobody there may command, and the loop must not notice.
//!
//! **Method.** The transport has a tunnel of its own, `iox2-link-tunnel-zenoh`, which carries topics over
//! zenoh. Here it is told what to carry and from where, and is run as a child of `magsteer tunnel share` on
//! the rig's machine and of `magsteer tunnel watch` on the other. It carries two topics, both published by
//! the daemon's telemetry thread for whoever listens: the loop's own topics stay as they are.
//!
//! **Why no command passes.** Three walls, each enough by itself: the tunnel carries no requests at all, and
//! is allowed two topics by name; the network's access rules let nothing be put from a watching machine to
//! the rig's; and on the watching machine the requests are answered by `magsteer tunnel watch`, with a
//! refusal.
//!
//! **Which builds meet.** The network's names begin with the rig's and with a hash of the messages' layouts:
//! builds that would misread one another do not hear each other.
//!
//! | file | does |
//! |---|---|
//! | `address` | where the two sides meet |
//! | `plan` | the tunnel's two configuration files and its command line; start reading here |
//! | `program` | the tunnel as a child process |

mod address;
mod plan;
mod program;

pub use address::{Address, NoAddress};
pub use plan::{Side, TunnelPlan};
pub use program::{PROGRAM, Tunnel, TunnelError, find};
