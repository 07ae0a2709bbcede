//! `magsteer tune excite`: equilibria of the simulated rig, as `tune identify` reads them.
//!
//! In lockstep, faster than real time. What is written is what a driver would tell: poses of the mounted
//! sensor and the feedback of currents and angles, averaged while the rod is at rest; never the plant's
//! truth.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use magsteer::config::{Config, Problems};
use magsteer::control::identification::{ExcitationRequest, columns, excitations};
use magsteer_hal::message::driver_state;
use magsteer_hal::{
    Actuation, AdmittedCommand, Authority, CoilFeedback, Gate, Hardware, HardwareDescription, PoseMessage,
    Sensed, Stamp,
};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};
use nalgebra::Vector3;

use crate::cli::actuation::finite;
use crate::cli::exit::{Exit, Failure};
use crate::cli::play::LiveLine;
use crate::cli::{data_file, output};

/// Time of one cycle.
const CYCLE: Duration = Duration::from_millis(1);
/// Validity of the commands.
const VALIDITY: Duration = Duration::from_millis(100);
/// Least time from one equilibrium to the next, s: slow beside the rod's first mode, so that it is led and
/// not thrown.
const RAMP_MIN_S: f64 = 0.5;
/// Share of a rate limit that the way takes.
const RATE_SHARE: f64 = 0.8;
/// How often the progress line is drawn.
const DRAW_EVERY: Duration = Duration::from_millis(200);

/// Make data for `tune identify` with the simulated rig.
///
/// Draws currents and angles at random that the model says the rod bears, also when it is softer than the
/// model, leads the simulated rig there, waits until it rests, and writes what sensor and driver report.
/// The plant has the errors of [plant.errors], which `tune identify` should find.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer tune excite config/bigmag-planar.toml --out data.csv --samples 60 --seed 1"
)]
pub struct Excite {
    /// Configuration file (TOML) with a `[plant]` table.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Equilibria to write (CSV).
    #[arg(long, value_name = "DATA.csv")]
    out: PathBuf,
    /// How many.
    #[arg(long, value_name = "N", default_value = "60", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    samples: u32,
    /// Seed of the draws; the plant's is configured.
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
    /// Greatest current drawn, percent of each coil's greatest.
    #[arg(long, value_name = "PERCENT", default_value = "50", value_parser = percent)]
    currents_percent: f64,
    /// Greatest angle drawn, deg, within each frame's range.
    #[arg(long, value_name = "DEG", default_value = "30", value_parser = not_negative)]
    angle_max_deg: f64,
    /// Time to come to rest, s.
    #[arg(long, value_name = "S", default_value = "1.5", value_parser = not_negative)]
    settle_s: f64,
    /// Time over which poses and feedback are averaged, s.
    #[arg(long, value_name = "S", default_value = "0.2", value_parser = not_negative)]
    average_s: f64,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn percent(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 && value <= 100.0 { Ok(value) } else { Err("must be above 0 and at most 100".to_owned()) }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value >= 0.0 { Ok(value) } else { Err("must be at least 0".to_owned()) }
}

impl Excite {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (document, config) = Config::load(&self.file)?;
        let manipulator = document.require("rod", &config.manipulator)?;
        let rig = &config.description;
        let settings = document.section::<PlantConfig>("plant")?;
        let plant = match settings.build_as(rig, &config.nominal(&document)?) {
            Ok(plant) => plant,
            Err(refused) => {
                return Err(Problems::refuse(document.refuse(refused), ()).expect_err("refused").into());
            }
        };
        let request = ExcitationRequest {
            count: self.samples as usize,
            seed: self.seed,
            current_share: self.currents_percent * 1e-2,
            angle_max: self.angle_max_deg.to_radians(),
            determinant_min: 0.5,
        };
        let drawn = excitations(rig, manipulator, &request)
            .map_err(|error| Failure::with(Exit::No, anyhow!("{error}: see --currents-percent")))?;
        let mut player = Player::new(SimulatedRig::new(plant, rig), rig)?;
        let mut line = std::io::stderr().is_terminal().then(LiveLine::new);
        let mut text = self.head(rig);
        for (index, target) in drawn.iter().enumerate() {
            player.lead(target)?;
            player.hold(self.settle_s)?;
            text += &player.measure(self.average_s)?.row(rig);
            if let Some(line) = &mut line {
                line.draw(|| format!("{} of {} equilibria", index + 1, drawn.len()), DRAW_EVERY);
            }
        }
        if let Some(line) = &mut line {
            line.end();
        }
        data_file::create(&self.out, text.as_bytes())?;
        let simulated_s = player.now.since(player.begin).as_secs_f64();
        if self.json {
            output::json(&serde_json::json!({
                "samples": drawn.len(), "simulated_s": simulated_s, "files": [&self.out],
            }))?;
        } else {
            output::result(format_args!(
                "{} equilibria in {simulated_s:.0} s of the simulated rig\nwritten: {}\n",
                drawn.len(),
                self.out.display()
            ))?;
        }
        Ok(Exit::Success)
    }

    fn head(&self, rig: &HardwareDescription) -> String {
        format!(
            "# Equilibria of the simulated rig {}, made by `magsteer tune excite`, seed {}\n{}\n",
            rig.rig,
            self.seed,
            columns(rig).join(",")
        )
    }
}

/// Commands a simulated rig without a controller.
struct Player<'a> {
    rig: &'a HardwareDescription,
    hardware: SimulatedRig,
    gate: Gate,
    authority: Authority,
    begin: Stamp,
    now: Stamp,
}

impl<'a> Player<'a> {
    /// Starts the clock and takes authority.
    fn new(mut hardware: SimulatedRig, rig: &'a HardwareDescription) -> anyhow::Result<Self> {
        // Any moment but zero, which means "no stamp".
        let begin = Stamp::from_nanoseconds(1_000_000_000);
        hardware.read(begin);
        let authority = Authority { epoch: 1, token: 1, validity: VALIDITY };
        let mut player = Self { rig, hardware, gate: Gate::new(rig), authority, begin, now: begin };
        for _ in 0..1000 {
            let claim = player.gate.claim(player.authority);
            let sensed = player.send(&claim)?;
            if let Some(feedback) = sensed.feedback.last
                && feedback.state == driver_state::DRIVEN
            {
                player.gate.seed(&feedback.measured);
                return Ok(player);
            }
        }
        Err(Failure::with(Exit::Unavailable, anyhow!("the simulated rig grants no authority")))
    }

    /// Sends, lets a cycle pass, and reads.
    fn send(&mut self, command: &AdmittedCommand) -> anyhow::Result<Sensed> {
        self.hardware.write(command, self.now)?;
        self.now = self.now.after(CYCLE);
        let sensed = self.hardware.read(self.now);
        let fault = sensed.feedback.last.map_or(0, |feedback| feedback.fault);
        if fault != 0 {
            return Err(Failure::with(Exit::No, anyhow!("the driver reports fault {fault}")));
        }
        Ok(sensed)
    }

    fn drive(&mut self, to: &Actuation) -> anyhow::Result<Sensed> {
        let admitted = self.gate.drive(to, CYCLE.as_secs_f64(), self.authority, Stamp::default())?;
        self.send(&admitted.command)
    }

    /// Goes to currents and angles, everything in proportion.
    fn lead(&mut self, to: &Actuation) -> anyhow::Result<()> {
        let from = *self.gate.previous();
        let currents = self
            .rig
            .coils
            .iter()
            .enumerate()
            .map(|(coil, limits)| (to.current_a[coil] - from.current_a[coil]).abs() / limits.slew_max);
        let angles =
            self.rig.frames.iter().enumerate().map(|(frame, limits)| {
                (to.angle_rad[frame] - from.angle_rad[frame]).abs() / limits.speed_max
            });
        let duration = currents.chain(angles).fold(RAMP_MIN_S * RATE_SHARE, f64::max) / RATE_SHARE;
        let cycles = (duration / CYCLE.as_secs_f64()).ceil();
        for cycle in 1..=cycles as u64 {
            let share = cycle as f64 / cycles;
            let mut at = from;
            let parameters = at.current_a.iter_mut().chain(&mut at.angle_rad);
            for (parameter, end) in parameters.zip(to.current_a.iter().chain(&to.angle_rad)) {
                *parameter += (end - *parameter) * share;
            }
            self.drive(&at)?;
        }
        Ok(())
    }

    fn hold(&mut self, seconds: f64) -> anyhow::Result<()> {
        let at = *self.gate.previous();
        for _ in 0..cycles(seconds) {
            self.drive(&at)?;
        }
        Ok(())
    }

    /// Averages over a time, over one pose at least.
    fn measure(&mut self, seconds: f64) -> anyhow::Result<Average> {
        /// Longest wait for a pose: a camera's period and its delay, some times over.
        const PATIENCE_S: f64 = 5.0;
        let at = *self.gate.previous();
        let mut average = Average::default();
        let (least, most) = (cycles(seconds), cycles(seconds + PATIENCE_S));
        for cycle in 0..most {
            if cycle >= least && average.poses > 0 {
                return Ok(average);
            }
            let sensed = self.drive(&at)?;
            if let Some(feedback) = sensed.feedback.last.filter(|_| sensed.feedback.fresh) {
                average.add_feedback(&feedback);
            }
            if let Some(pose) = sensed.pose.last.filter(|_| sensed.pose.fresh) {
                average.add_pose(&pose);
            }
        }
        Err(Failure::with(Exit::Unavailable, anyhow!("the sensor reported no pose for {PATIENCE_S} s")))
    }
}

fn cycles(seconds: f64) -> u64 {
    (seconds / CYCLE.as_secs_f64()).ceil() as u64
}

/// Sums of what was reported.
#[derive(Default)]
struct Average {
    feedbacks: u64,
    measured: Actuation,
    poses: u64,
    /// How often each magnet was seen, and sums of its tangent and position.
    magnets: Vec<(u64, Vector3<f64>, Vector3<f64>)>,
}

impl Average {
    fn add_feedback(&mut self, feedback: &CoilFeedback) {
        self.feedbacks += 1;
        for (sum, value) in self.measured.current_a.iter_mut().zip(&feedback.measured.current_a) {
            *sum += value;
        }
        for (sum, value) in self.measured.angle_rad.iter_mut().zip(&feedback.measured.angle_rad) {
            *sum += value;
        }
    }

    fn add_pose(&mut self, pose: &PoseMessage) {
        self.poses += 1;
        let magnets = &pose.magnets[..pose.magnet_count as usize];
        self.magnets.resize(magnets.len(), (0, Vector3::zeros(), Vector3::zeros()));
        for ((seen, tangent, position), magnet) in self.magnets.iter_mut().zip(magnets) {
            if magnet.valid == 1 {
                *seen += 1;
                *tangent += Vector3::from(magnet.tangent());
                *position += Vector3::from(magnet.position_m);
            }
        }
    }

    /// A line of the file; empty cells for a magnet that was never seen.
    fn row(&self, rig: &HardwareDescription) -> String {
        let count = self.feedbacks.max(1) as f64;
        let currents = self.measured.current_a[..rig.coils.len()].iter().map(|sum| sum / count);
        let angles = self.measured.angle_rad[..rig.frames.len()].iter().map(|sum| (sum / count).to_degrees());
        let mut cells: Vec<String> = currents.chain(angles).map(|value| format!("{value:.6}")).collect();
        for (seen, tangent, position) in &self.magnets {
            if *seen == 0 {
                cells.extend(std::iter::repeat_n(String::new(), 6));
                continue;
            }
            let (position, tangent) = (position / *seen as f64, tangent.normalize());
            cells.extend(position.iter().chain(&tangent).map(|value| format!("{value:.8}")));
        }
        cells.join(",") + "\n"
    }
}
