//! What processes that only look have in common.

/// Steps of niceness by which a viewer gives way to everything else on the machine, the loop's helpers
/// included.
const NICENESS: i32 = 10;

/// Lets this process give way: whoever looks must not slow down whoever steers.
pub fn give_way() {
    // Refused, it looks all the same; the loop has its own means.
    let _ = rustix::process::nice(NICENESS);
}
