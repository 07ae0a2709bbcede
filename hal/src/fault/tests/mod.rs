//! What each verb does to each target, and what is refused.

mod actuators;
mod bench;
mod commands;
mod messages;
mod parts;
mod plans;
mod requests;
