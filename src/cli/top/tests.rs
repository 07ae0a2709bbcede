//! Screens for statuses made here, drawn into memory.

use magsteer::config::{Config, Document};
use magsteer::live::{EventFeed, Figures, History, Link, Rig, RodModel};
use magsteer_hal::operator::{Cause, OperatorAnswer, StatusMessage, state, verb};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::keys::{Action, HELP, Popup, SIGNS, Ui};
use super::panels::short_name;
use super::screen::Screen;

fn spatial() -> Config {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-14.toml");
    Config::load(&path).expect("shipped").1
}

fn config() -> Config {
    let text = include_str!("../../../config/bigmag-planar.toml");
    Config::from_document(&Document::from_text("planar", text).expect("shipped")).expect("shipped")
}

/// Twenty seconds of steering m1 from 90 to 70 deg, with one coil at its limit.
fn status(rig: &Rig, second: f64) -> StatusMessage {
    let mut status = StatusMessage {
        state: state::ACTIVE,
        cycle: 20_000,
        rate_hz: 1_000.0,
        rate_measured_hz: 999.7,
        pose_age_us: 6_000.0,
        stability_margin: 0.73,
        model_converged: 1,
        description_fingerprint: rig.fingerprint,
        ..StatusMessage::default()
    };
    // Seconds and nanoseconds of a test: positive and small.
    status.header.source_stamp_ns = (second * 1e9) as u64;
    let angle = 70.0 + 20.0 * (-second).exp();
    for (directions, angle) in [
        (&mut status.target_direction, 70.0),
        (&mut status.desired_direction, angle),
        (&mut status.measured_direction, angle + 0.4),
        (&mut status.predicted_direction, angle - 0.4),
    ] {
        directions[0] = rig.direction(&[angle]).expect("fits");
        directions[1] = rig.direction(&[110.0]).expect("fits");
    }
    (status.measured.current_a[0], status.admitted.current_a[0]) = (-7.9, -8.0);
    (status.measured.current_a[4], status.admitted.current_a[4]) = (2.5, 2.6);
    status
}

struct Scene {
    rig: Rig,
    figures: Figures,
    history: History,
    events: EventFeed,
    _folder: tempfile::TempDir,
}

impl Scene {
    fn steering(link: Link) -> Self {
        let config = config();
        let rig = Rig::new(&config);
        let mut history = History::new();
        for sample in 0..400 {
            history.take(&rig, &status(&rig, 0.05 * f64::from(sample)));
        }
        let last = status(&rig, 20.0);
        let rod = RodModel::new(&config).draw(&StatusMessage::default(), true);
        let figures = Figures::new(&rig, Some(&last), (link, Some(0.01), 0), rod);
        let folder = tempfile::tempdir().expect("a directory");
        let line = r#"{"time":"2026-11-22T09:14:19.012345Z","rig":"bigmag-planar","event":"transition","from":"armed","to":"active"}"#;
        std::fs::write(folder.path().join("events.jsonl"), format!("{line}\n")).expect("own directory");
        let events = EventFeed::new("bigmag-planar", folder.path());
        Self { rig, figures, history, events, _folder: folder }
    }

    /// The screen as lines of text.
    fn draw(&self, ui: &Ui, width: u16, height: u16) -> Vec<String> {
        let Self { rig, figures, history, events, .. } = self;
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("memory");
        let screen = Screen { rig, figures, history, events: Some(events), ui };
        terminal.draw(|frame| screen.draw(frame)).expect("memory");
        let buffer = terminal.backend().buffer();
        let cell = |x: u16, y: u16| buffer[(x, y)].symbol();
        (0..height).map(|y| (0..width).map(|x| cell(x, y)).collect()).collect()
    }
}

fn is_braille(letter: char) -> bool {
    ('\u{2801}'..='\u{28ff}').contains(&letter)
}

#[test]
fn smallest_ordinary_terminal_shows_everything_that_was_promised() {
    let scene = Scene::steering(Link::Attached);
    let lines = scene.draw(&Ui::default(), 80, 24);
    let text = lines.join("\n");
    for word in [
        "bigmag-planar",
        "ACTIVE",
        "1000 of 1000 Hz",
        "margin 0.73",
        "attached",
        "m1",
        "m1 70.4/70.0",
        "m2 110.0/110.0",
        "measured target reference predicted",
        "circle 110 mm",
        "x-z",
        "x-y",
        "0 iro-bot-rig",
        "1 iro-bot-lef",
        "2 iro-top-rig",
        "-7.90 A",
        "0.0 of 0.0\u{b0} in -180..180",
        "lateness",
        "09:14:19",
        "armed -> active",
        "s STOP",
    ] {
        assert!(text.contains(word), "{word}\n{text}");
    }
    let coil = lines.iter().find(|line| line.contains("-7.90 A")).expect("shown");
    assert!(coil.contains('\u{2588}') && coil.contains("] !"), "a bar, and a mark at the limit: {coil}");
    let plots = |columns: std::ops::Range<usize>| {
        let letters = lines.iter().flat_map(|line| line.chars().skip(columns.start).take(columns.len()));
        letters.filter(|letter| is_braille(*letter)).count()
    };
    assert!(plots(0..40) > 50, "angles against time\n{text}");
    assert!(plots(40..60) > 15 && plots(60..80) > 15, "two projections\n{text}");
}

#[test]
fn every_size_is_drawn_and_the_smallest_still_say_state_and_angles() {
    let scene = Scene::steering(Link::Attached);
    for width in [1, 2, 5, 20, 40, 69, 70, 80, 133, 250] {
        for height in [1, 2, 3, 8, 19, 20, 24, 50, 90] {
            for popup in [Popup::None, Popup::Help, Popup::EmergencyStop] {
                let lines = scene.draw(&Ui { popup, ..Ui::default() }, width, height);
                assert_eq!(lines.len(), usize::from(height));
            }
        }
    }
    let text = scene.draw(&Ui::default(), 40, 10).join("\n");
    for word in ["ACTIVE", "m1: 70.4 of 70.0 deg", "-7.90 of 8.0 A  LIMIT"] {
        assert!(text.contains(word), "{word}\n{text}");
    }
}

#[test]
fn large_terminal_gives_each_magnet_its_own_plot() {
    let lines = Scene::steering(Link::Attached).draw(&Ui::default(), 160, 50);
    let row = |word: &str| lines.iter().position(|line| line.contains(word));
    let (first, second) = (row(" m1 ").expect("shown"), row(" m2 ").expect("shown"));
    assert!(second > first + 5, "one above the other: {first} {second}");
}

#[test]
fn directions_of_two_angles_stand_side_by_side_and_fourteen_coils_in_two_columns() {
    let rig = Rig::new(&spatial());
    let nothing = StatusMessage { description_fingerprint: rig.fingerprint, ..StatusMessage::default() };
    let figures = Figures::new(&rig, Some(&nothing), (Link::Attached, None, 0), Default::default());
    let mut terminal = Terminal::new(TestBackend::new(120, 36)).expect("memory");
    let (history, ui) = (History::new(), Ui::default());
    let screen = Screen { rig: &rig, figures: &figures, history: &history, events: None, ui: &ui };
    terminal.draw(|frame| screen.draw(frame)).expect("memory");
    let text = terminal.backend().to_string();
    let has = |words: [&str; 2]| text.lines().any(|line| words.iter().all(|word| line.contains(word)));
    assert!(has(["m1 from z", "m1 azimuth"]) && has(["m2 from z", "m2 azimuth"]), "{text}");
    assert!(has(["0 ir-bo-ri", "7 i-bo-135"]) && has(["6 i-bo-045", "13 i-t-315"]), "{text}");
}

#[test]
fn a_silent_daemon_and_an_absent_one_are_told_in_words() {
    let mut scene = Scene::steering(Link::Stale);
    let text = scene.draw(&Ui::default(), 80, 24).join("\n");
    assert!(text.contains("no word from the daemon") && text.contains("stale 0 s"), "{text}");
    scene.figures = Figures::new(&scene.rig, None, (Link::Absent, None, 0), Default::default());
    scene.history = History::new();
    let text = scene.draw(&Ui::default(), 80, 24).join("\n");
    assert!(text.contains("no daemon serves this rig: waiting for one"), "{text}");
}

#[test]
fn a_name_loses_letters_where_it_has_most_and_is_never_longer_than_its_room() {
    for (name, width, short) in [
        ("iron-bottom-right", 17, "iron-bottom-right"),
        ("iron-bottom-right", 11, "iro-bot-rig"),
        ("iron-bottom-left", 11, "iro-bot-lef"),
        ("iron-top-right", 11, "iro-top-rig"),
        ("iron-bottom-315", 7, "i-b-315"),
        ("coil", 3, "coi"),
        ("a-b-c", 2, ""),
    ] {
        let found = short_name(name, width);
        assert!(found.chars().count() <= width, "{found}");
        assert!(width < 3 || found == short, "{name} in {width}: {found}");
    }
}

#[test]
fn help_tells_what_curves_and_bars_mean_in_the_smallest_terminal() {
    let ui = Ui { popup: Popup::Help, ..Ui::default() };
    let lines = Scene::steering(Link::Attached).draw(&ui, 80, 24);
    for (_, what) in HELP.iter().chain(&SIGNS) {
        assert!(lines.iter().any(|line| line.contains(what)), "{what}\n{}", lines.join("\n"));
    }
}

fn press(ui: &mut Ui, letter: char) -> Action {
    ui.press(KeyEvent::new(KeyCode::Char(letter), KeyModifiers::NONE))
}

#[test]
fn keys_ask_for_what_the_help_says_and_leaving_asks_the_daemon_for_nothing() {
    let mut ui = Ui::default();
    for (letter, verb) in [
        ('a', verb::ARM),
        ('g', verb::GO),
        ('h', verb::HOLD),
        ('b', verb::RETREAT),
        ('s', verb::STOP),
        (' ', verb::STOP),
        ('r', verb::RESET),
    ] {
        assert_eq!(press(&mut ui, letter), Action::Request(verb), "{letter}");
    }
    assert_eq!(press(&mut ui, 'q'), Action::Leave);
    assert_eq!(ui.press(KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL)), Action::Leave);
    assert_eq!(press(&mut ui, 'x'), Action::None);
}

#[test]
fn emergency_stop_wants_a_yes_and_a_stop_works_from_within_its_question() {
    let mut ui = Ui::default();
    assert_eq!((press(&mut ui, 'e'), ui.popup), (Action::None, Popup::EmergencyStop));
    assert_eq!((press(&mut ui, 'n'), ui.popup), (Action::None, Popup::None));
    assert_eq!(press(&mut ui, 'y'), Action::None, "a yes without a question");
    press(&mut ui, 'e');
    assert_eq!((press(&mut ui, 'y'), ui.popup), (Action::Request(verb::ESTOP), Popup::None));
    press(&mut ui, 'e');
    assert_eq!((press(&mut ui, 's'), ui.popup), (Action::Request(verb::STOP), Popup::None));
}

#[test]
fn answers_are_shown_with_their_reason() {
    let mut ui = Ui::default();
    let answer =
        OperatorAnswer { cause: Cause::WrongState.code(), state: state::IDLE, ..OperatorAnswer::default() };
    ui.answered(verb::GO, &answer);
    let text = Scene::steering(Link::Attached).draw(&ui, 80, 24).join("\n");
    assert!(text.contains("go refused while idle: not possible in this state"), "{text}");
}
