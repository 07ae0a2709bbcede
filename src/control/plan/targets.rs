//! Targets of a plan: read from a file, or drawn at random about the rest directions.
//!
//! A file has the columns `m1x`, `m1y`, `m1z`, `m2x`, ..., named after the rig's magnets: the unit tangent that each magnet shall
//! have, world, one target a line. Blank lines and lines that start with `#` are passed over.
//!
//! Random directions are uniform by solid angle: between the angles `a` and `b` from an axis the cosine is uniform between `cos b`
//! and `cos a`, the azimuth between 0 and a turn.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::control::step::Directions;
use crate::math::csv::{CsvTable, Refusal};
use crate::math::{SplitMix, along_great_circle, orthonormal_complement};

/// How far a tangent may be from unit length: a file with three decimals is.
const NORM_TOLERANCE: f64 = 2e-3;

/// The header of a file of targets for magnets of these names.
#[must_use]
pub fn target_columns(magnets: &[&str]) -> Vec<String> {
    magnets.iter().flat_map(|magnet| ["x", "y", "z"].map(|axis| format!("{magnet}{axis}"))).collect()
}

/// Targets of a file, each with its line.
#[derive(Debug, Clone, PartialEq)]
pub struct Targets {
    /// Unit tangents, world, in the order of the file; beyond the rig's magnets zero.
    pub targets: Vec<Directions>,
    /// False when the last line has no end: then its last value may have been cut short.
    pub ends_with_line_end: bool,
}

/// Reads the bytes of a file of targets for magnets of these names, at most as many as [`Directions`] holds.
///
/// # Errors
/// The first thing in the file that cannot be read or is no target, with its place.
pub fn parse_targets(bytes: &[u8], magnets: &[&str]) -> Result<Targets, Refusal> {
    let wanted = target_columns(magnets);
    let words = wanted.join(",");
    let table = CsvTable::new(bytes, &words)?;
    table.check_columns(|name| wanted.iter().any(|known| known == name), &words)?;
    let place = |name: &String| table.columns.iter().position(|column| column == name);
    let mut columns = Vec::with_capacity(wanted.len());
    for name in &wanted {
        let missing = || table.refuse_header(format!("no column {name}"), format!("the header {words}"));
        columns.push(place(name).ok_or_else(missing)?);
    }
    let mut targets = Vec::new();
    for row in table.rows() {
        let row = row?;
        let mut target = Directions::default();
        for ((direction, columns), magnet) in target.iter_mut().zip(columns.chunks_exact(3)).zip(magnets) {
            let components =
                Vector3::new(row.number(columns[0])?, row.number(columns[1])?, row.number(columns[2])?);
            let norm = components.norm();
            if (norm - 1.0).abs() > NORM_TOLERANCE {
                let column = format!("{magnet}x,{magnet}y,{magnet}z");
                let value = format!("a vector of length {norm:.4}");
                return Err(Refusal::new(row.line, column, value, "a unit vector: length 1 to 0.002"));
            }
            *direction = (components / norm).into();
        }
        targets.push(target);
    }
    if targets.is_empty() {
        return Err(table.refuse_header("the last line of the file", "followed by at least one target"));
    }
    Ok(Targets { targets, ends_with_line_end: table.ends_with_line_end })
}

/// A direction drawn uniformly by solid angle, from `least` to `most` away from `axis`, rad.
#[must_use]
pub fn draw_direction(axis: &Vector3<f64>, [least, most]: [f64; 2], random: &mut SplitMix) -> Vector3<f64> {
    let cosine = most.cos() + (least.cos() - most.cos()) * random.unit();
    let azimuth = TAU * random.unit();
    let [first, second] = orthonormal_complement(axis);
    let way = (first * azimuth.cos() + second * azimuth.sin()) * cosine.clamp(-1.0, 1.0).acos();
    along_great_circle(axis, &way, &Vector3::zeros()).0
}

/// `count` targets for `magnets` magnets, each direction drawn from the cone of half-angle `cone`, rad, about its rest direction.
#[must_use]
pub fn draw_targets(
    rest: &Directions,
    magnets: usize,
    cone: f64,
    count: usize,
    seed: u64,
) -> Vec<Directions> {
    let mut random = SplitMix::new(seed);
    let mut draw = || {
        let mut target = Directions::default();
        for (direction, axis) in target.iter_mut().zip(rest).take(magnets) {
            *direction = draw_direction(&Vector3::from(*axis), [0.0, cone], &mut random).into();
        }
        target
    };
    (0..count).map(|_| draw()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::angle_between;

    const MAGNETS: [&str; 2] = ["m1", "m2"];

    fn refused(text: &str) -> String {
        parse_targets(text.as_bytes(), &MAGNETS).unwrap_err().to_string()
    }

    #[test]
    fn columns_may_stand_in_any_order_and_rounded_vectors_are_made_unit() {
        let text = "# two\nm2x,m2y,m2z,m1x,m1y,m1z\n0,0,1,0.7071,0,0.7071\n";
        let read = parse_targets(text.as_bytes(), &MAGNETS).unwrap();
        let half = 0.5_f64.sqrt();
        let first = Vector3::from(read.targets[0][0]);
        assert!((first - Vector3::new(half, 0.0, half)).norm() < 1e-12, "{first}");
        assert_eq!(read.targets[0][1], [0.0, 0.0, 1.0]);
        assert_eq!(read.targets[0][2], [0.0; 3]);
        assert!(read.ends_with_line_end);
    }

    #[test]
    fn refusals_name_line_column_value_and_what_is_right() {
        const HEADER: &str = "m1x,m1y,m1z,m2x,m2y,m2z\n";
        assert_eq!(
            refused(&format!("{HEADER}1,0,0,1,0,0\n1,0,0,2,0,0\n")),
            "3: m2x,m2y,m2z: a vector of length 2.0000: must be a unit vector: length 1 to 0.002"
        );
        assert_eq!(refused(&format!("{HEADER}1,0,0,NaN,0,0\n")), "2: m2x: \"NaN\": must be a finite number");
        assert_eq!(refused(&format!("{HEADER}1,0,zero,1,0,0\n")), "2: m1z: \"zero\": must be a number");
        assert_eq!(
            refused("m1x,m1y,m1z,m2x,m2y\n1,0,0,1,0\n"),
            "1: header: no column m2z: must be the header m1x,m1y,m1z,m2x,m2y,m2z"
        );
        assert!(
            refused("m1x,m1y,m1z,m3x,m2y,m2z\n").starts_with("1: header: column \"m3x\": must be one of")
        );
        assert!(refused(&format!("{HEADER}1,0,0,1,0\n")).contains("m2z: nothing, after 5 of 6 columns"));
        assert!(refused(HEADER).ends_with("must be followed by at least one target"));
        assert!(refused("").contains("an empty file"));
    }

    /// Goal: within a cone the cosine is uniform (mean halfway, to four standard errors), and directions lie evenly about its axis.
    #[test]
    fn directions_are_uniform_by_solid_angle() {
        let axis = Vector3::new(0.3, -0.4, -0.5).normalize();
        let mut random = SplitMix::new(5);
        let (least, most) = (0.4, 1.2);
        let draws = 4000;
        let (mut cosines, mut sum) = (0.0, Vector3::zeros());
        for _ in 0..draws {
            let drawn = draw_direction(&axis, [least, most], &mut random);
            let angle = angle_between(&axis, &drawn);
            assert!((drawn.norm() - 1.0).abs() < 1e-12);
            assert!((least - 1e-9..=most + 1e-9).contains(&angle), "{angle}");
            cosines += angle.cos() / f64::from(draws);
            sum += (drawn - axis * axis.dot(&drawn)) / f64::from(draws);
        }
        let width = f64::cos(least) - f64::cos(most);
        let standard_error = width / (12.0 * f64::from(draws)).sqrt();
        assert!((cosines - 0.5 * (f64::cos(least) + f64::cos(most))).abs() < 4.0 * standard_error);
        assert!(sum.norm() < 4.0 / f64::from(draws).sqrt(), "{sum}");
    }

    #[test]
    fn a_seed_gives_the_same_targets_and_another_seed_others() {
        let rest: Directions = [[1.0, 0.0, 0.0]; magsteer_hal::MAGNETS_MAX];
        let first = draw_targets(&rest, 2, 0.5, 3, 7);
        assert_eq!(first, draw_targets(&rest, 2, 0.5, 3, 7));
        assert_ne!(first, draw_targets(&rest, 2, 0.5, 3, 8));
        // A longer list begins with the shorter one.
        assert_eq!(first[..], draw_targets(&rest, 2, 0.5, 5, 7)[..3]);
        assert_eq!(first[0][2], [0.0; 3]);
    }
}
