//! A right configuration, for tests to make mistakes in.

use magsteer::config::{Config, Document, Problem, Problems};

/// A right configuration, small enough to be seen at once; every case changes one thing in it.
pub const RIGHT: &str = r#"
[rig]
name = "bench"
workspace_center_mm = [0.0, 0.0, 0.0]
workspace_diameter_mm = 110.0
gravity_m_per_s2 = [0.0, 0.0, -9.81]

[[frames]]
name = "bottom"
axis = [0.0, 0.0, 1.0]
pivot_mm = [0.0, 0.0, 0.0]
angle_min_deg = -180.0
angle_max_deg = 180.0
speed_max_deg_per_s = 45.0

[coil_types.air]
coefficients_si = [6.4e-7, 1.9e-8]
valid_from_x_mm = 43.0
current_max_a = 8.0
slew_max_a_per_s = 300.0
resistance_ohm = 5.0
inductance_h = 0.1
supply_v = 48.0

[[coils]]
name = "left"
type = "air"
azimuth_deg = 0.0
elevation_deg = -30.0
distance_mm = 100.0
frame = "bottom"

[manipulator]
base_position_mm = [-30.0, 0.0, 0.0]
base_tangent = [1.0, 0.0, 0.0]
base_roll_deg = 0.0

[manipulator.materials.rubber]
young_modulus_mpa = 2.0
poisson_ratio = 0.45
density_kg_per_m3 = 1030.0

[[manipulator.parts]]
section = { material = "rubber", length_mm = 25.0, diameter_mm = 2.0, extensible = false }

[[manipulator.parts]]
magnet = { name = "m1", length_mm = 4.0, diameter_mm = 2.0, density_kg_per_m3 = 7500.0, moment_body_a_m2 = [0.0, 0.0, 0.01] }
"#;

/// Right sections of model, controller and daemon, kept apart since some tests append parts to [`RIGHT`].
pub const STEERING: &str = r#"
[rod]
segment_length_max_mm = 3.2
residual_tolerance = 1e-10
iterations_max = 50
rotation_step_max_deg = 20.0
passes_max = 2000

[control]
orientation_error = "tangent-plane"
jacobian = "exact"
measured_current_time_constant_ms = 0.0
feedback = "delayed-reference"
proportional_per_s = 5.0
integral_per_s2 = 0.0
reference_speed_max_deg_per_s = 300.0
reference_acceleration_max_deg_per_s2 = 2000.0
reference_frame_acceleration_max_deg_per_s2 = 150.0
reference_time_constant_ms = 60.0
response_delay_ms = 25.0
allocation = "bounded"
singular_ratio_max = 1e5
damping = 1e-4
current_release_per_s = 0.5
determinant_wanted = 0.9
determinant_rate_per_s = 20.0
frame_angles = "steer"
passes_max = 3

[control.secondary]
disturbance_deg = 3.0
conditioning_max_deg_per_s = 20.0
frame_centering_per_s = 0.1
frame_home_deg = { bottom = 45.0 }
frame_share_deg = 10.0

[daemon]
rate_hz = 1000.0
command_validity_ms = 100.0
pose_hold_ms = 50.0
pose_stop_ms = 250.0
pose_error_max_deg = 30.0
following_current_max_a = 1.5
following_angle_max_deg = 20.0
following_stop_ms = 150.0
feedback_stop_ms = 200.0
model_stop_ms = 250.0
stability_warn = 0.2
stability_hold = 0.1
stability_stop = 0.0
stability_stop_ms = 150.0
ramp_timeout_ms = 1000.0
ramp_done_a = 0.1
overcurrent_margin_a = 0.5
arm_timeout_ms = 150.0
overrun_fraction = 0.5
overrun_window_ms = 400.0
realtime = "best-effort"
priority = 80
lock_memory = true
spin_us = 0.0
status_rate_hz = 100.0
mode = "active"
safe_action = "ramp"
safe_hold_ms = 0.0

[daemon.recorder]
folder = "runs/daemon"
seconds = 10.0
flights_max = 100

[daemon.monitors]
current_error_max_a = 0.25
current_error_share = 0.05
current_error_stop_ms = 300.0
open_current_a = 0.1
open_share = 0.5
open_stop_ms = 300.0
angle_error_max_deg = 5.0
angle_error_stop_ms = 1000.0
coil_current_continuous_a = 5.0
coil_heat_time_constant_s = 400.0
coil_heat_warn = 0.8
workspace_margin_mm = 20.0
pose_rate_max_deg_per_s = 2000.0
pose_jump_max_deg = 5.0
pose_speed_max_mm_per_s = 2000.0
pose_jump_max_mm = 5.0
model_error_max_deg = 20.0
model_error_stop_ms = 2000.0
progress_error_deg = 10.0
progress_stop_ms = 20000.0
controller_frozen_ms = 250.0
"#;

/// What is wrong with a text.
pub fn refused(text: &str) -> Vec<Problem> {
    let checked =
        Document::from_text("bench.toml", text).and_then(|document| Config::from_document(&document));
    checked.err().map(Problems::into_vec).unwrap_or_default()
}

/// Number of the line, 1 first, that holds `text`; 1 for no text.
pub fn line_of(file: &str, text: &str) -> usize {
    match file.find(text) {
        Some(at) if !text.is_empty() => file[..at].matches('\n').count() + 1,
        _ => 1,
    }
}
