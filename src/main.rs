//! The `magsteer` command.

mod cli;

/// Lets the daemon tell when its loop allocates.
#[global_allocator]
static ALLOCATOR: magsteer::daemon::CountingAllocator = magsteer::daemon::CountingAllocator;

fn main() -> std::process::ExitCode {
    cli::run().into()
}
