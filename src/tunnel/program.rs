//! The transport's tunnel as a child process.

use std::ffi::OsStr;
use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use magsteer_hal::channels::Endpoint;
use rustix::process::{Pid, Signal, kill_process};

use crate::daemon::kernel::Signals;

use super::plan::{NETWORK_FILE, TRANSPORT_FILE, TunnelPlan};

/// Name of the tunnel's program.
pub const PROGRAM: &str = "iox2-link-tunnel-zenoh";
/// Its version is the transport's: two versions must not share memory.
const VERSION: &str = "0.10.0";
/// How it is got.
const INSTALL: &str = "cargo install --locked --version 0.10.0 iceoryx2-integrations-zenoh-link-tunnel-cli, or name it with --program";
/// How much of its log is seen, where the user does not say.
const LOG_VARIABLE: &str = "IOX2_LOG_LEVEL";
const LOG_LEVEL: &str = "WARN";
/// Where the number of its process stands, for the next one.
const PID_FILE: &str = "pid";
/// How long it may take to end.
const END_PATIENCE: Duration = Duration::from_secs(3);
const POLL: Duration = Duration::from_millis(20);

/// Why there is no tunnel.
#[derive(Debug, thiserror::Error)]
pub enum TunnelError {
    /// The program is not there.
    #[error("{program} is not there: {INSTALL}", program = .0.display())]
    NoProgram(PathBuf),
    /// It is another version's.
    #[error("{program} says {found:?} of its version, must be {VERSION}: {INSTALL}", program = program.display())]
    Version {
        /// The program.
        program: PathBuf,
        /// What it says.
        found: String,
    },
    /// It cannot be started.
    #[error("{program}: {source}", program = program.display())]
    Start {
        /// The program.
        program: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Its files cannot be written.
    #[error("{path}: {source}", path = path.display())]
    Files {
        /// The folder of its files.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// The tunnel's program: the one named, or the first on `path` (as `$PATH` lists it); of the right version.
///
/// # Errors
/// When it is not there, or another version.
pub fn find(named: Option<&Path>, path: Option<&OsStr>) -> Result<PathBuf, TunnelError> {
    let program = match named {
        Some(named) => {
            // It is run in another folder.
            named.canonicalize().map_err(|_| TunnelError::NoProgram(named.to_owned()))?
        }
        None => std::env::split_paths(path.unwrap_or_default())
            .map(|folder| folder.join(PROGRAM))
            .find(|program| is_program(program))
            .ok_or_else(|| TunnelError::NoProgram(PathBuf::from(PROGRAM)))?,
    };
    let asked = Command::new(&program).arg("--version").stdin(Stdio::null()).output();
    let said = asked.map_err(|source| TunnelError::Start { program: program.clone(), source })?;
    let found = String::from_utf8_lossy(&said.stdout).trim().to_owned();
    if found.split_whitespace().next_back() != Some(VERSION) {
        return Err(TunnelError::Version { program, found });
    }
    Ok(program)
}

fn is_program(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| found.is_file() && found.permissions().mode() & 0o111 != 0)
}

/// A running tunnel; ended when this goes.
#[derive(Debug)]
pub struct Tunnel {
    child: Child,
    folder: PathBuf,
}

impl Tunnel {
    /// Writes the tunnel's files below the rig's root and starts it there, after ending one that a killed
    /// command left behind. Only the holder of the rig's tunnel role may call this.
    ///
    /// # Errors
    /// When its files cannot be written, or it cannot be started.
    pub fn start(program: &Path, plan: &TunnelPlan, endpoint: &Endpoint) -> Result<Self, TunnelError> {
        let folder = endpoint.root().join(format!("{}.tunnel", plan.rig));
        let failed = |source| TunnelError::Files { path: folder.clone(), source };
        end_left_behind(&folder);
        write_files(&folder, plan).map_err(failed)?;
        let mut command = Command::new(program);
        command
            .args(plan.arguments())
            .current_dir(&folder)
            .env(LOG_VARIABLE, std::env::var_os(LOG_VARIABLE).unwrap_or_else(|| LOG_LEVEL.into()))
            .stdin(Stdio::null())
            // Results go to standard output, and it has none.
            .stdout(io::stderr())
            // A terminal's Ctrl-C is for the command that runs it.
            .process_group(0);
        let child = Signals::let_through(|| command.spawn())
            .flatten()
            .map_err(|source| TunnelError::Start { program: program.to_owned(), source })?;
        let tunnel = Self { child, folder: folder.clone() };
        fs::write(folder.join(PID_FILE), tunnel.pid().to_string()).map_err(failed)?;
        Ok(tunnel)
    }

    /// Number of its process.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// How it ended by itself; `None` while it runs.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }
}

impl Drop for Tunnel {
    fn drop(&mut self) {
        let begin = Instant::now();
        let is_asked = i32::try_from(self.pid()).ok().and_then(Pid::from_raw).is_some_and(|pid| {
            // A child that was not waited for keeps its number: nobody else is asked to end.
            matches!(self.child.try_wait(), Ok(None)) && kill_process(pid, Signal::TERM).is_ok()
        });
        while is_asked && begin.elapsed() < END_PATIENCE && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(POLL);
        }
        // One that has ended already has nothing left to be done about.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Writes both files into the folder, which is this user's alone as the root above it is.
fn write_files(folder: &Path, plan: &TunnelPlan) -> io::Result<()> {
    let transport = folder.join(TRANSPORT_FILE);
    DirBuilder::new().recursive(true).mode(0o700).create(transport.parent().unwrap_or(folder))?;
    fs::write(&transport, &plan.facts.transport_config)?;
    fs::write(folder.join(NETWORK_FILE), plan.network_config())
}

/// Ends the tunnel of a command that was killed: two of them would carry everything twice. It is known by the
/// folder in which it runs.
fn end_left_behind(folder: &Path) {
    let Some(pid) = left_behind(folder) else { return };
    let begin = Instant::now();
    let _ = kill_process(pid, Signal::TERM);
    while begin.elapsed() < END_PATIENCE && left_behind(folder).is_some() {
        std::thread::sleep(POLL);
    }
    if left_behind(folder).is_some() {
        let _ = kill_process(pid, Signal::KILL);
    }
}

fn left_behind(folder: &Path) -> Option<Pid> {
    let number: i32 = fs::read_to_string(folder.join(PID_FILE)).ok()?.trim().parse().ok()?;
    let runs_in = fs::read_link(format!("/proc/{number}/cwd")).ok()?;
    (runs_in == folder).then(|| Pid::from_raw(number)).flatten()
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;
    use std::path::{Path, PathBuf};
    use std::time::{Duration, Instant};

    use magsteer_hal::channels::{PrivateRoot, TunnelFacts};

    use super::super::{Side, TunnelPlan};
    use super::{PROGRAM, Tunnel, TunnelError, find};

    /// A stand-in for the program, of this version, that writes down its arguments and then lives on.
    fn program(folder: &Path, version: &str) -> PathBuf {
        let path = folder.join(PROGRAM);
        let text = format!(
            "#!/bin/sh\n[ \"$1\" = --version ] && echo 'tunnel {version}' && exit\n\
            trap 'echo > ../rig.asked; exit' TERM\n\
            echo \"$@\" > arguments.new && mv arguments.new arguments\nwhile :; do sleep 0.01; done\n"
        );
        fs::write(&path, text).expect("written");
        fs::set_permissions(&path, Permissions::from_mode(0o700)).expect("own file");
        path
    }

    fn awaited<T>(mut look: impl FnMut() -> Option<T>) -> T {
        let begin = Instant::now();
        loop {
            if let Some(found) = look() {
                return found;
            }
            assert!(begin.elapsed() < Duration::from_secs(20), "it did not come");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn missing_program_and_another_version_are_refused_with_how_to_get_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = Some(folder.path().as_os_str());
        for missing in [find(None, path), find(Some(&folder.path().join("no")), path), find(None, None)] {
            let refused = missing.expect_err("not there").to_string();
            assert!(refused.contains("cargo install --locked --version 0.10.0"), "{refused}");
        }
        let other = program(folder.path(), "0.9.3");
        let refused = find(None, path).expect_err("another version");
        assert!(
            matches!(&refused, TunnelError::Version { found, .. } if found == "tunnel 0.9.3"),
            "{refused}"
        );
        fs::set_permissions(&other, Permissions::from_mode(0o600)).expect("own file");
        assert!(matches!(find(None, path), Err(TunnelError::NoProgram(_))), "not to be executed");
        assert_eq!(
            find(None, Some(program(folder.path(), "0.10.0").parent().expect("a folder").as_os_str()))
                .expect("the right one"),
            other
        );
    }

    /// Goal: the child finds its files where it looks for them, and neither it nor they outlive the command;
    /// one that a killed command left behind is ended by the next.
    #[test]
    fn tunnel_runs_beside_its_files_and_ends_with_its_command() {
        let tools = tempfile::tempdir().expect("a folder");
        let program = program(tools.path(), "0.10.0");
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let facts = TunnelFacts::of(&endpoint).expect("facts");
        let side = Side::Watch { connect: "127.0.0.1:7447".parse().expect("an address") };
        let plan = TunnelPlan { rig: "rig".to_owned(), side, facts };
        let mut first = Tunnel::start(&program, &plan, &endpoint).expect("started");
        let folder = endpoint.root().join("rig.tunnel");
        let arguments = awaited(|| fs::read_to_string(folder.join("arguments")).ok());
        assert!(arguments.starts_with("--zenoh-config zenoh.json5 --poll "), "{arguments}");
        let written = |file: &str| fs::read_to_string(folder.join(file)).expect("there");
        assert_eq!(written("config/iceoryx2.toml"), plan.facts.transport_config);
        assert_eq!(written("zenoh.json5"), plan.network_config());
        assert!(first.ended().is_none());
        // As if the command of the first had been killed: nobody ends it but its follower.
        fs::remove_file(folder.join("arguments")).expect("there");
        let second = Tunnel::start(&program, &plan, &endpoint).expect("started");
        awaited(|| first.ended());
        std::mem::forget(first);
        let process = PathBuf::from(format!("/proc/{}", second.pid()));
        awaited(|| folder.join("arguments").exists().then_some(()));
        assert!(process.exists());
        // Both end as they are asked to: one that is killed could not say so.
        let asked = folder.with_extension("asked");
        fs::remove_file(&asked).expect("the first was asked");
        drop(second);
        assert!(!process.exists() && !folder.exists());
        assert!(asked.exists());
    }
}
