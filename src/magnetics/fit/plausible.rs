//! Units that were mixed up, found before they become coefficients.
//!
//! **Problem.** A file in metres under a header in millimetres, or with some rows in tesla among rows in
//! millitesla, is fitted without complaint and gives coefficients that are wrong by powers of a thousand.
//!
//! **Method.** Each reading is refused that no magnet of this kind can give: further than 10 m, more than 10
//! T, nearer than 1 mm to an expansion point, in an array further than ten workspace radii from the centre;
//! and a grid no field of which a probe would see. Then each field is held against an expectation, of the
//! right shape and of unknown size: a dipole for one coil, the configured series for an array. A reading that
//! is 200 to 5000 times more or less than the others lead to expect is a thousand times off, not wrongly
//! measured. An array as a whole is held against the configured series in size too.

use nalgebra::Vector3;

use crate::magnetics::array::PosedArray;
use crate::magnetics::multipole::{CoilPose, Multipole};
use crate::magnetics::sample::{AppliedField, FieldSample};
use crate::math::csv::Refusal;

use super::readings::{Layout, Reading, Readings};

/// No probe is moved further, m.
const DISTANCE_MAX: f64 = 10.0;
/// No such magnet has more, T.
const FIELD_MAX: f64 = 10.0;
/// No such coil carries more, A.
const CURRENT_MAX: f64 = 1e4;
/// A grid with less field everywhere, T, shows nothing to a probe with the resolution of 0.1 mT.
const FIELD_SEEN: f64 = 1e-4;
/// Readings nearer to the expansion point of a coil, m, are inside of it.
const CLEARANCE: f64 = 1e-3;
/// Workspace radii from its centre within which an array is measured.
const RADII_MAX: f64 = 10.0;
/// "A thousand times", with room for what the expectation does not know.
const THOUSANDFOLD: std::ops::Range<f64> = 200.0..5000.0;
/// Part of the largest expected field below which noise may make any ratio.
const SIGNIFICANT: f64 = 0.05;

/// What the readings are held against.
#[derive(Debug, Clone, Copy)]
pub enum Expectation<'a> {
    /// One coil in its own frame: a dipole of unknown strength.
    Dipole,
    /// An array as configured, at its frame angles.
    Array {
        /// The array.
        array: &'a PosedArray,
        /// Centre of the workspace, m, world.
        center: Vector3<f64>,
        /// Radius of the workspace, m.
        radius: f64,
    },
}

/// Refuses readings whose units cannot be what the header says.
///
/// # Errors
/// The first such reading, or what all of them show.
pub fn check_units(readings: &Readings, expectation: &Expectation<'_>) -> Result<(), Refusal> {
    let checker = Checker { readings, expectation };
    readings.readings.iter().try_for_each(|reading| checker.bounds(reading))?;
    checker.seen()?;
    checker.ratios()
}

struct Checker<'a> {
    readings: &'a Readings,
    expectation: &'a Expectation<'a>,
}

impl Checker<'_> {
    fn bounds(&self, reading: &Reading) -> Result<(), Refusal> {
        let [length, field] = self.units();
        if reading.position.norm() > DISTANCE_MAX {
            let expected = format!("at most 10 m: in {length}, as the header says?");
            return Err(self.position(reading, expected));
        }
        if reading.field.norm() > FIELD_MAX {
            return Err(self.field(reading, format!("at most 10 T: in {field}, as the header says?")));
        }
        if let Some(coil) = reading.currents.iter().position(|current| current.abs() > CURRENT_MAX) {
            let (column, value) = (self.readings.current_column(coil), reading.currents[coil]);
            let expected = "at most 10000 A: milliamperes in place of amperes?";
            return Err(Refusal::new(reading.line, column, format!("{value:?}"), expected));
        }
        match self.expectation {
            Expectation::Dipole if reading.position.norm() < CLEARANCE => {
                let expected = "at least 1 mm from the coil's expansion point at (0, 0, 0): \
                    metres in place of millimetres?";
                Err(self.position(reading, expected.to_owned()))
            }
            Expectation::Array { center, radius, .. }
                if (reading.position - center).norm() > RADII_MAX * radius =>
            {
                let expected = format!(
                    "within ten radii ({} m) of the workspace's centre: millimetres in place of metres?",
                    RADII_MAX * radius
                );
                Err(self.position(reading, expected))
            }
            Expectation::Array { array, .. } => {
                let near = |coil: usize| (reading.position - array.coil_pose(coil).origin).norm() < CLEARANCE;
                match (0..array.coil_count()).find(|coil| near(*coil)) {
                    Some(coil) => {
                        let expected = format!("at least 1 mm from the expansion point of coil {coil}");
                        Err(self.position(reading, expected))
                    }
                    None => Ok(()),
                }
            }
            Expectation::Dipole => Ok(()),
        }
    }

    /// A grid of a coil that was on shows some field.
    fn seen(&self) -> Result<(), Refusal> {
        let largest = self.readings.readings.iter().max_by(|a, b| a.field.norm().total_cmp(&b.field.norm()));
        match (largest, self.expectation) {
            (Some(reading), Expectation::Dipole)
                if reading.field.norm() < FIELD_SEEN && reading.currents.iter().any(|i| *i != 0.0) =>
            {
                let expected = "above 0.1 mT somewhere (this is the largest field of the file): \
                    tesla in place of millitesla?";
                Err(self.field(reading, expected.to_owned()))
            }
            _ => Ok(()),
        }
    }

    fn ratios(&self) -> Result<(), Refusal> {
        let expected: Vec<f64> =
            self.readings.readings.iter().map(|reading| self.expected(reading)).collect();
        let most = expected.iter().copied().fold(0.0, f64::max);
        let significant = || {
            let pairs = self.readings.readings.iter().zip(&expected);
            pairs.filter(move |(_, expected)| **expected > SIGNIFICANT * most)
        };
        let mut ratios: Vec<f64> =
            significant().map(|(reading, expected)| reading.field.norm() / expected).collect();
        ratios.sort_by(f64::total_cmp);
        let Some(&typical) = ratios.get(ratios.len() / 2) else { return Ok(()) };
        let unit = self.units()[1];
        for (reading, expected) in significant() {
            let ratio = reading.field.norm() / (expected * typical);
            let words = if THOUSANDFOLD.contains(&ratio) {
                "more"
            } else if THOUSANDFOLD.contains(&ratio.recip()) {
                "less"
            } else {
                continue;
            };
            let expected = format!(
                "about {:.2e} {unit} after the other rows, this is a thousand times {words}: in {unit} in all rows?",
                self.displayed_field(expected * typical)
            );
            return Err(self.field(reading, expected));
        }
        if let Expectation::Array { .. } = self.expectation {
            for (factor, name) in
                [(1e3, "millitesla"), (1e4, "gauss"), (1e6, "microtesla"), (1e-3, "kilotesla")]
            {
                if (factor / 3.0..factor * 3.0).contains(&typical) {
                    let column = "bx, by, bz".to_owned();
                    let value = format!("{typical:.0e} times what the configured coefficients give");
                    let expected = format!("in tesla: {name}?");
                    return Err(Refusal { line: self.readings.header_line, column, value, expected });
                }
            }
        }
        Ok(())
    }

    /// Magnitude of the expected field, T, or of the right shape alone.
    fn expected(&self, reading: &Reading) -> f64 {
        match self.expectation {
            Expectation::Dipole => {
                let pose = CoilPose { origin: Vector3::zeros(), axis: Vector3::x() };
                let field = Multipole::new(&[1.0]).evaluate(&pose, &reading.position).column.field;
                field.norm() * reading.currents.iter().map(|current| current.abs()).sum::<f64>()
            }
            Expectation::Array { array, .. } => {
                let mut sample = FieldSample::default();
                array.actuated(&reading.currents).evaluate(&reading.position, &mut sample);
                sample.field.norm()
            }
        }
    }

    /// Names of the units of lengths and fields.
    fn units(&self) -> [&'static str; 2] {
        match self.readings.layout {
            Layout::OneCoil => ["mm", "mT"],
            Layout::Array => ["m", "T"],
        }
    }

    fn displayed_field(&self, field: f64) -> f64 {
        match self.readings.layout {
            Layout::OneCoil => field * 1e3,
            Layout::Array => field,
        }
    }

    fn position(&self, reading: &Reading, expected: String) -> Refusal {
        let names = match self.readings.layout {
            Layout::OneCoil => ["x_mm", "y_mm", "z_mm"],
            Layout::Array => ["px", "py", "pz"],
        };
        self.refusal(reading, reading.position, names, expected)
    }

    fn field(&self, reading: &Reading, expected: String) -> Refusal {
        let names = match self.readings.layout {
            Layout::OneCoil => ["bx_mt", "by_mt", "bz_mt"],
            Layout::Array => ["bx", "by", "bz"],
        };
        self.refusal(reading, reading.field, names, expected)
    }

    /// Names the largest component, in the unit of the file.
    fn refusal(
        &self,
        reading: &Reading,
        vector: Vector3<f64>,
        names: [&str; 3],
        expected: String,
    ) -> Refusal {
        let component = vector.iamax();
        let value = match self.readings.layout {
            Layout::OneCoil => vector[component] * 1e3,
            Layout::Array => vector[component],
        };
        // The scale may have added rounding to what the file says.
        let value: f64 = format!("{value:.9e}").parse().unwrap_or(value);
        Refusal::new(reading.line, names[component], value, expected)
    }
}
