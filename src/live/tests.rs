//! What viewers show, from statuses made here.

use std::path::Path;
use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::channels::{OperatorServices, PrivateRoot};
use magsteer_hal::operator::{Cause, StatusMessage, recorder, state};
use nalgebra::Vector3;

use super::history::History;
use super::{Alert, Angles, Figures, Level, Lifeline, Link, Rig, RodFigures, RodModel, RodSource, Viewer};
use crate::config::Config;

fn config(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(name);
    Config::load(&path).expect("a shipped file").1
}

fn at(milliseconds: u64) -> Stamp {
    Stamp::from_nanoseconds(1_000_000_000 + milliseconds * 1_000_000)
}

/// A status of the planar rig at rest, its magnets seen where the model has them.
fn status_at_rest(rig: &Rig, model: &mut RodModel) -> StatusMessage {
    let mut status = StatusMessage { description_fingerprint: rig.fingerprint, ..StatusMessage::default() };
    let drawn = model.draw(&status, true);
    for (magnet, [start, end]) in drawn.magnets_mm.iter().enumerate() {
        let [start, end] = [start, end].map(|end| Vector3::from(*end) * 1e-3);
        status.measured_position_m[magnet] = ((start + end) / 2.0).into();
        status.measured_direction[magnet] = (end - start).normalize().into();
    }
    status
}

fn planar() -> (Config, Rig) {
    let config = config("bigmag-planar.toml");
    let rig = Rig::new(&config);
    (config, rig)
}

fn figures(rig: &Rig, status: &StatusMessage) -> Figures {
    Figures::new(rig, Some(status), (Link::Attached, Some(0.01), 0), RodFigures::default())
}

#[test]
fn directions_are_told_by_one_angle_where_all_lies_in_a_plane_and_by_two_elsewhere() {
    for (name, expected) in [
        ("bigmag-planar.toml", Angles::Planar),
        ("bigmag-parallel.toml", Angles::Planar),
        ("bigmag-3d.toml", Angles::Spatial),
        ("bigmag-14.toml", Angles::Spatial),
    ] {
        assert_eq!(Rig::new(&config(name)).angles, expected, "{name}");
    }
}

#[test]
fn angles_and_directions_are_each_others_inverse() {
    let (_, planar) = planar();
    let close = |one: &[f64], other: &[f64]| one.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-9);
    let along_x = planar.direction(&[90.0]).expect("fits");
    assert!(close(&along_x, &[1.0, 0.0, 0.0]), "about y, 90 deg points along x: {along_x:?}");
    for angle in [-170.0, -20.0, 0.0, 45.0, 110.0, 180.0] {
        let direction = planar.direction(&[angle]).expect("fits");
        assert!(close(planar.angles_deg(&direction).as_slice(), &[angle]), "{angle}");
    }
    let spatial = Rig::new(&config("bigmag-3d.toml"));
    for angles in [[30.0, -120.0], [90.0, 0.0], [150.0, 75.0]] {
        let direction = spatial.direction(&angles).expect("fits");
        assert!((Vector3::from(direction).norm() - 1.0).abs() < 1e-12);
        assert!(close(spatial.angles_deg(&direction).as_slice(), &angles), "{angles:?}");
    }
    assert!(planar.angles_deg(&[0.0; 3]).as_slice().is_empty(), "no direction, no angle");
    for wrong in [&[][..], &[1.0, 2.0], &[f64::NAN], &[361.0]] {
        assert_eq!(planar.direction(wrong), None, "{wrong:?}");
    }
}

#[test]
fn link_follows_absence_silence_and_return_and_counts_lives() {
    let mut lifeline = Lifeline::new(100.0);
    assert_eq!(lifeline.link(false, at(0)), Link::Absent);
    assert_eq!(lifeline.link(true, at(0)), Link::Waiting);
    let mut status = StatusMessage::default();
    (status.header.epoch, status.header.publish_stamp_ns) = (7, at(0).nanoseconds());
    assert!(!lifeline.heard(&status.header), "the first life is no restart");
    assert_eq!(lifeline.link(true, at(400)), Link::Attached);
    assert_eq!(lifeline.link(true, at(600)), Link::Stale);
    assert_eq!(lifeline.link(false, at(9_000)), Link::Stale, "what is shown stays, as old");
    (status.header.epoch, status.header.publish_stamp_ns) = (8, at(9_000).nanoseconds());
    assert!(lifeline.heard(&status.header), "another epoch is another life");
    assert_eq!((lifeline.link(true, at(9_001)), lifeline.restarts()), (Link::Attached, 1));
    assert_eq!(
        Lifeline::new(1.0).silence_of(&status, at(12_000)),
        Link::Attached,
        "a slow status is not a silence"
    );
}

impl Lifeline {
    fn silence_of(mut self, status: &StatusMessage, now: Stamp) -> Link {
        self.heard(&status.header);
        self.link(true, now)
    }
}

#[test]
fn history_keeps_a_minute_of_samples_and_loses_no_lateness() {
    let (_, rig) = planar();
    let mut history = History::new();
    let mut status = StatusMessage::default();
    for millisecond in (0..70_000).step_by(10) {
        status.header.source_stamp_ns = at(millisecond).nanoseconds();
        status.lateness_max_us = if millisecond == 69_880 { 500.0 } else { 20.0 };
        history.take(&rig, &status);
    }
    assert_eq!((history.samples().len(), history.taken()), (1_200, 1_400));
    let latest: Vec<f64> = history.since(1_397).map(|sample| sample.lateness_max_us).collect();
    assert_eq!(latest, [20.0, 500.0, 20.0], "the late cycle lies between two samples");
    let mut times = history.samples().map(|sample| sample.time_s);
    let first = times.next().expect("full");
    assert!((times.next_back().expect("full") - first - 59.95).abs() < 1e-6);
    assert_eq!(history.since(0).count(), 1_200);
}

#[test]
fn rod_is_the_models_where_magnets_agree_and_a_curve_through_them_where_they_do_not() {
    let (config, rig) = planar();
    let mut model = RodModel::new(&config);
    let mut status = status_at_rest(&rig, &mut model);
    let drawn = model.draw(&status, true);
    assert_eq!(drawn.source, RodSource::Model);
    assert_eq!(drawn.line_mm[0], [-55.0, 0.0, 0.0], "it begins at the clamp");
    let tip = drawn.line_mm.last().expect("a line");
    assert_eq!(*tip, drawn.magnets_mm[1][1], "it ends at the end of the last magnet");
    let length: f64 = drawn.line_mm.windows(2).map(|pair| distance(&pair[0], &pair[1])).sum();
    assert!((length - 60.0).abs() < 0.1, "25 + 5 + 25 + 5 mm: {length}");
    let measured = drawn.measured_mm[0].expect("seen");
    assert!(distance(&measured[0], &drawn.magnets_mm[0][0]) < 0.01);
    // Without a model a curve goes through the magnets, close to where the model has the rod.
    let mut without = RodModel::new(&Config { manipulator: None, ..config });
    let curve = without.draw(&status, true);
    assert_eq!(curve.source, RodSource::Measured);
    let middle = at_length(&drawn.line_mm, 12.5);
    assert!(distance(&curve.line_mm[6], &middle) < 0.2, "{:?} {middle:?}", curve.line_mm[6]);
    // A magnet that is seen to point elsewhere cannot be on the model's branch.
    let turned = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), 1.0);
    status.measured_direction[1] = (turned * Vector3::from(status.measured_direction[1])).into();
    assert_eq!(model.draw(&status, true).source, RodSource::Measured);
    assert_eq!(
        model.draw(&status, false).source,
        RodSource::None,
        "of another rig nothing is known but its magnets"
    );
    status.measured_position_m[0] = [0.0; 3];
    assert_eq!(model.draw(&status, true).source, RodSource::None, "a magnet was not seen");
}

/// The point of a polyline at a length along it.
fn at_length(line: &[[f64; 3]], length: f64) -> [f64; 3] {
    let mut left = length;
    for pair in line.windows(2) {
        let piece = distance(&pair[0], &pair[1]);
        if piece >= left {
            let [from, to] = [pair[0], pair[1]].map(Vector3::from);
            return (from + (to - from) * (left / piece)).into();
        }
        left -= piece;
    }
    *line.last().expect("a line")
}

fn distance(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    (Vector3::from(*one) - Vector3::from(*other)).norm()
}

#[test]
fn figures_mark_currents_at_their_limit_and_tell_errors_of_magnets() {
    let (_, rig) = planar();
    let mut status = StatusMessage { description_fingerprint: rig.fingerprint, ..StatusMessage::default() };
    (status.admitted.current_a[0], status.admitted.current_a[1]) = (-8.0, 7.9);
    (status.measured.current_a[0], status.measured.angle_rad[1]) = (-7.8, std::f64::consts::FRAC_PI_4);
    status.target_direction[0] = rig.direction(&[70.0]).expect("fits");
    status.measured_direction[0] = rig.direction(&[72.5]).expect("fits");
    let figures = figures(&rig, &status);
    assert_eq!(figures.coils[..2].iter().map(|coil| coil.saturated).collect::<Vec<_>>(), [true, false]);
    assert_eq!((figures.coils[0].measured_a, figures.coils[0].limit_a), (-7.8, 8.0));
    assert!((figures.frames[1].measured_deg - 45.0).abs() < 1e-12);
    assert!((figures.magnets[0].error_deg.expect("both are told") - 2.5).abs() < 1e-9);
    assert_eq!((figures.magnets[1].error_deg, figures.magnets[1].target_deg.len()), (None, 0));
}

#[test]
fn alerts_name_what_nobody_must_overlook_the_gravest_first() {
    let (_, rig) = planar();
    let told = |status: &StatusMessage| figures(&rig, status).alerts;
    let mut status = StatusMessage { description_fingerprint: rig.fingerprint, ..StatusMessage::default() };
    assert_eq!(told(&status), []);
    (status.state, status.cause, status.recorder) =
        (state::FAULT, Cause::PoseStale.code(), recorder::FAILING);
    let alerts = told(&status);
    assert_eq!(alerts[0].text, "fault: no fresh poses; reset when it is mended");
    assert_eq!(alerts.iter().map(|alert| alert.level).collect::<Vec<_>>(), [Level::Grave, Level::Warning]);
    status.description_fingerprint ^= 1;
    assert!(told(&status).iter().any(|Alert { text, .. }| text.contains("another configuration")));
    let silent = Figures::new(&rig, Some(&status), (Link::Stale, Some(12.3), 0), RodFigures::default());
    assert_eq!(silent.alerts[0].text, "no word from the daemon for 12 s: what is shown is old");
}

/// Goal: the whole way over real channels, with time as this test wants it.
#[test]
fn viewer_attaches_notices_silence_and_attaches_again_to_another_daemon() {
    let (config, rig) = planar();
    let root = PrivateRoot::create("lv").expect("shared memory is there");
    let endpoint = root.endpoint("bigmag-planar").expect("short and own");
    let mut viewer = Viewer::new(endpoint.clone(), &config, None);
    let start = Stamp::now();
    viewer.look(start);
    assert_eq!(viewer.link(start), Link::Absent);
    assert!(matches!(viewer.send(magsteer_hal::operator::verb::STOP), Err(super::Unsent::NoDaemon)));
    let mut now = start;
    for life in 0..2 {
        let services = OperatorServices::create(&endpoint).expect("nobody else serves this rig");
        let mut server = services.into_server().expect("joined");
        // Long after what went before, so that a silent channel is opened anew.
        now = now.after(Duration::from_secs(10));
        viewer.look(now);
        let mut status = StatusMessage {
            description_fingerprint: rig.fingerprint,
            cycle: 5 + u64::from(life),
            ..StatusMessage::default()
        };
        status.header.source_stamp_ns = now.nanoseconds();
        server.publish_status(status, now).expect("the transport works");
        viewer.look(now);
        let figures = viewer.figures(now, false);
        assert_eq!((figures.link, figures.cycle, figures.restarts), (Link::Attached, status.cycle, life));
        let later = now.after(Duration::from_secs(5));
        assert_eq!(viewer.figures(later, false).link, Link::Stale);
    }
    assert_eq!(viewer.history().taken(), 2);
    let misfit = viewer.set_target(&[vec![70.0]]).expect_err("two magnets").to_string();
    assert_eq!(misfit, "a target needs 1 finite angles for each of 2 magnets, within a turn");
}

#[test]
fn sixteen_viewers_look_at_one_daemon() {
    let (config, rig) = planar();
    let root = PrivateRoot::create("lv").expect("shared memory is there");
    let endpoint = root.endpoint("bigmag-planar").expect("short and own");
    let services = OperatorServices::create(&endpoint).expect("nobody else serves this rig");
    let mut server = services.into_server().expect("joined");
    let mut viewers: Vec<Viewer> = (0..16).map(|_| Viewer::new(endpoint.clone(), &config, None)).collect();
    let now = Stamp::now();
    viewers.iter_mut().for_each(|viewer| viewer.look(now));
    let status = StatusMessage { description_fingerprint: rig.fingerprint, ..StatusMessage::default() };
    server.publish_status(status, now).expect("the transport works");
    for viewer in &mut viewers {
        viewer.look(now);
        assert_eq!(viewer.link(now), Link::Attached);
    }
}
