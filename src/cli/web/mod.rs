//! `magsteer web`: the rig on a page, and its figures for programs.
//!
//! ```text
//!  browser ◀── page, /events (server-sent) ── routes ── asks ──▶ desk: the viewer's thread ◀── status, journal
//!          ── POST /command ──▶ guard ──────────┘      ◀─ frames ──┘                        ──▶ requests
//! ```
//!
//! | file | does |
//! |---|---|
//! | `command` | the process: address, threads, end |
//! | `desk` | the thread that owns the viewer |
//! | `routes` | what is served under which path |
//! | `guard` | who may ask, and for what |
//! | `page/` | the page; nothing in it is fetched from elsewhere |

mod command;
mod desk;
mod guard;
mod routes;

pub use command::Web;
