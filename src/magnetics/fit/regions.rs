//! Parts of the measured volume to be left out as a whole: they tell how far a series carries.

use nalgebra::Vector3;

use crate::magnetics::multipole::CoilPose;

use super::readings::Reading;

/// Share of the measured depth that makes a region.
const REGION_SHARE: f64 = 0.15;
/// Readings further than this from the plane of the others are off it, m.
const PLANE_THICKNESS: f64 = 1e-4;

/// Parts of the measured volume that are worth leaving out, as marks on the readings.
pub(super) fn regions(poses: &[CoilPose], readings: &[&Reading]) -> Vec<(&'static str, Vec<bool>)> {
    let mut regions: Vec<(&'static str, Vec<bool>)> = Vec::new();
    if let [pose] = poses {
        let local = |reading: &&Reading| pose.axis.dot(&(reading.position - pose.origin));
        let least = readings.iter().map(local).fold(f64::INFINITY, f64::min);
        let most = readings.iter().map(local).fold(f64::NEG_INFINITY, f64::max);
        let depth = REGION_SHARE * (most - least);
        let mark = |is_member: &dyn Fn(f64) -> bool| {
            readings.iter().map(|reading| is_member(local(reading))).collect()
        };
        regions.push(("nearest to the coil", mark(&|x| x <= least + depth)));
        regions.push(("furthest from the coil", mark(&|x| x >= most - depth)));
        let heights = readings.iter().map(|reading| reading.position.z);
        let plane = median(heights.clone().collect());
        regions.push(("off the plane", heights.map(|z| (z - plane).abs() > PLANE_THICKNESS).collect()));
    } else {
        let center =
            readings.iter().map(|reading| reading.position).sum::<Vector3<f64>>() / readings.len() as f64;
        let distances: Vec<f64> = readings.iter().map(|reading| (reading.position - center).norm()).collect();
        let most = distances.iter().fold(0.0_f64, |most, distance| most.max(*distance));
        let outer = distances.iter().map(|distance| *distance > (1.0 - REGION_SHARE) * most).collect();
        regions.push(("outer shell", outer));
    }
    // At most half may be left out: foretelling the many from the few says little.
    regions.retain(|(_, members)| {
        let count = members.iter().filter(|is_member| **is_member).count();
        count > 0 && 2 * count <= members.len()
    });
    regions
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
