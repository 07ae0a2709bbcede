//! Goal: from curvature along the rod to the magnets' poses, exact where the curvature is.

use nalgebra::Vector3;

use super::rods::{Truth, manipulator, off_deg, plain};
use crate::shape::{CurvatureError, CurvatureShape};

/// Middles of `count` equal stretches of 60 mm.
fn stations(count: usize) -> Vec<f64> {
    (0..count).map(|index| 0.06 * (index as f64 + 0.5) / count as f64).collect()
}

#[test]
fn constant_curvature_and_twist_are_integrated_exactly() {
    let rod = plain();
    for reading in [[0.0, 20.0, 0.0], [15.0, -20.0, 10.0], [0.0; 3], [1e-2, 0.0, 0.0]] {
        let mut shape = CurvatureShape::new(&rod, &stations(100)).expect("sound");
        shape.reconstruct(&[reading; 100]).expect("readings");
        // A screw about the Darboux vector, in body axes z along the tangent.
        let darboux = Vector3::from(reading);
        let rate = darboux.norm();
        let screw = |s: f64| {
            let axis = darboux.try_normalize(1e-300).unwrap_or_else(Vector3::z);
            let along = axis * axis.z;
            let (sine, cosine) = (rate * s).sin_cos();
            let (across, up) = (Vector3::z() - along, axis.cross(&Vector3::z()));
            let arc = if rate > 0.0 { (sine / rate, (1.0 - cosine) / rate) } else { (s, 0.0) };
            along * s + across * arc.0 + up * arc.1
        };
        let end = screw(0.06);
        // Body x is down and body z is world x, see the rod.
        let expected = Vector3::new(-0.055 + end.z, end.y, -end.x);
        assert!((Vector3::from(shape.tip()) - expected).norm() < 1e-14, "{reading:?}");
    }
}

#[test]
fn error_falls_with_the_square_of_the_stations_distance_and_magnets_stay_straight() {
    let curvature = |s: f64| [300.0 * (s - 0.02), 30.0 * (90.0 * s).cos(), 200.0 * s];
    let truth = Truth::of(&manipulator(), curvature);
    let off = |count: usize| {
        let stations = stations(count);
        let mut shape = CurvatureShape::new(&manipulator(), &stations).expect("sound");
        // The fibre bends inside the magnets as well, by what it says; they do not.
        let readings: Vec<[f64; 3]> = stations.iter().map(|s| curvature(*s)).collect();
        let message = shape.reconstruct(&readings).expect("readings");
        assert_eq!((message.magnet_count, message.magnets[1].valid), (2, 1));
        let (position, tangent) = truth.at(0.0575);
        let apart = (Vector3::from(message.magnets[1].position_m) - position).norm();
        (off_deg(message.magnets[1].tangent(), tangent), apart)
    };
    let (coarse, fine) = (off(100), off(400));
    assert!(coarse.0 < 0.1 && coarse.1 < 5e-5, "{coarse:?}");
    assert!(fine.0 < coarse.0 / 4.0 && fine.1 < coarse.1 / 4.0, "{coarse:?} {fine:?}");
}

#[test]
fn twist_turns_the_plane_of_bending_when_it_is_told() {
    let truth = Truth::of(&manipulator(), |_| [0.0, 20.0, 15.0]);
    let off = |reading: [f64; 3]| {
        let mut shape = CurvatureShape::new(&manipulator(), &stations(100)).expect("sound");
        let message = shape.reconstruct(&[reading; 100]).expect("readings");
        off_deg(message.magnets[1].tangent(), truth.at(0.0575).1)
    };
    // Kept exactly with twist, lost by tens of degrees without.
    assert!(off([0.0, 20.0, 15.0]) < 1e-3 && off([0.0, 20.0, 0.0]) > 10.0);
}

#[test]
fn wrong_stations_and_readings_are_refused_by_name() {
    let new = |stations: &[f64]| CurvatureShape::new(&manipulator(), stations).map(|_| ());
    assert!(matches!(new(&[0.0, 0.05, 0.07]), Err(CurvatureError::Station { station: 2, .. })));
    assert!(matches!(new(&[0.01, 0.01]), Err(CurvatureError::Station { station: 1, .. })));
    assert!(matches!(new(&[f64::NAN]), Err(CurvatureError::Station { station: 0, .. })));
    assert_eq!(new(&[0.01, 0.02, 0.027]), Err(CurvatureError::Unmeasured { part: 2 }));
    assert_eq!(new(&[]), Err(CurvatureError::Unmeasured { part: 0 }));
    let mut shape = CurvatureShape::new(&manipulator(), &stations(100)).expect("sound");
    assert_eq!(shape.reconstruct(&[[0.0; 3]; 99]), Err(CurvatureError::Count { expected: 100, actual: 99 }));
    let mut readings = [[0.0; 3]; 100];
    readings[41][1] = f64::INFINITY;
    assert_eq!(shape.reconstruct(&readings), Err(CurvatureError::NotFinite { station: 41 }));
}
