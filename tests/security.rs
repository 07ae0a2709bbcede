//! Who can reach a running rig: its own user, and nobody over a network.
//!
//! As root a second process is started under another user, with the same program. Without root that part says so, and what
//! remains are the access rights of every file that the rig has.

#![cfg(feature = "sim")]

mod process_support;

use std::fs::{self, Permissions};
use std::net::{TcpListener, UdpSocket};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use magsteer_hal::operator::Cause;
use process_support::World;
use sha2::{Digest, Sha256};
use tempfile::TempDir;

/// A user with no rights: `nobody`.
const STRANGER: u32 = 65_534;

/// Tries to read a byte of each file named, and to open it for writing.
const TRY_FILES: &str = r#"for file do
    if head -c 1 "$file" >/dev/null 2>&1; then echo "read $file"; fi
    if (: >> "$file") 2>/dev/null; then echo "wrote $file"; fi
done"#;

/// Segments of a world's root: their names hold a digest of its path.
fn segments(world: &World) -> Vec<PathBuf> {
    let digest = Sha256::digest(world.root.path().as_os_str().as_encoded_bytes());
    let mark = format!("_{:02x}{:02x}{:02x}{:02x}_", digest[0], digest[1], digest[2], digest[3]);
    let entries = fs::read_dir("/dev/shm").expect("shared memory is there").flatten();
    let of_world = |path: &PathBuf| path.to_str().is_some_and(|path| path.contains(&mark));
    entries.map(|entry| entry.path()).filter(of_world).collect()
}

fn mode(path: &Path) -> u32 {
    fs::symlink_metadata(path).expect("is there").permissions().mode() & 0o7777
}

/// A copy of the program that any user can start, in a directory that any user can enter.
fn public_program() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().expect("a directory");
    fs::set_permissions(directory.path(), Permissions::from_mode(0o755)).expect("own directory");
    let program = directory.path().join("magsteer");
    fs::copy(env!("CARGO_BIN_EXE_magsteer"), &program).expect("the program is built");
    fs::set_permissions(&program, Permissions::from_mode(0o755)).expect("own file");
    (directory, program)
}

fn as_stranger(command: &mut Command) -> Output {
    command.uid(STRANGER).gid(STRANGER).current_dir("/").output().expect("root may")
}

/// Proves SR-16.
#[test]
fn another_user_can_neither_read_nor_command_nor_open_a_segment() {
    let world = World::new();
    let mut plant = world.plant();
    let mut daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();

    let segments = segments(&world);
    assert!(segments.len() > 10, "{segments:?}");
    assert_eq!(mode(world.root.path()), 0o700);
    for segment in &segments {
        assert_eq!(mode(segment) & 0o077, 0, "{}", segment.display());
    }
    for entry in fs::read_dir(world.root.path()).expect("own directory").flatten() {
        let path = entry.path();
        assert!(
            path.extension().is_none_or(|ext| ext != "lock") || mode(&path) == 0o600,
            "{}",
            path.display()
        );
    }

    if rustix::process::getuid().is_root() {
        refuses_a_stranger(&world, &segments);
    } else {
        println!("no other user was tried: that takes root; access rights were checked");
    }
    // Still there, and not stopped or cut by anybody who asked.
    let cause = operator.until(|_| true).cause;
    assert!(![Cause::OperatorStop, Cause::EmergencyStop].map(Cause::code).contains(&cause), "{cause}");
    assert!(plant.runs() && daemon.runs());
}

fn refuses_a_stranger(world: &World, segments: &[PathBuf]) {
    let (directory, program) = public_program();
    let rig = world.config.description.rig.as_str();
    let root = world.root.path().to_str().expect("plain");
    for verb in ["status", "stop", "estop", "arm"] {
        let refused = as_stranger(Command::new(&program).args([verb, "--rig", rig, "--root", root]));
        let said = String::from_utf8_lossy(&refused.stderr);
        assert_eq!(refused.status.code(), Some(77), "{verb}: {said}");
        assert!(said.contains("belongs to user 0, this is user 65534"), "{verb}: {said}");
    }
    // In a world of its own there is no daemon.
    let own = directory.path().join("own");
    fs::create_dir(&own).expect("own directory");
    fs::set_permissions(&own, Permissions::from_mode(0o700)).expect("own directory");
    chown(&own, Some(STRANGER), Some(STRANGER)).expect("root may");
    let alone = as_stranger(Command::new(&program).args(["stop", "--rig", rig, "--root"]).arg(&own));
    assert_eq!(alone.status.code(), Some(69), "{}", String::from_utf8_lossy(&alone.stderr));

    let mut attempt = Command::new("sh");
    attempt.args(["-c", TRY_FILES, "sh"]).args(segments);
    let opened = as_stranger(&mut attempt);
    assert!(opened.status.success());
    assert_eq!(String::from_utf8_lossy(&opened.stdout), "", "opened by another user");
    // The attempt would have shown an open file.
    let public = directory.path().join("public");
    fs::write(&public, "x").expect("own directory");
    fs::set_permissions(&public, Permissions::from_mode(0o666)).expect("own file");
    let opened = as_stranger(Command::new("sh").args(["-c", TRY_FILES, "sh"]).arg(&public));
    assert_eq!(String::from_utf8_lossy(&opened.stdout).lines().count(), 2);
}

/// Sockets of a process that a network can reach, as `table:inode`.
fn network_sockets(pid: u32) -> Vec<String> {
    let own: Vec<String> = fs::read_dir(format!("/proc/{pid}/fd"))
        .expect("own process")
        .flatten()
        .filter_map(|entry| fs::read_link(entry.path()).ok()?.into_os_string().into_string().ok())
        .filter_map(|link| Some(link.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned()))
        .collect();
    let mut found = Vec::new();
    for table in ["tcp", "tcp6", "udp", "udp6", "udplite", "raw", "raw6", "packet", "icmp"] {
        let Ok(text) = fs::read_to_string(format!("/proc/{pid}/net/{table}")) else { continue };
        for line in text.lines().skip(1) {
            let mut words = line.split_whitespace();
            found.extend(
                words
                    .find(|word| own.iter().any(|inode| inode == word))
                    .map(|inode| format!("{table}:{inode}")),
            );
        }
    }
    found
}

/// Proves SR-17.
#[test]
fn daemon_and_plant_open_no_network_socket() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    for process in [&plant, &daemon] {
        assert_eq!(network_sockets(process.pid()), Vec::<String>::new());
    }
    // Sockets of this process would be found.
    let _listener = TcpListener::bind("127.0.0.1:0").expect("loopback is there");
    let _datagrams = UdpSocket::bind("127.0.0.1:0").expect("loopback is there");
    let mut own = network_sockets(std::process::id());
    own.sort();
    assert!(own.len() == 2 && own[0].starts_with("tcp:") && own[1].starts_with("udp:"), "{own:?}");
}
