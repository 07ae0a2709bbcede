//! What is published under which topic.
//!
//! | topic | schema | content |
//! |---|---|---|
//! | `/measured_cp`, `/target_cp` | `foxglove.PosesInFrame` | magnets as measured; the same places with the directions of the target |
//! | `/tf` | `foxglove.FrameTransforms` | a frame for every magnet as measured |
//! | `/scene` | `foxglove.SceneUpdate` | rod, magnets, targets, coils, workspace |
//! | `/angles`, `/actuation`, `/status`, `/timing` | `magsteer.*`, JSON | numbers for plots |
//! | `/log` | `foxglove.Log` | events of the journal |
//!
//! Lengths are metres, as Foxglove has them (REP 103); angles in plots are degrees. A magnet's turn about its
//! own tangent is not in the status: its pose has the least turn that brings z to the tangent.

use std::sync::Arc;

use foxglove::messages::{
    FrameTransform, FrameTransforms, Log, Pose, PosesInFrame, Quaternion, SceneUpdate, Timestamp, Vector3,
    log,
};
use foxglove::{Channel, ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel, Schema};
use magsteer::config::Config;
use magsteer::live::{EventFeed, EventLine, Figures, Level, Rig};
use magsteer_hal::Stamp;
use magsteer_hal::operator::StatusMessage;
use nalgebra::UnitQuaternion;
use serde_json::{Value, json};

use super::scene::Scene;

/// The frame in which everything stands.
pub const WORLD: &str = "world";

/// Every channel.
pub struct Topics {
    measured: Channel<PosesInFrame>,
    target: Channel<PosesInFrame>,
    transforms: Channel<FrameTransforms>,
    scene_channel: Channel<SceneUpdate>,
    log: Channel<Log>,
    angles: Arc<RawChannel>,
    actuation: Arc<RawChannel>,
    status: Arc<RawChannel>,
    timing: Arc<RawChannel>,
    scene: Scene,
    events: u64,
}

impl Topics {
    /// Makes the channels.
    pub fn new(context: &Arc<Context>, config: &Config) -> Result<Self, FoxgloveError> {
        fn typed<T: foxglove::Encode>(context: &Arc<Context>, topic: &str) -> Channel<T> {
            ChannelBuilder::new(topic).context(context).build()
        }
        let raw = |topic: &str, sample: Value| {
            let schema = Schema::new(
                format!("magsteer{}", topic.replace('/', ".")),
                "jsonschema",
                schema_of(&sample).to_string().into_bytes(),
            );
            ChannelBuilder::new(topic).context(context).message_encoding("json").schema(schema).build_raw()
        };
        let rig = Rig::new(config);
        let nothing = StatusMessage::default();
        let figures =
            Figures::new(&rig, Some(&nothing), (magsteer::live::Link::Absent, None, 0), Default::default());
        Ok(Self {
            measured: typed(context, "/measured_cp"),
            target: typed(context, "/target_cp"),
            transforms: typed(context, "/tf"),
            scene_channel: typed(context, "/scene"),
            log: typed(context, "/log"),
            angles: raw("/angles", angles(&rig, &figures))?,
            actuation: raw("/actuation", actuation(&rig, &figures))?,
            status: raw("/status", status_of(&figures))?,
            timing: raw("/timing", timing(&figures))?,
            scene: Scene::new(config),
            events: 0,
        })
    }

    /// Publishes one moment.
    pub fn publish(&mut self, rig: &Rig, status: &StatusMessage, figures: &Figures) {
        let wall_ns = wall_ns(Stamp::from_nanoseconds(status.header.source_stamp_ns));
        let time = timestamp(wall_ns);
        let meta = || PartialMetadata::with_log_time(wall_ns);
        let measured = poses(rig, status, &status.measured_direction);
        let transforms = rig.magnets.iter().zip(&measured).filter_map(|(name, pose)| {
            let Pose { position, orientation } = (*pose)?;
            Some(FrameTransform {
                timestamp: Some(time),
                parent_frame_id: WORLD.to_owned(),
                child_frame_id: name.clone(),
                translation: position,
                rotation: orientation,
            })
        });
        self.transforms.log_with_meta(&FrameTransforms { transforms: transforms.collect() }, meta());
        let framed = |poses: Vec<Option<Pose>>| PosesInFrame {
            timestamp: Some(time),
            frame_id: WORLD.to_owned(),
            poses: poses.into_iter().flatten().collect(),
        };
        self.measured.log_with_meta(&framed(measured), meta());
        self.target.log_with_meta(&framed(poses(rig, status, &status.target_direction)), meta());
        let scene = self.scene.draw(rig, status, figures, time);
        self.scene_channel.log_with_meta(&scene, meta());
        for (channel, content) in [
            (&self.angles, angles(rig, figures)),
            (&self.actuation, actuation(rig, figures)),
            (&self.status, status_of(figures)),
            (&self.timing, timing(figures)),
        ] {
            channel.log_with_meta(content.to_string().as_bytes(), meta());
        }
    }

    /// Publishes the events that came since the former call.
    pub fn tell(&mut self, rig: &Rig, events: Option<&EventFeed>) {
        let Some(events) = events else { return };
        let new = usize::try_from(events.taken() - self.events).unwrap_or(usize::MAX);
        self.events = events.taken();
        for event in events.lines().skip(events.lines().len().saturating_sub(new)) {
            self.log.log(&entry(rig, event));
        }
    }
}

fn entry(rig: &Rig, event: &EventLine) -> Log {
    let level = match event.level {
        Level::Note => log::Level::Info,
        Level::Warning => log::Level::Warning,
        Level::Grave => log::Level::Error,
    };
    let message = format!("{} {}", event.time, event.text);
    let timestamp = Some(Timestamp::now());
    Log { timestamp, level: level.into(), message, name: rig.name.clone(), ..Log::default() }
}

/// Poses of the magnets with these directions; `None` for one that was not seen.
fn poses(rig: &Rig, status: &StatusMessage, directions: &[[f64; 3]]) -> Vec<Option<Pose>> {
    let places = status.measured_position_m.iter().zip(directions).take(rig.magnets.len());
    let pose = |(position, direction): (&[f64; 3], &[f64; 3])| {
        (*position != [0.0; 3] && *direction != [0.0; 3]).then(|| pose(position, direction))
    };
    places.map(pose).collect()
}

/// A pose whose z points along `direction`.
pub fn pose(position: &[f64; 3], direction: &[f64; 3]) -> Pose {
    let z = nalgebra::Vector3::z();
    let direction = nalgebra::Vector3::from(*direction);
    // Opposite to z every axis across it does.
    let half_turn = || UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), std::f64::consts::PI);
    let turn = UnitQuaternion::rotation_between(&z, &direction).unwrap_or_else(half_turn);
    let [x, y, z] = *position;
    let turn = turn.coords;
    Pose {
        position: Some(Vector3 { x, y, z }),
        orientation: Some(Quaternion { x: turn.x, y: turn.y, z: turn.z, w: turn.w }),
    }
}

/// One entry an angle, as the rig's directions are told; null where there is none.
fn angles(rig: &Rig, figures: &Figures) -> Value {
    let of = |angles: &dyn Fn(usize) -> Vec<f64>| -> Vec<Option<f64>> {
        let magnets = 0..rig.magnets.len();
        magnets
            .flat_map(|magnet| {
                let angles = angles(magnet);
                (0..rig.angles.count()).map(move |index| angles.get(index).copied())
            })
            .collect()
    };
    json!({
        "magnets": rig.magnets,
        "target_deg": of(&|magnet| figures.magnets[magnet].target_deg.clone()),
        "desired_deg": of(&|magnet| figures.magnets[magnet].desired_deg.clone()),
        "measured_deg": of(&|magnet| figures.magnets[magnet].measured_deg.clone()),
        "predicted_deg": of(&|magnet| figures.magnets[magnet].predicted_deg.clone()),
        "error_deg": figures.magnets.iter().map(|magnet| magnet.error_deg).collect::<Vec<_>>(),
    })
}

fn actuation(rig: &Rig, figures: &Figures) -> Value {
    json!({
        "coils": rig.coils,
        "measured_a": figures.coils.iter().map(|coil| coil.measured_a).collect::<Vec<_>>(),
        "commanded_a": figures.coils.iter().map(|coil| coil.commanded_a).collect::<Vec<_>>(),
        "limit_a": rig.current_max_a,
        "frames": rig.frames,
        "frames_deg": figures.frames.iter().map(|frame| frame.measured_deg).collect::<Vec<_>>(),
        "coil_heat": figures.coil_heat,
    })
}

fn status_of(figures: &Figures) -> Value {
    json!({
        "state": figures.state,
        "state_code": figures.state_code,
        "cause": figures.cause,
        "cycle": figures.cycle,
        "missed": figures.missed,
        "rate_measured_hz": figures.rate_measured_hz,
        "stability_margin": figures.stability_margin,
        "target_verdict": figures.target_verdict,
        "recorder": figures.recorder,
    })
}

fn timing(figures: &Figures) -> Value {
    let timing = figures.last_minute.as_ref().unwrap_or(&figures.timing);
    json!({
        "lateness_us": figures.lateness_us,
        "lateness_max_us": figures.lateness_max_us,
        "lateness_p999_us": timing.lateness_us.p999,
        "execution_p999_us": timing.execution_us.p999,
        "pose_age_ms": figures.pose_age_ms,
    })
}

/// The JSON schema of messages like this one: names and types, so that plots offer every number.
fn schema_of(sample: &Value) -> Value {
    match sample {
        Value::Object(fields) => {
            let properties: serde_json::Map<_, _> =
                fields.iter().map(|(name, value)| (name.clone(), schema_of(value))).collect();
            json!({"type": "object", "properties": properties})
        }
        Value::Array(entries) => {
            let entry = entries.first().map_or_else(|| json!({"type": "number"}), schema_of);
            json!({"type": "array", "items": entry})
        }
        Value::String(_) => json!({"type": "string"}),
        Value::Number(_) | Value::Null => json!({"type": "number"}),
        Value::Bool(_) => json!({"type": "boolean"}),
    }
}

fn timestamp(wall_ns: u64) -> Timestamp {
    // Less than 2^32 until the year 2106.
    let seconds = u32::try_from(wall_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (wall_ns % 1_000_000_000) as u32)
}

/// A stamp of the monotonic clock on the wall's, ns since 1970, as the two clocks stand now.
fn wall_ns(stamp: Stamp) -> u64 {
    let age = Stamp::now().since(stamp);
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    u64::try_from(now.saturating_sub(age).as_nanos()).unwrap_or(u64::MAX)
}
