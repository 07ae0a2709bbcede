//! `[plant.sensors.NAME]`: a table named after what the sensor sees.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::description::ManipulatorDescription;
use magsteer_hal::invalid::Checks;
use magsteer_hal::shape::{CAPACITY, CentrelineKind};
use serde::{Deserialize, Serialize};

use super::plant::whole;
use crate::sensing::{
    FibreCharacter, Occlusion, PoseSensor, SensorSettings, StereoCharacter, Timing, TrackerCharacter,
};

/// One of `[plant.sensors.NAME]`: holds one table, of its kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorConfig {
    /// `[plant.sensors.NAME.poses]`: a tracker that sees the magnets' poses directly.
    Poses(PosesConfig),
    /// `[plant.sensors.NAME.point_cloud]`: cameras that see points on the rod's surface.
    PointCloud(PointCloudConfig),
    /// `[plant.sensors.NAME.curvature]`: a fibre that feels curvature along the rod.
    Curvature(CurvatureConfig),
}

/// `[plant.sensors.NAME.poses]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosesConfig {
    /// Exposures a second, Hz, > 0, at most one a step.
    pub rate_hz: f64,
    /// From exposure to message, ms, 0 to 1000.
    pub latency_ms: f64,
    /// Standard deviation of each of a tangent's two tilts, deg, 0 to 45.
    pub orientation_noise_deg: f64,
    /// Standard deviation of each coordinate, mm, 0 to 100.
    pub position_noise_mm: f64,
    /// Share of exposures that are lost, 0 to 1.
    pub dropout_probability: f64,
}

/// `[plant.sensors.NAME.point_cloud]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointCloudConfig {
    /// Exposures a second, Hz, > 0, at most one a step.
    pub rate_hz: f64,
    /// From exposure to message, ms, 0 to 1000.
    pub latency_ms: f64,
    /// Share of exposures that are lost, 0 to 1.
    pub dropout_probability: f64,
    /// Positions of the cameras, mm, world, at least two, within 10 m; a point must face all of them.
    pub viewers_mm: Vec<[f64; 3]>,
    /// Points an exposure, outliers included, 100 to 4096.
    pub points: u64,
    /// Standard deviation of a point across the line of sight, mm, 0.001 to 10.
    pub noise_across_mm: f64,
    /// Standard deviation of a point along the line of sight, mm, 0.001 to 10.
    pub noise_depth_mm: f64,
    /// Share of the points that are outliers, 0 to 0.5.
    pub outlier_share: f64,
    /// Outliers lie in the rod's bounding box and this margin about it, mm, 0 to 1000.
    pub outlier_margin_mm: f64,
    /// The hidden stretch of the rod.
    pub occlusion: OcclusionConfig,
    /// The curve that is laid through the points.
    pub centreline: CentrelineConfig,
    /// A magnet of which the tangent is known less well than this (estimated standard deviation) counts as
    /// not seen, deg, > 0, up to 90.
    pub tangent_deviation_max_deg: f64,
}

/// `occlusion = { random = {...} }` or `{ fixed = {...} }`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OcclusionConfig {
    /// Somewhere else in every exposure.
    Random(RandomOcclusionConfig),
    /// Always in one place.
    Fixed(FixedOcclusionConfig),
}

/// `random = {...}`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomOcclusionConfig {
    /// Share of the rod's length that is hidden, 0 to 0.9.
    pub share: f64,
}

/// `fixed = {...}`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedOcclusionConfig {
    /// Share of the rod's length that is hidden, 0 to 0.9.
    pub share: f64,
    /// Where it begins, as a share of the length from the base, 0 to 1.
    pub from: f64,
}

/// `centreline = { curvature = {...} }` or `{ polynomial = {...} }`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CentrelineConfig {
    /// Curvature as a polynomial in each section, magnets straight.
    Curvature(DegreeConfig),
    /// One polynomial in space, the paper's.
    Polynomial(DegreeConfig),
}

/// `{ degree = ... }`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DegreeConfig {
    /// 0 to 6 of a curvature, 3 to 12 of a polynomial in space.
    pub degree: u64,
}

/// `[plant.sensors.NAME.curvature]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurvatureConfig {
    /// Exposures a second, Hz, > 0, at most one a step.
    pub rate_hz: f64,
    /// From exposure to message, ms, 0 to 1000.
    pub latency_ms: f64,
    /// Share of exposures that are lost, 0 to 1.
    pub dropout_probability: f64,
    /// Stations along the whole rod, 1 to 1000, at least one in every section.
    pub stations: u64,
    /// Standard deviation of a reading, 1/m, 0 to 100.
    pub noise_per_m: f64,
    /// Standard deviation of the lasting offset of a station, 1/m, 0 to 100.
    pub offset_per_m: f64,
    /// Whether the fibre tells twist.
    pub measures_twist: bool,
}

impl SensorConfig {
    pub(super) fn check(
        &self,
        key: &str,
        step_us: u64,
        manipulator: &ManipulatorDescription,
        checks: &mut Checks,
    ) {
        let mut own = Checks::new();
        match self {
            Self::Poses(config) => config.check(&format!("{key}.poses"), step_us, &mut own),
            Self::PointCloud(config) => config.check(&format!("{key}.point_cloud"), step_us, &mut own),
            Self::Curvature(config) => config.check(&format!("{key}.curvature"), step_us, &mut own),
        }
        match own.into_result(()) {
            Ok(()) => {
                if let Err(error) = PoseSensor::new(&self.settings(), manipulator, 0, Stamp::default()) {
                    let expected = "given a sensor that can reconstruct this manipulator";
                    checks.require(false, key, format!("a sensor of which {error}"), expected);
                }
            }
            Err(found) => checks.extend(found),
        }
    }

    /// Only for values that were checked.
    pub(super) fn settings(&self) -> SensorSettings {
        match self {
            Self::Poses(config) => config.settings(),
            Self::PointCloud(config) => config.settings(),
            Self::Curvature(config) => config.settings(),
        }
    }
}

/// Checks of what all kinds share: rate, latency, drop-outs.
fn check_timing(key: &str, [rate_hz, latency_ms, dropout]: [f64; 3], step_us: u64, checks: &mut Checks) {
    let rate_max = 1e6 / step_us.max(1) as f64;
    let holds = rate_hz.is_finite() && rate_hz >= 0.01 && rate_hz <= rate_max;
    let expected = format!("from 0.01 to {rate_max}, one exposure a step");
    checks.require(holds, format!("{key}.rate_hz"), rate_hz, expected);
    checks.within(format!("{key}.latency_ms"), latency_ms, 0.0, 1000.0);
    checks.within(format!("{key}.dropout_probability"), dropout, 0.0, 1.0);
}

fn timing(rate_hz: f64, latency_ms: f64, dropout_probability: f64) -> Timing {
    let seconds = |value: f64| Duration::try_from_secs_f64(value).unwrap_or_default();
    Timing { period: seconds(1.0 / rate_hz), latency: seconds(latency_ms * 1e-3), dropout_probability }
}

impl PosesConfig {
    fn check(&self, key: &str, step_us: u64, checks: &mut Checks) {
        check_timing(key, [self.rate_hz, self.latency_ms, self.dropout_probability], step_us, checks);
        checks.within(format!("{key}.orientation_noise_deg"), self.orientation_noise_deg, 0.0, 45.0);
        checks.within(format!("{key}.position_noise_mm"), self.position_noise_mm, 0.0, 100.0);
    }

    fn settings(&self) -> SensorSettings {
        let character = TrackerCharacter {
            orientation_noise: self.orientation_noise_deg.to_radians(),
            position_noise: self.position_noise_mm * 1e-3,
        };
        SensorSettings::Tracker(timing(self.rate_hz, self.latency_ms, self.dropout_probability), character)
    }
}

impl PointCloudConfig {
    fn check(&self, key: &str, step_us: u64, checks: &mut Checks) {
        check_timing(key, [self.rate_hz, self.latency_ms, self.dropout_probability], step_us, checks);
        let viewers = self.viewers_mm.len();
        checks.require(
            (2..=8).contains(&viewers),
            format!("{key}.viewers_mm"),
            format!("{viewers} cameras"),
            "2 to 8 cameras",
        );
        for (index, viewer) in self.viewers_mm.iter().enumerate() {
            checks.length_within(format!("{key}.viewers_mm[{index}]"), viewer, 1e4);
        }
        whole(checks, &format!("{key}.points"), self.points, 100, CAPACITY as u64);
        checks.within(format!("{key}.noise_across_mm"), self.noise_across_mm, 1e-3, 10.0);
        checks.within(format!("{key}.noise_depth_mm"), self.noise_depth_mm, 1e-3, 10.0);
        checks.within(format!("{key}.outlier_share"), self.outlier_share, 0.0, 0.5);
        checks.within(format!("{key}.outlier_margin_mm"), self.outlier_margin_mm, 0.0, 1000.0);
        let occlusion = format!("{key}.occlusion");
        match &self.occlusion {
            OcclusionConfig::Random(random) => {
                checks.within(format!("{occlusion}.random.share"), random.share, 0.0, 0.9);
            }
            OcclusionConfig::Fixed(fixed) => {
                checks.within(format!("{occlusion}.fixed.share"), fixed.share, 0.0, 0.9);
                checks.within(format!("{occlusion}.fixed.from"), fixed.from, 0.0, 1.0);
            }
        }
        let centreline = format!("{key}.centreline");
        match &self.centreline {
            CentrelineConfig::Curvature(of) => {
                whole(checks, &format!("{centreline}.curvature.degree"), of.degree, 0, 6);
            }
            CentrelineConfig::Polynomial(of) => {
                whole(checks, &format!("{centreline}.polynomial.degree"), of.degree, 3, 12);
            }
        }
        let deviation = self.tangent_deviation_max_deg;
        let holds = deviation > 0.0 && deviation <= 90.0;
        checks.require(holds, format!("{key}.tangent_deviation_max_deg"), deviation, "> 0 and at most 90");
    }

    fn settings(&self) -> SensorSettings {
        let whole = |value: u64| usize::try_from(value).unwrap_or(0);
        let character = StereoCharacter {
            viewers: self.viewers_mm.iter().map(|at| at.map(|coordinate| coordinate * 1e-3)).collect(),
            points: whole(self.points),
            noise_across: self.noise_across_mm * 1e-3,
            noise_depth: self.noise_depth_mm * 1e-3,
            outlier_share: self.outlier_share,
            outlier_margin: self.outlier_margin_mm * 1e-3,
            occlusion: match &self.occlusion {
                OcclusionConfig::Random(random) => Occlusion::Random { share: random.share },
                OcclusionConfig::Fixed(fixed) => Occlusion::Fixed { share: fixed.share, from: fixed.from },
            },
            centreline: match &self.centreline {
                CentrelineConfig::Curvature(of) => CentrelineKind::Curvature { degree: whole(of.degree) },
                CentrelineConfig::Polynomial(of) => CentrelineKind::Polynomial { degree: whole(of.degree) },
            },
            tangent_deviation_max: self.tangent_deviation_max_deg.to_radians(),
        };
        SensorSettings::Stereo(timing(self.rate_hz, self.latency_ms, self.dropout_probability), character)
    }
}

impl CurvatureConfig {
    fn check(&self, key: &str, step_us: u64, checks: &mut Checks) {
        check_timing(key, [self.rate_hz, self.latency_ms, self.dropout_probability], step_us, checks);
        whole(checks, &format!("{key}.stations"), self.stations, 1, 1000);
        checks.within(format!("{key}.noise_per_m"), self.noise_per_m, 0.0, 100.0);
        checks.within(format!("{key}.offset_per_m"), self.offset_per_m, 0.0, 100.0);
    }

    fn settings(&self) -> SensorSettings {
        let character = FibreCharacter {
            stations: usize::try_from(self.stations).unwrap_or(0),
            noise: self.noise_per_m,
            offset: self.offset_per_m,
            measures_twist: self.measures_twist,
        };
        SensorSettings::Fibre(timing(self.rate_hz, self.latency_ms, self.dropout_probability), character)
    }
}
