//! The camera that the tests of sensors share.

use magsteer_hal::shape::CentrelineKind;
use magsteer_sim_plant::sensing::{Occlusion, StereoCharacter};

/// That of the shipped rig: 2,000 points, 0.3 mm of noise, a tenth outliers, a fifth of the rod hidden.
pub fn stereo() -> StereoCharacter {
    StereoCharacter {
        viewers: vec![[-0.05, -0.3, 0.1], [0.05, -0.3, 0.1]],
        points: 2000,
        noise_across: 0.3e-3,
        noise_depth: 0.3e-3,
        outlier_share: 0.1,
        outlier_margin: 0.01,
        occlusion: Occlusion::Random { share: 0.2 },
        centreline: CentrelineKind::Curvature { degree: 2 },
        tangent_deviation_max: 1.25_f64.to_radians(),
    }
}
