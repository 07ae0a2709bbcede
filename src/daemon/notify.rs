//! What the service manager is told: ready, state, alive, stopping.
//!
//! systemd names a datagram socket in `$NOTIFY_SOCKET`; each message is lines of `KEY=value` (`sd_notify(3)`). Where nobody
//! named one, nothing is sent. The protocol is small enough that a dependency would hide more than it does.
//!
//! | message | when |
//! |---|---|
//! | `READY=1` | the first cycle was seen |
//! | `STATUS=...` | the text changed |
//! | `WATCHDOG=1` | half of `$WATCHDOG_USEC` has passed since the last one *and* the count of cycles has moved since |
//! | `STOPPING=1` | the process was asked to end: before the ramp to zero, not after |
//!
//! A loop that stands still therefore ends the pings, however lively the thread is that would send them, and so does the
//! death of that thread. A message that the manager's full queue refuses is sent again at the next occasion.

use std::ffi::{OsStr, OsString};
use std::fmt::Display;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::Duration;

use magsteer_hal::Stamp;

/// The service manager's end, if there is one.
#[derive(Debug, Default)]
pub struct Notify {
    manager: Option<Manager>,
    /// How often the watchdog is fed.
    half_period: Option<Duration>,
    /// When it was fed last, and the count of cycles then.
    fed: Option<(Stamp, u64)>,
    ready: bool,
    stopping: bool,
    status: String,
}

#[derive(Debug)]
struct Manager {
    socket: UnixDatagram,
    address: SocketAddr,
}

impl Manager {
    /// `address`: a path, or `@` and a name in the abstract namespace.
    fn new(address: &OsStr) -> io::Result<Self> {
        let address = match address.as_bytes() {
            [b'@', name @ ..] => SocketAddr::from_abstract_name(name)?,
            [b'/', ..] => SocketAddr::from_pathname(address)?,
            _ => return Err(io::Error::from(io::ErrorKind::InvalidInput)),
        };
        let socket = UnixDatagram::unbound()?;
        // A manager that does not read must not hold up the thread that serves operators.
        socket.set_nonblocking(true)?;
        Ok(Self { socket, address })
    }

    /// True when it was taken. Addressed each time: a manager that restarts makes its socket anew.
    fn send(&self, text: &str) -> bool {
        self.socket.send_to_addr(text.as_bytes(), &self.address).is_ok()
    }
}

impl Notify {
    /// As the environment says; silent when it names no manager or an address that is none.
    #[must_use]
    pub fn from_environment() -> Self {
        let number = |name| std::env::var(name).ok()?.parse::<u64>().ok();
        let addressed_to_another =
            number("WATCHDOG_PID").is_some_and(|pid| pid != u64::from(std::process::id()));
        let period = number("WATCHDOG_USEC").filter(|_| !addressed_to_another);
        Self::new(std::env::var_os("NOTIFY_SOCKET"), period.map(Duration::from_micros))
    }

    /// Tells the manager at `address`; `watchdog` is how long it waits for a ping.
    #[must_use]
    pub fn new(address: Option<OsString>, watchdog: Option<Duration>) -> Self {
        Self {
            manager: address.and_then(|address| Manager::new(&address).ok()),
            half_period: watchdog.filter(|period| !period.is_zero()).map(|period| period / 2),
            ..Self::default()
        }
    }

    /// Takes over how many cycles have run by `now`: the first one makes the service ready, and each time the count has
    /// moved after half a watchdog's period it is fed.
    pub fn progress(&mut self, now: Stamp, cycles: u64) {
        let Some(manager) = &self.manager else { return };
        if !self.ready {
            self.ready = manager.send("READY=1");
        }
        let Some(half_period) = self.half_period else { return };
        let is_due = self.fed.is_none_or(|(at, count)| now.since(at) >= half_period && cycles != count);
        if is_due && manager.send("WATCHDOG=1") {
            self.fed = Some((now, cycles));
        }
    }

    /// Shows `text` beside the service's name, when it is another one than before.
    pub fn status(&mut self, text: impl Display) {
        let Some(manager) = &self.manager else { return };
        // One line: a second one would be another message.
        let text = text.to_string().replace('\n', " ");
        if text != self.status && manager.send(&format!("STATUS={text}")) {
            self.status = text;
        }
    }

    /// The process was asked to end and begins to ramp down.
    pub fn stopping(&mut self) {
        let Some(manager) = &self.manager else { return };
        if !self.stopping {
            self.stopping = manager.send("STOPPING=1");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixDatagram};
    use std::path::Path;
    use std::time::Duration;

    use magsteer_hal::Stamp;

    use super::Notify;

    const PERIOD: Duration = Duration::from_millis(200);

    fn at(milliseconds: u64) -> Stamp {
        Stamp::from_nanoseconds(1_000_000_000 + milliseconds * 1_000_000)
    }

    /// What lies in the manager's queue.
    fn told(manager: &UnixDatagram) -> Vec<String> {
        manager.set_nonblocking(true).expect("a socket");
        let mut buffer = [0; 512];
        let mut messages = Vec::new();
        while let Ok(length) = manager.recv(&mut buffer) {
            messages.push(String::from_utf8(buffer[..length].to_vec()).expect("text"));
        }
        messages
    }

    fn managed(directory: &Path) -> (UnixDatagram, Notify) {
        let path = directory.join("notify");
        let manager = UnixDatagram::bind(&path).expect("own directory");
        (manager, Notify::new(Some(path.into()), Some(PERIOD)))
    }

    /// Proves SR-20.
    #[test]
    fn watchdog_is_fed_by_progress_alone_and_at_half_its_period() {
        let directory = tempfile::tempdir().expect("a directory");
        let (manager, mut notify) = managed(directory.path());
        notify.progress(at(0), 1);
        assert_eq!(told(&manager), ["READY=1", "WATCHDOG=1"]);
        notify.progress(at(99), 100);
        assert_eq!(told(&manager), Vec::<String>::new(), "not due");
        notify.progress(at(100), 101);
        assert_eq!(told(&manager), ["WATCHDOG=1"]);
        // The thread that feeds lives on, the loop stands still.
        for milliseconds in 101..2_000 {
            notify.progress(at(milliseconds), 101);
        }
        assert_eq!(told(&manager), Vec::<String>::new(), "a loop that stands still feeds nothing");
        notify.progress(at(2_000), 102);
        assert_eq!(told(&manager), ["WATCHDOG=1"]);
    }

    #[test]
    fn status_is_told_when_it_changes_and_stopping_once() {
        let directory = tempfile::tempdir().expect("a directory");
        let (manager, mut notify) = managed(directory.path());
        for text in ["idle", "idle", "active\nREADY=1"] {
            notify.status(text);
        }
        notify.stopping();
        notify.stopping();
        assert_eq!(told(&manager), ["STATUS=idle", "STATUS=active READY=1", "STOPPING=1"]);
    }

    #[test]
    fn message_that_the_manager_did_not_take_is_sent_again() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("notify");
        let mut notify = Notify::new(Some(path.clone().into()), Some(PERIOD));
        notify.progress(at(0), 1);
        notify.stopping();
        let manager = UnixDatagram::bind(&path).expect("own directory");
        notify.progress(at(1), 2);
        notify.stopping();
        assert_eq!(told(&manager), ["READY=1", "WATCHDOG=1", "STOPPING=1"]);
    }

    #[test]
    fn abstract_addresses_are_reached_and_without_a_manager_nothing_is_sent() {
        let name = format!("magsteer-notify-{}", std::process::id());
        let address = SocketAddr::from_abstract_name(name.as_bytes()).expect("a name");
        let manager = UnixDatagram::bind_addr(&address).expect("free");
        Notify::new(Some(format!("@{name}").into()), None).progress(at(0), 1);
        assert_eq!(told(&manager), ["READY=1"], "no watchdog is configured");
        for address in [None, Some("relative".into()), Some("".into())] {
            let mut silent = Notify::new(address, Some(PERIOD));
            silent.progress(at(0), 1);
            silent.status("idle");
            silent.stopping();
            assert!(!silent.ready && !silent.stopping && silent.manager.is_none());
        }
    }
}
