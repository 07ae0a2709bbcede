//! Which key asks for what.

use magsteer_hal::operator::{OperatorAnswer, cause, state, verb};
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// What lies over the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Popup {
    /// Nothing.
    #[default]
    None,
    /// The keys.
    Help,
    /// Whether to cut the amplifiers.
    EmergencyStop,
}

/// What a key asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Nothing, or a popup that came or went.
    None,
    /// Leave; the rig goes on as it is.
    Leave,
    /// One of [`verb`].
    Request(u32),
}

/// Keys, and what they do, as the help shows them.
pub const HELP: [(&str, &str); 10] = [
    ("a", "arm: take authority at zero current"),
    ("g", "go: steer, or go on after a hold"),
    ("h", "hold where the reference is now"),
    ("b", "back along the way, when held close to a snap-through"),
    ("s, space", "stop: ramp to zero, give up authority"),
    ("e", "emergency stop: cut the amplifiers (asks first)"),
    ("r", "reset a fault whose cause is gone"),
    ("t", "how far the plots reach back: 10, 30, 60 s"),
    ("?", "this help"),
    ("q, Ctrl-C", "leave; the rig goes on as it is"),
];

/// What the pictures show, for the help.
pub const SIGNS: [(&str, &str); 5] = [
    ("curves", "measured in the magnet's colour, target dark, reference light,"),
    ("", "predicted by the model blue; 69.8/70.0: measured and target, deg"),
    ("rod", "circle: workspace, diameter below; dark strokes: targets"),
    ("[ \u{2588}\u{2588}| ]", "measured current and | command, limits at the ends; ! at the limit"),
    ("frames", "measured of commanded, then the range, deg"),
];

/// What the user does to the screen.
#[derive(Debug, Clone, PartialEq)]
pub struct Ui {
    /// What lies over it.
    pub popup: Popup,
    /// How far plots reach back, s.
    pub reach_s: f64,
    /// What came of the last request; the flag tells a refusal.
    pub message: Option<(String, bool)>,
}

impl Default for Ui {
    fn default() -> Self {
        Self { popup: Popup::None, reach_s: 30.0, message: None }
    }
}

impl Ui {
    /// Takes a key.
    pub fn press(&mut self, key: KeyEvent) -> Action {
        let letter = match key.code {
            KeyCode::Char(letter) => letter.to_ascii_lowercase(),
            KeyCode::Esc => '\u{1b}',
            _ => return Action::None,
        };
        if letter == 'c' && key.modifiers.contains(KeyModifiers::CONTROL) {
            return Action::Leave;
        }
        if std::mem::take(&mut self.popup) == Popup::EmergencyStop && letter == 'y' {
            return Action::Request(verb::ESTOP);
        }
        match letter {
            'a' => Action::Request(verb::ARM),
            'g' => Action::Request(verb::GO),
            'h' => Action::Request(verb::HOLD),
            'b' => Action::Request(verb::RETREAT),
            's' | ' ' => Action::Request(verb::STOP),
            'r' => Action::Request(verb::RESET),
            'q' => Action::Leave,
            'e' => self.show(Popup::EmergencyStop),
            '?' => self.show(Popup::Help),
            't' => {
                self.reach_s = if self.reach_s < 20.0 {
                    30.0
                } else if self.reach_s < 40.0 {
                    60.0
                } else {
                    10.0
                };
                Action::None
            }
            _ => Action::None,
        }
    }

    fn show(&mut self, popup: Popup) -> Action {
        self.popup = popup;
        Action::None
    }

    /// Keeps what the daemon answered, for the screen.
    pub fn answered(&mut self, asked: u32, answer: &OperatorAnswer) {
        let name = verb::name(asked);
        self.message = Some(if answer.accepted == 1 {
            (format!("{name}: done, {}", state::name(answer.state)), false)
        } else {
            (
                format!("{name} refused while {}: {}", state::name(answer.state), cause::text(answer.cause)),
                true,
            )
        });
    }
}
