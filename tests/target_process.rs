//! `magsteer target` as a user meets it: dry runs, waiting until settled, scripts, streams.
//!
//! No test judges how long anything took; waits are bounded only so that a failure ends.

mod process_support;

use std::io::Write;
use std::process::{Command, Output, Stdio};

use magsteer_hal::operator::{Cause, state, verb};
use process_support::World;
use serde_json::Value;

fn target(world: &World, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.arg("target").args(arguments).arg("--config").arg(&world.file);
    command.arg("--root").arg(world.root.path());
    command
}

fn answer(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text:?}"))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn output(mut command: Command) -> Output {
    command.output().expect("the program is built")
}

#[test]
fn dry_runs_need_no_daemon_and_name_the_step_that_the_rod_does_not_survive() {
    let world = World::new();
    let found = output(target(
        &world,
        &["set", "m1=70deg", "m2=0.94,0,-0.34", "--axis", "0,1,0", "--dry-run", "--json"],
    ));
    assert_eq!(found.status.code(), Some(0), "{}", said(&found));
    let run = answer(&found);
    assert_eq!((&run["ok"], &run["begins_at"]), (&true.into(), &"rest".into()), "{run}");
    let step = &run["steps"][0];
    assert_eq!(step["verdict"], "reached", "{run}");
    assert!(step["error_deg"].as_f64().is_some_and(|error| error < 1.0), "{run}");
    assert!(step["current_max_a"].as_f64().is_some_and(|current| current > 0.5 && current < 8.0), "{run}");
    assert!(step["stability_margin"].as_f64().is_some_and(|margin| margin > 0.1 && margin < 1.0), "{run}");

    let script = world.root.path().join("steps.csv");
    std::fs::write(&script, "duration_s,m1_deg,m2_deg\n1,90,90\n1,10,170\n1,90,90\n").expect("own directory");
    let script = script.to_str().expect("UTF-8");
    let found = output(target(&world, &["play", script, "--dry-run", "--json"]));
    assert_eq!(found.status.code(), Some(1), "{}", said(&found));
    let run = answer(&found);
    let verdicts: Vec<&str> =
        run["steps"].as_array().expect("steps").iter().filter_map(|step| step["verdict"].as_str()).collect();
    assert_eq!(verdicts, ["reached", "near-snap-through", "not-looked-at"], "{run}");
    assert!(run["steps"][1]["share"].as_f64().is_some_and(|share| share > 0.0 && share < 1.0), "{run}");

    let found = output(target(&world, &["set", "m1=70deg"]));
    assert_eq!(found.status.code(), Some(69), "without a daemon nothing is set: {}", said(&found));
}

#[test]
fn scripts_and_streams_steer_a_running_rig_and_bad_ones_move_nothing() {
    let world = World::new();
    let (_plant, _daemon) = (world.plant(), world.daemon());
    let mut operator = world.operator();
    operator.steer();

    let settled = output(target(&world, &["set", "m1=80deg", "m2=95deg", "--wait", "settled", "--json"]));
    assert_eq!(settled.status.code(), Some(0), "{}", said(&settled));
    let step = &answer(&settled)["steps"][0];
    assert_eq!(answer(&settled)["all_settled"], true);
    // The last second of a step that ends as soon as it has settled holds its way; its end does not.
    for magnet in 0..2 {
        let rms = |key: &str| step[key][magnet].as_f64().expect("a number");
        assert!(rms("error_end_rms_deg") < 1.0 && rms("error_end_rms_deg") <= rms("error_rms_deg"), "{step}");
    }
    assert!(said(&settled).contains("of  80.0 deg, m2 "), "each magnet by its name: {}", said(&settled));

    // Of a step that did not begin nothing is told but why.
    let refused = output(target(&world, &["set", "m1=10deg", "m2=170deg", "--wait", "settled"]));
    assert_eq!(refused.status.code(), Some(1), "{}", said(&refused));
    assert!(
        said(&refused).contains("was refused") && !said(&refused).contains("measured"),
        "{}",
        said(&refused)
    );

    // Refused before anything moves: in the model, and because of what stands in the file.
    let before = operator.until(|_| true).target_direction;
    let script = world.root.path().join("steps.csv");
    let script_name = script.to_str().expect("UTF-8");
    for (text, code, told) in [
        ("duration_s,m1_deg,m2_deg\n1,85,90\n1,10,170\n", 1, "nothing was moved"),
        ("duration_s,m1_deg,m2_deg\n1,85,90\n1,85,370\n", 65, "steps.csv:3: target_deg.m2: 370"),
    ] {
        std::fs::write(&script, text).expect("own directory");
        let refused = output(target(&world, &["play", script_name]));
        assert_eq!(refused.status.code(), Some(code), "{}", said(&refused));
        assert!(said(&refused).contains(told), "{}", said(&refused));
    }
    assert_eq!(operator.until(|_| true).target_direction, before);

    // A step that ends when it has settled, long before its time.
    std::fs::write(&script, "duration_s,m1_deg,m2_deg,until\n3000,90,90,settled\n3000,80,95,settled\n")
        .expect("own directory");
    let played = output(target(&world, &["play", script_name, "--json"]));
    assert_eq!(played.status.code(), Some(0), "{}", said(&played));
    assert_eq!(answer(&played)["steps"].as_array().map(Vec::len), Some(2));

    let mut child = target(&world, &["stream", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is built");
    let mut input = child.stdin.take().expect("piped");
    for angle in 80..90 {
        writeln!(input, "{{\"target_deg\": {{\"m1\": {angle}}}}}").expect("it reads");
    }
    drop(input);
    let streamed = child.wait_with_output().expect("it ends with its input");
    assert_eq!(streamed.status.code(), Some(0), "{}", said(&streamed));
    let tally = answer(&streamed);
    let count = |key: &str| tally[key].as_u64().expect("a count");
    assert_eq!((count("lines"), count("sent") + count("skipped")), (10, 10), "{tally}");
    let held = operator.until_state(state::HOLDING);
    assert_eq!(held.cause, Cause::StreamEnded.code());
    assert_eq!(operator.ask(verb::GO), Some(0), "an operator goes on");
    operator.until_state(state::ACTIVE);
}

/// Goal: `--plan` leads out of the plane, where no setting of the frames at zero steers, waits for an armed daemon's sake only, and
/// refuses steps that say where the frames shall stand.
#[test]
fn planned_ways_lead_out_of_the_plane_and_need_a_daemon_that_steers() {
    let world = World::new();
    let (_plant, _daemon) = (world.plant(), world.daemon());
    let mut operator = world.operator();
    let aside = ["set", "m1=0.95,0.25,-0.17", "m2=0.5,0.3,-0.81", "--plan", "--json"];
    operator.until_state(state::IDLE);
    let idle = output(target(&world, &aside));
    assert_eq!(idle.status.code(), Some(1), "{}", said(&idle));
    assert!(said(&idle).contains("arm it and let it go"), "{}", said(&idle));

    operator.steer();
    let led = output(target(&world, &aside));
    assert_eq!(led.status.code(), Some(0), "{}", said(&led));
    assert_eq!(answer(&led)["all_settled"], true);
    let angles = operator.until(|_| true).measured.angle_rad;
    assert!(angles.iter().any(|angle| angle.abs() > 0.1), "the frames were turned: {angles:?}");

    // Who holds the rig has the last word: nothing is led on, let go or armed again.
    assert_eq!(operator.ask(verb::HOLD), Some(0));
    operator.until_state(state::HOLDING);
    let held = output(target(&world, &["set", "m1=0.9,-0.3,0.316", "m2=0.6,0.3,-0.742", "--plan"]));
    assert_eq!(held.status.code(), Some(1), "{}", said(&held));
    assert!(said(&held).contains("the daemon holds"), "{}", said(&held));
    assert_eq!(operator.until(|_| true).state, state::HOLDING);
    assert_eq!(operator.ask(verb::GO), Some(0));
    operator.until_state(state::ACTIVE);

    let script = world.root.path().join("aside.csv");
    let header = "duration_s,m1x,m1y,m1z,m2x,m2y,m2z";
    let script_name = script.to_str().expect("UTF-8");
    std::fs::write(&script, format!("{header},bottom_deg,top_deg\n1,0.9,0.3,0.316,0.6,-0.3,-0.742,10,20\n"))
        .expect("own directory");
    let refused = output(target(&world, &["play", script_name, "--plan"]));
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    assert!(said(&refused).contains("step 1 says where the frames shall stand"), "{}", said(&refused));

    std::fs::write(&script, format!("{header}\n1,0.95,0.25,-0.18,0.6,0.3,-0.742\n")).expect("own directory");
    let played = output(target(&world, &["play", script_name, "--plan", "--json"]));
    assert_eq!(played.status.code(), Some(0), "{}", said(&played));
    assert_eq!(answer(&played)["steps"].as_array().map(Vec::len), Some(1));

    // A dry run begins where the daemon's model is: hardly anything is left to be walked to the same target.
    let dry =
        output(target(&world, &["set", "m1=0.95,0.25,-0.18", "m2=0.6,0.3,-0.742", "--dry-run", "--json"]));
    assert_eq!(dry.status.code(), Some(0), "{}", said(&dry));
    let (told, status) = (answer(&dry), operator.until(|_| true));
    assert_eq!(told["begins_at"], "present");
    let step = &told["steps"][0];
    let number = |key: &str| step[key].as_f64().expect("a number");
    let currents = status.modelled.current_a.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
    assert!(currents > 0.1 && (number("current_max_a") - currents).abs() < 0.5, "{currents} A, {step}");
    assert!((number("stability_margin") - status.stability_margin).abs() < 0.1, "{step}");
}
