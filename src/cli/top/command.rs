//! The terminal's life: looks, draws, takes keys.

use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use clap::Args;
use magsteer::daemon::StopFlag;
use magsteer::live::Viewer;
use magsteer_hal::Stamp;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyEventKind};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::keys::{Action, Ui};
use super::screen::Screen;
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::rig_file::RigArgs;
use crate::cli::viewing::give_way;

/// Between two pictures.
const PERIOD: Duration = Duration::from_millis(100);
/// How long the answer to a request is shown.
const MESSAGE_TIME: Duration = Duration::from_secs(6);

/// Watch a rig in the terminal: targets and angles against time, the rod, currents with their limits, timing,
/// events.
///
/// Keys hold, go, stop and more; ? shows them. To leave (q, Ctrl-C) never stops the rig. Waits for a daemon
/// that is not there yet, and goes on with one that was started anew.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer top config/bigmag-planar.toml")]
pub struct Top {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    #[command(flatten)]
    rig: RigArgs,
    /// Folder of the daemon's journal, in place of the configuration's.
    #[arg(long, value_name = "FOLDER")]
    journal: Option<PathBuf>,
}

impl Top {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let config = self.rig.load(self.file.as_deref())?;
        let endpoint = self.rig.endpoint(self.file.as_deref())?;
        if !io::stdout().is_terminal() || !io::stdin().is_terminal() {
            return Err(Failure::usage(
                "top draws in a terminal; for a script there is `magsteer status --watch --json`",
            ));
        }
        give_way();
        let mut viewer = Viewer::new(endpoint, &config, self.journal.clone());
        let stop = Arc::new(StopFlag::new());
        let shown = watching(
            &stop,
            false,
            || (),
            || {
                // Restored by a panic too.
                let mut terminal = ratatui::try_init()?;
                let shown = show(&mut terminal, &mut viewer, &stop);
                ratatui::try_restore()?;
                shown
            },
        )?;
        shown?;
        Ok(exit_of(&stop))
    }
}

/// What a terminal has for its reader.
enum Input {
    None,
    There,
    /// Nobody types there any more.
    Gone,
}

/// Waits for input. Whoever reads a terminal that is gone gets nothing, at once, for ever: crossterm then reads
/// without end, and a core that the loop may need is busy.
fn wait_for_input(patience: Duration) -> io::Result<Input> {
    let stdin = io::stdin();
    let mut asked = [PollFd::new(&stdin, PollFlags::IN)];
    let patience = Timespec::try_from(patience).map_err(io::Error::other)?;
    match poll(&mut asked, Some(&patience)) {
        // A signal, as that of a changed size.
        Ok(0) | Err(Errno::INTR) => Ok(Input::None),
        Ok(_) if asked[0].revents() == PollFlags::IN => Ok(Input::There),
        Ok(_) => Ok(Input::Gone),
        Err(error) => Err(error.into()),
    }
}

fn show(terminal: &mut DefaultTerminal, viewer: &mut Viewer, stop: &StopFlag) -> io::Result<()> {
    let mut ui = Ui::default();
    let mut answered = Instant::now();
    let mut next = Instant::now();
    while stop.requested().is_none() {
        viewer.look(Stamp::now());
        if answered.elapsed() > MESSAGE_TIME {
            ui.message = None;
        }
        if Instant::now() >= next {
            next = Instant::now() + PERIOD;
            let figures = viewer.figures(Stamp::now(), true);
            let events = viewer.events();
            let screen =
                Screen { rig: viewer.rig(), figures: &figures, history: viewer.history(), events, ui: &ui };
            terminal.draw(|frame| screen.draw(frame))?;
        }
        match wait_for_input(next.saturating_duration_since(Instant::now()))? {
            Input::None => continue,
            Input::Gone => break,
            Input::There => {}
        }
        if !event::poll(Duration::ZERO)? {
            continue;
        }
        // A changed size is drawn at once, as any key's effect is.
        next = Instant::now();
        let Event::Key(key) = event::read()? else { continue };
        if key.kind == KeyEventKind::Release {
            continue;
        }
        match ui.press(key) {
            Action::None => {}
            Action::Leave => break,
            Action::Request(verb) => {
                match viewer.send(verb) {
                    Ok(answer) => ui.answered(verb, &answer),
                    Err(error) => ui.message = Some((format!("not done: {error}"), true)),
                }
                answered = Instant::now();
            }
        }
    }
    Ok(())
}
