//! An experiment for tests of what becomes of runs, not of steering.

/// Two steps from near rest, 1.2 s each.
pub const SHORT_EXPERIMENT: &str = r#"
description = "Two short steps"
axis = [0.0, 1.0, 0.0]
zero_direction = [0.0, 0.0, 1.0]

[[steps]]
target_deg = { m1 = 92.0, m2 = 95.0 }
duration_s = 1.2

[[steps]]
target_deg = { m1 = 85.0, m2 = 88.0 }
duration_s = 1.2
"#;
