//! Who may ask, and for what.
//!
//! Dangers, and what is held against them:
//!
//! | danger | held against it |
//! |---|---|
//! | another site's script sends a request to this machine | a key that is printed with the address, in a header that other origins may not send |
//! | another user of this machine | the same key: it stands behind the address's `#`, is sent to nobody, and the page has it from there alone |
//! | the same through a name that resolves to this machine (DNS rebinding) | the `Host` must be this machine's address, and the `Origin` the page's own |
//! | the page in another site's frame, clicked through | it refuses to be framed |
//! | another machine | refused, or with `--allow-remote-viewing` allowed to look: then there is no key at all |
//!
//! Not held against: other users of the same machine, and of others where that is allowed, may look.

use std::fs::File;
use std::io::{self, Read};
use std::net::SocketAddr;

use axum::http::{HeaderMap, header};

/// Header that carries the token.
pub const TOKEN_HEADER: &str = "x-magsteer-token";
/// Bytes of the token: not to be guessed.
const TOKEN_BYTES: usize = 16;

/// Why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Asked for under another name.
    #[error("this server does not serve that host name")]
    Host,
    /// Sent by another site's page.
    #[error("commands are taken from this server's own page alone")]
    Origin,
    /// Without the key, or with that of a former life of this process.
    #[error("the key is not that of this server: open the address that `magsteer web` printed")]
    Token,
    /// Served to other machines.
    #[error("commands are off, since other machines may look")]
    CommandsOff,
}

/// The rules for one address.
#[derive(Debug, Clone)]
pub struct Guard {
    hosts: Option<Vec<String>>,
    token: Option<String>,
    boot: String,
}

impl Guard {
    /// Rules for what is served at `address`.
    ///
    /// # Errors
    /// When the system gives no random numbers.
    pub fn new(address: SocketAddr, allow_remote_viewing: bool) -> io::Result<Self> {
        let mut bytes = [0; 2 * TOKEN_BYTES];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        let hexadecimal = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        let (token, boot) = bytes.split_at(TOKEN_BYTES);
        let port = address.port();
        let names = [address.ip().to_string(), format!("[{}]", address.ip()), "localhost".to_owned()];
        // Browsers leave out the port that is meant when none is given.
        let named = names.iter().map(|name| format!("{name}:{port}"));
        let bare = names.iter().filter(|_| port == 80).cloned();
        let hosts = named.chain(bare).collect();
        Ok(Self {
            hosts: (!allow_remote_viewing).then_some(hosts),
            token: (!allow_remote_viewing).then(|| hexadecimal(token)),
            boot: hexadecimal(boot),
        })
    }

    /// True when commands are taken.
    pub const fn commands(&self) -> bool {
        self.token.is_some()
    }

    /// The key that comes with commands; empty when there are none.
    pub fn token(&self) -> &str {
        self.token.as_deref().unwrap_or_default()
    }

    /// Tells this life of the process from others.
    pub fn boot(&self) -> &str {
        &self.boot
    }

    /// Whether a request for something to look at is answered.
    pub fn view(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        match &self.hosts {
            Some(hosts) if !hosts.iter().any(|host| Some(host.as_str()) == text(headers, header::HOST)) => {
                Err(Refusal::Host)
            }
            _ => Ok(()),
        }
    }

    /// Whether a command is taken.
    pub fn command(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let token = self.token.as_deref().ok_or(Refusal::CommandsOff)?;
        self.view(headers)?;
        let host = text(headers, header::HOST).unwrap_or_default();
        // Programs send none; browsers do with every command.
        if headers.contains_key(header::ORIGIN)
            && text(headers, header::ORIGIN) != Some(format!("http://{host}").as_str())
        {
            return Err(Refusal::Origin);
        }
        let given = headers.get(TOKEN_HEADER).and_then(|value| value.to_str().ok());
        if given == Some(token) { Ok(()) } else { Err(Refusal::Token) }
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

#[cfg(test)]
mod tests {
    use axum::http::{HeaderMap, HeaderName, HeaderValue};

    use super::{Guard, Refusal, TOKEN_HEADER};

    fn guard(remote: bool) -> Guard {
        Guard::new("127.0.0.1:8080".parse().expect("written here"), remote).expect("random numbers")
    }

    fn headers(pairs: &[(&'static str, &str)]) -> HeaderMap {
        let pair = |(name, value): &(&'static str, &str)| {
            (HeaderName::from_static(name), HeaderValue::from_str(value).expect("text"))
        };
        pairs.iter().map(pair).collect()
    }

    #[test]
    fn commands_need_the_own_host_the_own_origin_and_the_token() {
        let guard = guard(false);
        let token = guard.token();
        let host = ("host", "127.0.0.1:8080");
        let own = ("origin", "http://127.0.0.1:8080");
        for (pairs, expected) in [
            (vec![host, own, (TOKEN_HEADER, token)], Ok(())),
            (vec![host, (TOKEN_HEADER, token)], Ok(())),
            (
                vec![("host", "localhost:8080"), ("origin", "http://localhost:8080"), (TOKEN_HEADER, token)],
                Ok(()),
            ),
            (vec![host, own], Err(Refusal::Token)),
            (vec![host, own, (TOKEN_HEADER, "0123")], Err(Refusal::Token)),
            (vec![host, own, (TOKEN_HEADER, "")], Err(Refusal::Token)),
            (vec![host, ("origin", "http://evil.example"), (TOKEN_HEADER, token)], Err(Refusal::Origin)),
            (vec![host, ("origin", "null"), (TOKEN_HEADER, token)], Err(Refusal::Origin)),
            (vec![host, ("origin", "http://localhost:8080"), (TOKEN_HEADER, token)], Err(Refusal::Origin)),
            (vec![("host", "evil.example:8080"), (TOKEN_HEADER, token)], Err(Refusal::Host)),
            (vec![("host", "127.0.0.1:9090"), (TOKEN_HEADER, token)], Err(Refusal::Host)),
            (vec![own, (TOKEN_HEADER, token)], Err(Refusal::Host)),
        ] {
            assert_eq!(guard.command(&headers(&pairs)), expected, "{pairs:?}");
        }
    }

    #[test]
    fn whoever_serves_other_machines_takes_no_commands_and_has_no_token() {
        let guard = guard(true);
        assert!(!guard.commands() && guard.token().is_empty());
        assert_eq!(guard.view(&headers(&[("host", "rig.example:8080")])), Ok(()));
        for token in ["", "0123"] {
            let headers = headers(&[("host", "127.0.0.1:8080"), (TOKEN_HEADER, token)]);
            assert_eq!(guard.command(&headers), Err(Refusal::CommandsOff));
        }
    }

    #[test]
    fn tokens_differ_from_process_to_process_and_are_long() {
        let (one, other) = (guard(false), guard(false));
        assert_ne!(one.token(), other.token());
        assert_eq!((one.token().len(), one.boot().len()), (32, 32));
        assert_ne!(one.token(), one.boot());
    }
}
