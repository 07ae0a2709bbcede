//! The two pictures of a played experiment: angles against time, and the manipulator at the end of each step.

use std::path::{Path, PathBuf};

use magsteer::config::Config;
use magsteer::daemon::target::angle_from_z_deg;
use magsteer::rod::Station;
use nalgebra::Vector3;

use super::figures::{AngleHistory, CurrentHistory, SideView, angles_against_time, side_views};
use super::model_shapes::Shapes;
use super::play::{Played, PlayedStep, Sample};

/// Half the length of the line that shows a target's direction, mm.
const TARGET_REACH_MM: f64 = 9.0;

/// Draws both pictures into `folder` and returns their paths.
///
/// # Errors
/// When a picture cannot be drawn or written.
pub fn draw(folder: &Path, config: &Config, played: &Played) -> anyhow::Result<Vec<PathBuf>> {
    let rig = &config.description;
    let mut files = Vec::new();
    let path = folder.join("angles.png");
    let angles: Vec<AngleHistory> = rig
        .magnets()
        .enumerate()
        .map(|(index, magnet)| angle_history(index, &magnet.name, &played.samples))
        .collect();
    let currents: Vec<CurrentHistory> = rig
        .coils
        .iter()
        .enumerate()
        .map(|(index, coil)| CurrentHistory {
            coil: coil.name.clone(),
            points: played
                .samples
                .iter()
                .map(|sample| (sample.time_s, sample.actuation.current_a[index]))
                .collect(),
        })
        .collect();
    let limit = rig.coils.iter().fold(0.0, |most: f64, coil| most.max(coil.current_max));
    angles_against_time(&path, &angles, &currents, limit)?;
    files.push(path);
    if let Some(mut shapes) = Shapes::at_rest(config) {
        let path = folder.join("side-views.png");
        let mut samples = played.samples.iter().peekable();
        let views: Vec<SideView> = played
            .steps
            .iter()
            .map(|step| {
                while let Some(sample) = samples.next_if(|sample| sample.time_s <= step.end_s) {
                    shapes.follow(
                        &sample.actuation.current_a[..rig.coils.len()],
                        &sample.actuation.angle_rad[..rig.frames.len()],
                    );
                }
                side_view(&shapes, step)
            })
            .collect();
        side_views(&path, &views)?;
        files.push(path);
    }
    Ok(files)
}

fn angle_history(index: usize, magnet: &str, samples: &[Sample]) -> AngleHistory {
    let curve = |of: fn(&Sample) -> &[[f64; 3]; magsteer_hal::MAGNETS_MAX]| {
        samples
            .iter()
            .filter_map(|sample| Some((sample.time_s, angle_from_z_deg(&of(sample)[index])?)))
            .collect()
    };
    AngleHistory {
        magnet: magnet.to_owned(),
        desired: curve(|sample| &sample.target),
        measured: curve(|sample| &sample.measured),
        predicted: curve(|sample| &sample.predicted),
    }
}

fn side_view(shapes: &Shapes<'_>, step: &PlayedStep) -> SideView {
    let stations = shapes.stations();
    let in_plane = |position: &Vector3<f64>| (position.x * 1e3, position.z * 1e3);
    let targets = shapes.pass().magnets().iter().zip(&step.target).map(|(magnet, direction)| {
        let (x, z) = in_plane(&magnet.position());
        let reach = [-TARGET_REACH_MM, TARGET_REACH_MM];
        reach.map(|length| (x + length * direction[0], z + length * direction[2]))
    });
    let angles: Vec<String> = step.response.target_deg.iter().map(|angle| format!("{angle:.0}")).collect();
    SideView {
        title: format!("({}) deg", angles.join(", ")),
        centre_line: stations.iter().map(|station| in_plane(&station.position)).collect(),
        magnets: stations
            .windows(2)
            .filter(|pair| pair[1].magnet.is_some())
            .map(|pair| [&pair[0], &pair[1]].map(|station: &Station| in_plane(&station.position)))
            .collect(),
        targets: targets.collect(),
    }
}
