//! The thread that owns the viewer: it looks, draws frames for those who listen, and answers what is asked.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::time::{Duration, Instant};

use magsteer::live::{EventLine, Figures, Rig, Sample, Unsent, Viewer, open_metrics};
use magsteer_hal::Stamp;
use magsteer_hal::operator::{OperatorAnswer, verb};
use serde::Serialize;
use tokio::sync::{broadcast, oneshot};

/// Between two frames.
const FRAME_PERIOD: Duration = Duration::from_millis(100);
/// Between two looks at the channels.
const LOOK_PERIOD: Duration = Duration::from_millis(20);
/// Frames kept for a listener that does not keep up; it then starts anew.
const FRAMES_KEPT: usize = 64;

/// What came of a request.
pub type Answer = Result<OperatorAnswer, Unsent>;

/// What routes ask.
#[derive(Debug)]
pub enum Ask {
    /// All that a page needs to begin, as JSON.
    Hello(oneshot::Sender<String>),
    /// OpenMetrics text.
    Metrics(oneshot::Sender<String>),
    /// One of [`verb`].
    Verb(u32, oneshot::Sender<Answer>),
    /// Angles of every magnet, deg.
    Target(Vec<Vec<f64>>, oneshot::Sender<Answer>),
}

impl Ask {
    /// A stop goes before everything else that waits.
    const fn is_stop(&self) -> bool {
        matches!(self, Self::Verb(verb::STOP | verb::ESTOP, _))
    }
}

/// The routes' end.
#[derive(Debug, Clone)]
pub struct Desk {
    asks: Sender<Ask>,
    frames: broadcast::Sender<Arc<str>>,
}

/// The thread's end.
#[derive(Debug)]
pub struct Drawer {
    asks: Receiver<Ask>,
    frames: broadcast::Sender<Arc<str>>,
    commands: bool,
    boot: String,
}

/// The first message to a page.
#[derive(Serialize)]
struct Hello<'a> {
    boot: &'a str,
    version: &'static str,
    /// True when the page may command.
    commands: bool,
    rig: &'a Rig,
    figures: Figures,
    samples: Vec<&'a Sample>,
    events: Vec<&'a EventLine>,
}

/// Every further one.
#[derive(Serialize)]
struct Frame<'a> {
    figures: Figures,
    /// Those since the former frame.
    samples: Vec<&'a Sample>,
    /// The newest; `None` when nothing came.
    events: Option<Vec<&'a EventLine>>,
}

impl Desk {
    /// Both ends; `commands`, `boot`: what pages are told of this process.
    pub fn new(commands: bool, boot: String) -> (Self, Drawer) {
        let (asks, asked) = mpsc::channel();
        let (frames, _) = broadcast::channel(FRAMES_KEPT);
        let drawer = Drawer { asks: asked, frames: frames.clone(), commands, boot };
        (Self { asks, frames }, drawer)
    }

    /// Frames from now on.
    pub fn listen(&self) -> broadcast::Receiver<Arc<str>> {
        self.frames.subscribe()
    }

    /// Asks, and waits for the answer; `None` when the thread has ended.
    pub async fn ask<T>(&self, ask: impl FnOnce(oneshot::Sender<T>) -> Ask) -> Option<T> {
        let (sender, receiver) = oneshot::channel();
        self.asks.send(ask(sender)).ok()?;
        receiver.await.ok()
    }
}

impl Drawer {
    /// Serves until `ended`.
    pub fn serve(self, mut viewer: Viewer, ended: &AtomicBool) {
        let mut next = Instant::now();
        let (mut samples, mut events) = (0, 0);
        while !ended.load(Ordering::Acquire) {
            let mut asks: Vec<Ask> = self.asks.recv_timeout(LOOK_PERIOD).into_iter().collect();
            asks.extend(self.asks.try_iter());
            asks.sort_by_key(|ask| !ask.is_stop());
            viewer.look(Stamp::now());
            asks.into_iter().for_each(|ask| self.answer(ask, &mut viewer));
            let now = Instant::now();
            if now < next {
                continue;
            }
            next = now + FRAME_PERIOD;
            let (new_samples, new_events) =
                (viewer.history().taken(), viewer.events().map_or(0, |it| it.taken()));
            if self.frames.receiver_count() > 0 {
                let frame = Frame {
                    figures: viewer.figures(Stamp::now(), true),
                    samples: viewer.history().since(samples).collect(),
                    events: (new_events != events).then(|| lines(&viewer)),
                };
                // Whoever left meanwhile needs none.
                let _ = self.frames.send(json(&frame).into());
            }
            (samples, events) = (new_samples, new_events);
        }
    }

    fn answer(&self, ask: Ask, viewer: &mut Viewer) {
        // Whoever asked may be gone by now; then nothing is lost.
        match ask {
            Ask::Hello(sender) => _ = sender.send(self.hello(viewer)),
            Ask::Metrics(sender) => {
                let figures = viewer.figures(Stamp::now(), false);
                _ = sender.send(open_metrics(viewer.rig(), &figures));
            }
            Ask::Verb(verb, sender) => _ = sender.send(viewer.send(verb)),
            Ask::Target(angles_deg, sender) => _ = sender.send(viewer.set_target(&angles_deg)),
        }
    }

    fn hello(&self, viewer: &mut Viewer) -> String {
        let figures = viewer.figures(Stamp::now(), true);
        json(&Hello {
            boot: &self.boot,
            version: env!("CARGO_PKG_VERSION"),
            commands: self.commands,
            rig: viewer.rig(),
            figures,
            samples: viewer.history().samples().collect(),
            events: lines(viewer),
        })
    }
}

fn lines(viewer: &Viewer) -> Vec<&EventLine> {
    viewer.events().map_or_else(Vec::new, |events| events.lines().collect())
}

/// Plain data has no reason to fail; an empty object is none that a page would draw.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_else(|_| "{}".to_owned())
}
