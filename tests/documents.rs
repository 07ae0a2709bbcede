//! Every command that a document shows, run as it stands there: in the order of the document, by a shell, in a folder that
//! looks like that of the sources.
//!
//! A line is run and has to end with 0, unless a table here says what else becomes of it: it keeps its terminal, it is
//! shortened because it takes minutes, or it is not run because it asks for another user, the network or a device. A row
//! that is in no document fails the test.
//!
//! No test judges how long anything took; each waits for a state, bounded only so that a failure ends.

#![cfg(all(feature = "sim", feature = "figures", feature = "record", feature = "shell"))]

mod process_support;

use std::fs;
use std::os::unix::fs::symlink;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use magsteer_hal::channels::PrivateRoot;
use process_support::{World, until};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// What becomes of a line.
#[derive(Debug, Clone, Copy)]
enum Way {
    /// Runs to its end, which is one of these codes.
    Ends(&'static [i32]),
    /// Keeps its terminal until Ctrl-C, which brings it to 130: at the end of the document, or before a line that is
    /// to have the rig for itself.
    Stays,
    /// As [`Way::Ends`] with 0, with every terminal free.
    Afresh,
    /// As [`Way::Stays`], with every terminal free.
    StaysAfresh,
    /// Asks for what is not here; says for what, or which test runs it.
    Elsewhere(&'static str),
}
use Way::{Afresh, Elsewhere, Ends, Stays, StaysAfresh};

/// A line that is not simply run: as it stands, with which words in place of which, and its way.
type Row = (&'static str, &'static [(&'static str, &'static str)], Way);

/// Two steps in place of eight.
const SHORT: &str = "description = \"two steps\"\naxis = [0.0, 1.0, 0.0]\nzero_direction = [0.0, 0.0, 1.0]\n\
    [[steps]]\ntarget_deg = { m1 = 90.0, m2 = 90.0 }\nduration_s = 2.5\n\
    [[steps]]\ntarget_deg = { m1 = 80.0, m2 = 100.0 }\nduration_s = 2.5\n";
/// Directions to plan for: a file that the README takes for the reader's own.
const TARGETS: &str = "m1x,m1y,m1z,m2x,m2y,m2z\n0.9800,0.0,0.1990,0.9800,0.0,-0.1990\n";

const BUILDS: Way = Elsewhere("builds what runs here");
const INSTALLS: Way = Elsewhere("asks for root and changes the machine; the units are held by systemd.rs");
const DRIVES: Way = Elsewhere("asks for a compiler or the network; hal_process.rs drives in each language");
const TUNNELS: Way = Elsewhere(
    "asks for the transport's tunnel and another machine; two_machines.py runs it, tunnel_process.rs without",
);
const WEIGHED: Way = Ends(&[0, 1]);

const README: &[Row] = &[
    (
        "cargo run --release -- demo",
        &[("cargo run --release --", "magsteer"), ("demo", "demo --experiment short.toml")],
        Ends(&[0]),
    ),
    ("cargo test --workspace", &[], Elsewhere("runs this")),
    ("magsteer sim-plant config/bigmag-planar.toml", &[], Stays),
    ("magsteer run config/bigmag-planar.toml", &[], Stays),
    ("magsteer status --watch", &[], Stays),
    (
        "magsteer target play config/experiments/planar.toml",
        &[("config/experiments/planar.toml", "short.toml")],
        Ends(&[0]),
    ),
    ("magsteer plan config/bigmag-3d.toml --cone 30 --count 200 --seed 7", &[("200", "1")], WEIGHED),
    (
        "magsteer plan config/bigmag-3d.toml --cone 30 --count 200 --seed 7 --best-fixed",
        &[("200", "1")],
        WEIGHED,
    ),
    ("magsteer reach config/bigmag-3d.toml --cone 60 --samples 400", &[("400", "2")], Ends(&[0])),
    (
        "magsteer campaign config/bigmag-planar.toml --runs 200 --seed 1",
        &[("200", "2 --experiment short.toml --out runs/campaign")],
        Ends(&[0]),
    ),
    (
        "magsteer campaign config/bigmag-planar.toml --resume runs/campaign-20261122-031500",
        &[("campaign-20261122-031500", "campaign --experiment short.toml --runs 2")],
        Ends(&[0]),
    ),
    (
        "magsteer campaign config/bigmag-planar.toml --resume runs/campaign-20261122-031500 --only 17",
        &[("campaign-20261122-031500", "campaign --experiment short.toml"), ("17", "1")],
        Ends(&[0]),
    ),
    (
        "magsteer sim-plant config/bigmag-planar.toml --allow-faults --fault-plan config/faults/tour.toml",
        &[],
        StaysAfresh,
    ),
    (
        "magsteer soak config/bigmag-planar.toml --hours 8 --fail-on 'missed>0,lateness_p9999_us>200,\
         rss_growth_mb>5,alloc_in_cycle>0,trips>0,unsettled>0'",
        &[
            ("--hours 8", "--minutes 0.1 --experiment short.toml"),
            ("missed>0,lateness_p9999_us>200", "missed>1000000"),
        ],
        Afresh,
    ),
];

const GUIDE: &[Row] = &[
    ("magsteer doctor", &[], WEIGHED),
    ("magsteer demo", &[("demo", "demo --experiment short.toml")], Ends(&[0])),
    (
        "magsteer demo --config my-rig/rig.toml --experiment my-rig/experiments/planar.toml",
        &[("my-rig/experiments/planar.toml", "short.toml")],
        Ends(&[0]),
    ),
    ("magsteer sim-plant my-rig/rig.toml", &[], Stays),
    ("magsteer run my-rig/rig.toml --record my-rig/run --description \"the first ten minutes\"", &[], Stays),
    ("magsteer top my-rig/rig.toml", &[], Elsewhere("asks for a terminal; top_process.rs has one")),
    (
        "magsteer target play my-rig/experiments/planar.toml --config my-rig/rig.toml",
        &[("my-rig/experiments/planar.toml", "short.toml")],
        Ends(&[0]),
    ),
    ("magsteer runs show my-rig/run", &[], Afresh),
    ("magsteer reach config/bigmag-3d.toml --cone 30 --samples 100", &[("100", "2")], Ends(&[0])),
    ("magsteer plan config/bigmag-3d.toml --cone 30 --count 10 --seed 7", &[("10", "1")], WEIGHED),
    (
        "magsteer soak config/bigmag-planar.toml --minutes 30 --fail-on 'alloc_in_cycle>0,rss_growth_mb>5,\
         trips>0,unsettled>0'",
        &[("--minutes 30", "--minutes 0.1 --experiment short.toml")],
        Afresh,
    ),
    ("magsteer tunnel share config/bigmag-planar.toml", &[], TUNNELS),
    ("magsteer tunnel watch config/bigmag-planar.toml &", &[], TUNNELS),
    ("magsteer status config/bigmag-planar.toml", &[], TUNNELS),
    ("magsteer record config/bigmag-planar.toml --out runs/from-afar", &[], TUNNELS),
];

const YOUR_DRIVER: &[Row] = &[
    ("magsteer hal conformance config/bigmag-planar.toml --level dummy-load", &[], DRIVES),
    (
        "magsteer hal new my-driver --lang rust --config config/bigmag-planar.toml --dir /tmp",
        &[("/tmp", "tmp")],
        Ends(&[0]),
    ),
    ("magsteer hal udp-driver config/bigmag-planar.toml --device 127.0.0.1:9077 &", &[], DRIVES),
];

/// Programs of others, where a document names them.
const OTHERS: [(&str, Way); 11] = [
    ("sudo ", INSTALLS),
    ("journalctl ", INSTALLS),
    ("cargo install", TUNNELS),
    ("ssh ", TUNNELS),
    ("cargo build", BUILDS),
    ("cargo test", BUILDS),
    ("python3 ", DRIVES),
    ("my-driver/", DRIVES),
    ("my-device/", DRIVES),
    ("/tmp/my-driver/", DRIVES),
    ("make ", DRIVES),
];

/// The lines of a document's shell blocks, without remarks, and continued ones as one.
fn shown(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let (mut is_shell, mut begun) = (false, String::new());
    for line in text.lines().map(str::trim) {
        if line.starts_with("```") {
            is_shell = line == "```sh";
        } else if is_shell {
            begun += line.split(" #").next().unwrap_or(line).trim_end();
            match begun.strip_suffix('\\') {
                Some(part) => begun = part.to_owned(),
                None => lines.push(std::mem::take(&mut begun)),
            }
        }
    }
    lines.retain(|line| !line.is_empty());
    lines
}

#[test]
fn lines_are_found_as_a_reader_copies_them() {
    let text =
        "```sh\nmagsteer arm && magsteer \\\n  stop # remark\n\n```\nmagsteer no\n  ```sh\n  a 'b'\n  ```\n";
    assert_eq!(shown(text), ["magsteer arm && magsteer stop", "a 'b'"]);
}

/// A reader with a document: a folder, a home, a rig of its own, and terminals that are kept.
struct Reader {
    folder: PathBuf,
    root: PrivateRoot,
    /// Line and child of each, the newest last.
    kept: Vec<(String, Child)>,
}

impl Reader {
    fn new() -> Self {
        let root = PrivateRoot::create("ms").expect("shared memory is there");
        let folder = root.path().join("sources");
        let sources = Path::new(env!("CARGO_MANIFEST_DIR"));
        fs::create_dir_all(folder.join("tmp")).expect("own folder");
        for shared in ["config", "tests", "hal"] {
            symlink(sources.join(shared), folder.join(shared)).expect("own folder");
        }
        for (name, text) in [("short.toml", SHORT), ("targets.csv", TARGETS)] {
            fs::write(folder.join(name), text).expect("own folder");
        }
        Self { folder, root, kept: Vec::new() }
    }

    /// A line for a shell that finds `magsteer`.
    fn shell(&self, line: &str) -> Command {
        let built = Path::new(env!("CARGO_BIN_EXE_magsteer")).parent().expect("a folder");
        let path = format!("{}:{}", built.display(), std::env::var("PATH").unwrap_or_default());
        let mut command = Command::new("sh");
        command.args(["-c", line]).current_dir(&self.folder).stdin(Stdio::null());
        let own = [("HOME", &self.folder), ("MAGSTEER_ROOT", &self.root.path().to_owned())];
        command.envs(own).env("PATH", path);
        command
    }

    /// Runs a line to its end.
    fn runs(&self, line: &str, codes: &[i32]) {
        let output = self.shell(line).output().expect("a shell");
        let code = output.status.code();
        assert!(
            code.is_some_and(|code| codes.contains(&code)),
            "`{line}` ended with {code:?}:\n{}",
            said(&output)
        );
    }

    /// Starts a line in a terminal that it keeps, and waits until whoever would type the next one may.
    fn keeps(&mut self, line: &str) {
        let log = fs::File::create(self.folder.join(format!("terminal-{}.log", self.kept.len())))
            .expect("own folder");
        let output = || Stdio::from(log.try_clone().expect("a descriptor"));
        let mut command = self.shell(&format!("exec {line}"));
        let child = command.stdout(output()).stderr(output()).spawn().expect("a shell");
        self.kept.push((line.to_owned(), child));
        if let Some(file) = line.strip_prefix("magsteer run ") {
            let file = file.split(' ').next().expect("a file");
            let idle = || {
                let output = self.shell(&format!("magsteer status {file} --json")).output().expect("a shell");
                let status: Value = serde_json::from_slice(&output.stdout).ok()?;
                let is_fresh = status["pose_age_us"].as_f64().is_some_and(|age| age < 50_000.0);
                (status["state"] == "idle" && is_fresh).then_some(())
            };
            until(idle, || self.logs());
        }
    }

    /// Ctrl-C in every terminal, the last one first.
    fn interrupts(&mut self) {
        let (signal, expected) = if is_in_background() { (Signal::TERM, 143) } else { (Signal::INT, 130) };
        while let Some((line, mut child)) = self.kept.pop() {
            // What ended before its time has said so.
            let _ = kill_process(Pid::from_child(&child), signal);
            let ended = until(|| child.try_wait().expect("a child"), || format!("`{line}` runs on"));
            let log = fs::read_to_string(self.folder.join(format!("terminal-{}.log", self.kept.len())));
            // A shell says of one that a signal ended 128 and the signal's number.
            let code = ended.code().or_else(|| Some(128 + ended.signal()?));
            assert_eq!(code, Some(expected), "`{line}`:\n{}", log.unwrap_or_default());
        }
    }

    fn logs(&self) -> String {
        let log =
            |index| fs::read_to_string(self.folder.join(format!("terminal-{index}.log"))).unwrap_or_default();
        (0..self.kept.len()).map(log).collect()
    }

    fn goes(&mut self, line: &str, way: Way) {
        println!("{line}");
        if matches!(way, Afresh | StaysAfresh) {
            self.interrupts();
        }
        match way {
            Ends(codes) => self.runs(line, codes),
            Afresh => self.runs(line, &[0]),
            Stays | StaysAfresh => self.keeps(line),
            Elsewhere(why) => println!("    not run here: {why}"),
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        for (_, child) in &mut self.kept {
            // Of a failed test; either way nothing is to remain.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// True where this test was started in the background of a script: interrupts are ignored then, and by all that it starts.
fn is_in_background() -> bool {
    let status = fs::read_to_string("/proc/self/status").expect("proc(5)");
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).expect("proc(5)");
    let ignored = u64::from_str_radix(ignored.trim(), 16).expect("a mask");
    ignored & 1 << (Signal::INT.as_raw() - 1) != 0
}

fn said(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

/// Follows a document from its begin to its end.
fn follow(document: &str, text: &str, rows: &[Row]) {
    // Holds the place of the one rig that runs at a time.
    let _alone = World::new();
    let lines = shown(text);
    for (line, _, _) in rows {
        assert!(lines.iter().any(|shown| shown == line), "{document} shows no `{line}`");
    }
    let mut reader = Reader::new();
    for line in &lines {
        let row = rows.iter().find(|(shown, _, _)| shown == line);
        let other = OTHERS.iter().find(|(program, _)| line.starts_with(program));
        match (row, other) {
            (Some((_, words, way)), _) => {
                let replace = |line: String, (old, new): &(&str, &str)| {
                    assert!(line.contains(old), "`{line}` has no `{old}`");
                    line.replacen(old, new, 1)
                };
                reader.goes(&words.iter().fold(line.clone(), replace), *way);
            }
            (None, Some((_, way))) => reader.goes(line, *way),
            (None, None) if line.starts_with("kill %") => (),
            (None, None) => {
                let is_known = ["magsteer ", "mkdir "].iter().any(|program| line.starts_with(program));
                assert!(is_known, "{document}: what is `{line}`?");
                reader.goes(line, Ends(&[0]));
            }
        }
    }
    reader.interrupts();
}

#[test]
fn commands_of_the_readme_do_what_it_says() {
    follow("README.md", include_str!("../README.md"), README);
}

#[test]
fn commands_of_the_guide_do_what_it_says() {
    follow("src/docs/guide.md", include_str!("../src/docs/guide.md"), GUIDE);
}

#[test]
fn commands_about_drivers_do_what_they_say() {
    follow("hal/docs/your-driver.md", include_str!("../hal/docs/your-driver.md"), YOUR_DRIVER);
}
