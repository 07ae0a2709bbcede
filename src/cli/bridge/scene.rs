//! Rod, magnets, targets, coils and workspace in 3-D.

use foxglove::messages::{
    ArrowPrimitive, Color, CylinderPrimitive, LinePrimitive, Point3, Pose, Quaternion, SceneEntity,
    SceneUpdate, SpherePrimitive, Timestamp, Vector3, line_primitive,
};
use magsteer::config::Config;
use magsteer::live::{Figures, Rig};
use magsteer::magnetics::CoilArray;
use magsteer_hal::operator::StatusMessage;

use super::topics::{WORLD, pose};

/// Colours of the magnets, base to tip, as on the page of `magsteer web`.
const MAGNETS: [[f64; 3]; 8] = [
    [0.22, 0.77, 0.81],
    [0.94, 0.71, 0.16],
    [0.84, 0.44, 0.91],
    [0.44, 0.83, 0.44],
    [0.49, 0.66, 1.0],
    [1.0, 0.54, 0.48],
    [0.72, 0.88, 0.29],
    [1.0, 1.0, 1.0],
];
/// Coils are drawn this large; what they are built like is not in a configuration.
const COIL_DIAMETER_M: f64 = 0.045;
const COIL_LENGTH_M: f64 = 0.05;
/// Length of a target's arrow, relative to the workspace's radius.
const ARROW: f64 = 0.4;

/// Draws the scene of one rig.
pub struct Scene {
    array: CoilArray,
    magnet_lengths_m: Vec<f64>,
}

impl Scene {
    pub fn new(config: &Config) -> Self {
        let description = &config.description;
        Self {
            array: CoilArray::new(description),
            magnet_lengths_m: description.magnets().map(|magnet| magnet.length).collect(),
        }
    }

    /// Everything of one moment; entities replace those of the former by their names.
    pub fn draw(&self, rig: &Rig, status: &StatusMessage, figures: &Figures, time: Timestamp) -> SceneUpdate {
        let entity = |id: &str| SceneEntity {
            timestamp: Some(time),
            frame_id: WORLD.to_owned(),
            id: id.to_owned(),
            ..SceneEntity::default()
        };
        let entities = vec![
            SceneEntity { lines: rod(rig, figures).into_iter().collect(), ..entity("rod") },
            SceneEntity { cylinders: self.magnets(rig, status), ..entity("magnets") },
            SceneEntity { arrows: targets(rig, status), ..entity("targets") },
            SceneEntity { cylinders: self.coils(status, figures), ..entity("coils") },
            SceneEntity { spheres: vec![workspace(rig)], ..entity("workspace") },
        ];
        SceneUpdate { deletions: Vec::new(), entities }
    }

    fn magnets(&self, rig: &Rig, status: &StatusMessage) -> Vec<CylinderPrimitive> {
        let places = status.measured_position_m.iter().zip(&status.measured_direction).enumerate();
        let seen = places.take(rig.magnets.len()).filter(|(_, (position, _))| **position != [0.0; 3]);
        let cylinder = |(magnet, (position, direction)): (usize, (&[f64; 3], &[f64; 3]))| {
            let diameter = 2e-3 * rig.magnet_radius_mm[magnet];
            let colour = colour(MAGNETS[magnet % MAGNETS.len()], 1.0);
            cylinder(pose(position, direction), diameter, self.magnet_lengths_m[magnet], colour)
        };
        seen.map(cylinder).collect()
    }

    /// Red for a current one way, blue for the other, brighter for more.
    fn coils(&self, status: &StatusMessage, figures: &Figures) -> Vec<CylinderPrimitive> {
        let posed = self.array.posed(&status.measured.angle_rad[..self.array.frame_count()]);
        let coil = |(index, coil): (usize, &magsteer::live::CoilFigures)| {
            let place = posed.coil_pose(index);
            // Behind its face, which is where its series is expanded.
            let middle = place.origin - 0.5 * COIL_LENGTH_M * place.axis;
            let share = (coil.measured_a / coil.limit_a.max(1e-9)).clamp(-1.0, 1.0);
            let tint = [0.35 + 0.65 * share.max(0.0), 0.35, 0.35 + 0.65 * (-share).max(0.0)];
            cylinder(
                pose(&middle.into(), &place.axis.into()),
                COIL_DIAMETER_M,
                COIL_LENGTH_M,
                colour(tint, 0.55),
            )
        };
        figures.coils.iter().enumerate().take(self.array.coil_count()).map(coil).collect()
    }
}

fn rod(rig: &Rig, figures: &Figures) -> Option<LinePrimitive> {
    let point = |point: &[f64; 3]| Point3 { x: 1e-3 * point[0], y: 1e-3 * point[1], z: 1e-3 * point[2] };
    let line = &figures.rod.line_mm;
    (line.len() > 1).then(|| LinePrimitive {
        r#type: line_primitive::Type::LineStrip.into(),
        pose: Some(origin()),
        thickness: 2e-3 * rig.section_radius_mm,
        points: line.iter().map(point).collect(),
        color: Some(colour([0.85, 0.88, 0.92], 1.0)),
        ..LinePrimitive::default()
    })
}

fn targets(rig: &Rig, status: &StatusMessage) -> Vec<ArrowPrimitive> {
    let places = status.measured_position_m.iter().zip(&status.target_direction).take(rig.magnets.len());
    let told = places.filter(|(position, direction)| **position != [0.0; 3] && **direction != [0.0; 3]);
    let length = 1e-3 * ARROW * rig.workspace_radius_mm;
    let arrow = |(position, direction): (&[f64; 3], &[f64; 3])| ArrowPrimitive {
        // An arrow points along the x axis of its pose.
        pose: Some(Pose { orientation: Some(x_along(direction)), ..pose(position, direction) }),
        shaft_length: 0.8 * length,
        shaft_diameter: 0.03 * length,
        head_length: 0.2 * length,
        head_diameter: 0.1 * length,
        color: Some(colour([1.0, 1.0, 1.0], 0.8)),
    };
    told.map(arrow).collect()
}

fn workspace(rig: &Rig) -> SpherePrimitive {
    let [x, y, z] = rig.workspace_center_mm.map(|it| 1e-3 * it);
    let diameter = 2e-3 * rig.workspace_radius_mm;
    SpherePrimitive {
        pose: Some(Pose { position: Some(Vector3 { x, y, z }), ..origin() }),
        size: Some(Vector3 { x: diameter, y: diameter, z: diameter }),
        color: Some(colour([0.5, 0.65, 0.8], 0.08)),
    }
}

fn cylinder(pose: Pose, diameter: f64, length: f64, color: Color) -> CylinderPrimitive {
    CylinderPrimitive {
        pose: Some(pose),
        size: Some(Vector3 { x: diameter, y: diameter, z: length }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(color),
    }
}

fn origin() -> Pose {
    Pose {
        position: Some(Vector3::default()),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    }
}

/// The least turn that brings x to a direction.
fn x_along(direction: &[f64; 3]) -> Quaternion {
    let half_turn =
        || nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::z_axis(), std::f64::consts::PI);
    let direction = nalgebra::Vector3::from(*direction);
    let turn = nalgebra::UnitQuaternion::rotation_between(&nalgebra::Vector3::x(), &direction);
    let turn = turn.unwrap_or_else(half_turn).coords;
    Quaternion { x: turn.x, y: turn.y, z: turn.z, w: turn.w }
}

fn colour([r, g, b]: [f64; 3], a: f64) -> Color {
    Color { r, g, b, a }
}
