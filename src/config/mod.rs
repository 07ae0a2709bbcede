//! The configuration file: one TOML file and what it `extends`, checked as a whole and refused with reasons.
//!
//! **Problem.** A rig is described by some two hundred numbers. A wrong one should be found before a current flows, and the
//! person who wrote it should be told where it stands, what it is and what would be right; all wrong ones at once.
//!
//! **Terms.** A *document* is the file named on the command line merged with the chain of files that it extends:
//! tables merge key by key, arrays and scalars replace. A *section* is one top-level table, which belongs to the module
//! that understands it; a *problem* is one refused value with its file, line and column.
//!
//! **Method.** Each file is parsed into a tree whose nodes remember where they were written ([`Document`]). Typed
//! configurations are deserialised straight from that tree, so that a refusal keeps its place; a refused node is replaced
//! by a stand-in and reading goes on, so that one run reports every refusal. The modules' own checks then name keys
//! ([`magsteer_hal::invalid::Invalid`]), which are looked up in the tree.
//!
//! What is absent: a default. A key that is not in the file is refused, unless the section declares it optional.

mod campaign;
mod deserialize;
mod document;
mod elsewhere;
mod experiment;
mod files;
mod node_reader;
mod placement;
mod problem;
mod root;
mod script;
mod stand_in;
mod target_lines;
mod tree;

pub use campaign::{CampaignConfig, Distribution, Draw, Normal, Uniform, run_seed};
pub use document::{Document, Number, Resolved};
pub use experiment::{Experiment, ExperimentStep, Until};
#[cfg(feature = "record")]
pub(crate) use problem::nearest;
pub use problem::{Problem, ProblemKind, Problems};
pub use root::{Config, TABLES};
pub use script::experiment_of_csv;
pub use target_lines::TargetLines;
