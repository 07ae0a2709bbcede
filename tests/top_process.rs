//! `magsteer top` in a terminal of its own: how it leaves. Python's standard library has pseudoterminals.
#![cfg(feature = "top")]

use std::path::Path;
use std::process::Command;

use magsteer_hal::channels::PrivateRoot;

/// Starts the command behind a pseudoterminal of 80 x 24, waits until it shows its screen, does what is asked, and prints
/// how it ended and what the terminal was left as.
const SCRIPT: &str = r#"
import fcntl, os, pty, select, signal, struct, sys, termios, time
act, command = sys.argv[1], sys.argv[2:]
pid, terminal = pty.fork()
if pid == 0:
    os.execv(command[0], command)
fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
seen, end = b"", time.monotonic() + 30
while b"no daemon serves this rig" not in seen and time.monotonic() < end:
    if select.select([terminal], [], [], 0.1)[0]:
        seen += os.read(terminal, 65536)
if act == "hang-up":
    os.close(terminal)
elif act == "terminate":
    os.kill(pid, signal.SIGTERM)
else:
    os.write(terminal, {"q": b"q", "ctrl-c": b"\x03"}[act])
while time.monotonic() < end:
    if act != "hang-up" and select.select([terminal], [], [], 0.05)[0]:
        try:
            seen += os.read(terminal, 65536)
        except OSError:
            pass
    done, status = os.waitpid(pid, os.WNOHANG)
    if done:
        left = seen.rfind(b"\x1b[?1049l") > seen.rfind(b"\x1b[?1049h")
        print("ended", os.waitstatus_to_exitcode(status), "clean" if left else "within its screen")
        break
    time.sleep(0.05)
else:
    os.kill(pid, signal.SIGKILL)
    print("did not end")
"#;

/// What the script prints; `None` without Python.
fn ended(act: &str) -> Option<String> {
    let root = PrivateRoot::create("tp").expect("shared memory is there");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    let mut python = Command::new("python3");
    python.args(["-c", SCRIPT, act, env!("CARGO_BIN_EXE_magsteer"), "top"]).arg(file);
    let Ok(output) = python.arg("--root").arg(root.path()).env("TERM", "xterm").output() else {
        println!("skipped: python3 cannot be run");
        return None;
    };
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    assert!(!text.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(text)
}

#[test]
fn q_and_ctrl_c_leave_the_terminal_as_it_was() {
    for act in ["q", "ctrl-c"] {
        assert!(ended(act).is_none_or(|text| text == "ended 0 clean"), "{act}: {:?}", ended(act));
    }
}

#[test]
fn a_signal_leaves_the_terminal_as_it_was() {
    assert!(ended("terminate").is_none_or(|text| text == "ended 143 clean"), "{:?}", ended("terminate"));
}

/// Goal: a viewer whose window was closed does not go on reading for ever, on a core that the loop may need.
#[test]
fn a_terminal_that_is_gone_ends_it() {
    assert!(ended("hang-up").is_none_or(|text| text.starts_with("ended")), "it went on");
}
