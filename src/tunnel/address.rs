//! Where the two sides of a tunnel meet.

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

/// A host and a TCP port: `rig.example:7447`, `10.0.0.5:7447`, `[fd00::5]:7447`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    host: String,
    port: u16,
}

/// Why a text is no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("must be HOST:PORT, such as 127.0.0.1:7447 or [::1]:7447, with a port from 1 to 65535")]
pub struct NoAddress;

impl Address {
    /// True when no other machine reaches it.
    #[must_use]
    pub fn is_loopback(&self) -> bool {
        let bare = self.host.trim_start_matches('[').trim_end_matches(']');
        bare == "localhost" || bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
    }

    /// As zenoh names it.
    pub(super) fn locator(&self) -> String {
        format!("tcp/{self}")
    }
}

impl FromStr for Address {
    type Err = NoAddress;

    fn from_str(text: &str) -> Result<Self, NoAddress> {
        let (host, port) = text.rsplit_once(':').ok_or(NoAddress)?;
        let port = port.parse().ok().filter(|port| *port > 0).ok_or(NoAddress)?;
        let bracketed = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
        let is_host = match bracketed {
            Some(inside) => inside.parse::<std::net::Ipv6Addr>().is_ok(),
            // What else zenoh would take for its own marks has no place in the name of a host.
            None => {
                let allowed =
                    |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-' | '_');
                !host.is_empty() && host.chars().all(allowed)
            }
        };
        if !is_host {
            return Err(NoAddress);
        }
        Ok(Self { host: host.to_owned(), port })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.host, self.port)
    }
}

#[cfg(test)]
mod tests {
    use super::Address;

    #[test]
    fn hosts_and_addresses_of_both_kinds_are_taken() {
        for (text, loopback) in [
            ("127.0.0.1:7447", true),
            ("localhost:1", true),
            ("[::1]:7447", true),
            ("0.0.0.0:7447", false),
            ("10.0.0.5:65535", false),
            ("[fd00::5]:7447", false),
            ("rig.example:7447", false),
        ] {
            let address: Address = text.parse().expect(text);
            assert_eq!((address.is_loopback(), address.to_string().as_str()), (loopback, text));
            assert_eq!(address.locator(), format!("tcp/{text}"));
        }
    }

    #[test]
    fn what_is_no_host_and_port_is_refused() {
        for text in ["", "host", ":7447", "host:", "host:0", "host:65536", "fd00::5:7447", "[host]:7447"] {
            text.parse::<Address>().expect_err(text);
        }
        for text in ["tcp/host:1", "host?x=1:1", "host#iface=eth0:1", "a\"b:1", "a b:1"] {
            text.parse::<Address>().expect_err(text);
        }
    }
}
