//! The list of subcommands.

#[cfg(feature = "shell")]
use clap::CommandFactory;
use clap::{Parser, Subcommand};
use magsteer_hal::operator::verb;

#[cfg(feature = "foxglove")]
use super::bridge::Bridge;
#[cfg(feature = "sim")]
use super::campaign::Campaign;
use super::check::Check;
#[cfg(feature = "sim")]
use super::demo::Demo;
use super::doctor::Doctor;
use super::events::Events;
use super::exit::{Exit, Failure};
use super::fault::Fault;
use super::field::Field;
use super::hal::Hal;
use super::init::Init;
use super::operator::RequestArgs;
use super::output;
use super::plan::Plan;
use super::reach::Reach;
#[cfg(feature = "record")]
use super::record::Record;
#[cfg(feature = "record")]
use super::replay::Replay;
#[cfg(all(feature = "figures", feature = "record"))]
use super::report::Report;
use super::run::Run;
use super::runs::Runs;
use super::shape::Shape;
#[cfg(feature = "shell")]
use super::shell::{Completions, Man};
#[cfg(feature = "sim")]
use super::sim_plant::SimPlant;
#[cfg(feature = "sim")]
use super::soak::Soak;
use super::status::Status;
use super::target::Target;
#[cfg(feature = "top")]
use super::top::Top;
use super::tune::Tune;
use super::tunnel::Tunnel;
#[cfg(feature = "web")]
use super::web::Web;

/// Steers soft continuum manipulators carrying permanent magnets with an array of mobile electromagnets.
#[derive(Debug, Parser)]
#[command(
    version,
    propagate_version = true,
    after_help = "Research software, not a medical device.\n\n\
    Exit codes: 0 done; 1 the answer is no; 2 usage; 65 data refused; 66 no such input; 69 daemon or driver not there;\n\
    70 a mistake in this program; 73 cannot create; 74 input or output failed; 77 no permission; 78 configuration refused;\n\
    130, 143 ramped down after SIGINT, SIGTERM."
)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Every subcommand.
#[derive(Debug, Subcommand)]
pub enum Command {
    #[cfg(feature = "sim")]
    Demo(Demo),
    #[cfg(feature = "sim")]
    SimPlant(SimPlant),
    #[cfg(feature = "sim")]
    Campaign(Campaign),
    #[cfg(feature = "sim")]
    Soak(Soak),
    Run(Run),
    #[cfg(feature = "record")]
    Record(Record),
    Status(Status),
    #[cfg(feature = "top")]
    Top(Top),
    #[cfg(feature = "web")]
    Web(Web),
    #[cfg(feature = "foxglove")]
    Bridge(Bridge),
    Tunnel(Tunnel),
    Events(Events),
    Runs(Runs),
    #[cfg(all(feature = "figures", feature = "record"))]
    Report(Report),
    #[cfg(feature = "record")]
    Replay(Replay),
    Target(Target),
    /// Take authority over the coils at zero current.
    Arm(RequestArgs),
    /// Start steering towards the targets, or go on after a hold.
    Go(RequestArgs),
    /// Keep steering to where the reference is now.
    Hold(RequestArgs),
    /// From a hold close to a snap-through, go back along the way that led there, until it is far enough.
    Retreat(RequestArgs),
    /// Ramp all currents to zero and give up authority.
    Stop(RequestArgs),
    /// Clear a latched fault whose cause is gone.
    Reset(RequestArgs),
    /// Cut the amplifiers at once; a hardware stop stays primary.
    Estop(RequestArgs),
    Fault(Fault),
    Hal(Hal),
    Init(Init),
    Check(Check),
    Doctor(Doctor),
    Field(Field),
    Shape(Shape),
    Plan(Plan),
    Reach(Reach),
    Tune(Tune),
    #[cfg(feature = "shell")]
    Completions(Completions),
    #[cfg(feature = "shell")]
    Man(Man),
}

impl Command {
    fn run(&self) -> anyhow::Result<Exit> {
        match self {
            #[cfg(feature = "sim")]
            Self::Demo(command) => command.run(),
            #[cfg(feature = "sim")]
            Self::SimPlant(command) => command.run(),
            #[cfg(feature = "sim")]
            Self::Campaign(command) => command.run(),
            #[cfg(feature = "sim")]
            Self::Soak(command) => command.run(),
            Self::Run(command) => command.run(),
            #[cfg(feature = "record")]
            Self::Record(command) => command.run(),
            Self::Status(command) => command.run(),
            #[cfg(feature = "top")]
            Self::Top(command) => command.run(),
            #[cfg(feature = "web")]
            Self::Web(command) => command.run(),
            #[cfg(feature = "foxglove")]
            Self::Bridge(command) => command.run(),
            Self::Tunnel(command) => command.run(),
            Self::Events(command) => command.run(),
            Self::Runs(command) => command.run(),
            #[cfg(all(feature = "figures", feature = "record"))]
            Self::Report(command) => command.run(),
            #[cfg(feature = "record")]
            Self::Replay(command) => command.run(),
            Self::Target(command) => command.run(),
            Self::Arm(request) => request.run(verb::ARM),
            Self::Go(request) => request.run(verb::GO),
            Self::Hold(request) => request.run(verb::HOLD),
            Self::Retreat(request) => request.run(verb::RETREAT),
            Self::Stop(request) => request.run(verb::STOP),
            Self::Reset(request) => request.run(verb::RESET),
            Self::Estop(request) => request.run(verb::ESTOP),
            Self::Fault(command) => command.run(),
            Self::Hal(command) => command.run(),
            Self::Init(command) => command.run(),
            Self::Check(command) => command.run(),
            Self::Doctor(command) => command.run(),
            Self::Field(command) => command.run(),
            Self::Shape(command) => command.run(),
            Self::Plan(command) => command.run(),
            Self::Reach(command) => command.run(),
            Self::Tune(command) => command.run(),
            #[cfg(feature = "shell")]
            Self::Completions(command) => command.run(Cli::command()),
            #[cfg(feature = "shell")]
            Self::Man(command) => command.run(Cli::command()),
        }
    }
}

/// Parses the command line and runs the subcommand. A wrong command line ends the process with code 2.
pub fn run() -> Exit {
    match Cli::parse().command.run() {
        Ok(exit) => exit,
        Err(error) if output::is_reader_gone(&error) => Exit::Success,
        Err(error) => {
            match Failure::problems(&error) {
                Some(problems) => output::problems(problems),
                None => output::error(format_args!("{error:#}")),
            }
            Exit::of(&error)
        }
    }
}
