//! A value that is a thousand or a million times off was most likely typed in another unit.
//!
//! **Method.** A key's last words are its unit. A value out of its range is tried in the units that people
//! mistake for it; the first that brings it inside is named, with the number that would have been right.

/// What one of the other unit is in the key's own: a number over another, so that decimals stay exact.
type Factor = (f64, f64);

/// The end of a key, its unit, and those mistaken for that.
type Unit = (&'static str, &'static str, &'static [(&'static str, Factor)]);

const MILLI: Factor = (1.0, 1e3);
const MICRO: Factor = (1.0, 1e6);
const KILO: Factor = (1e3, 1.0);
const MEGA: Factor = (1e6, 1.0);

/// A longer end stands before a shorter one that it holds.
const UNITS: &[Unit] = &[
    ("_deg_per_s2", "deg/s^2", &[]),
    ("_m_per_s2", "m/s^2", &[("mm/s^2", MILLI)]),
    ("_a_per_s", "A/s", &[("A/ms", KILO), ("mA/s", MILLI)]),
    ("_mm_per_s", "mm/s", &[("m/s", KILO), ("um/s", MILLI)]),
    ("_deg_per_s", "deg/s", &[]),
    ("_kg_per_m3", "kg/m^3", &[("g/cm^3", KILO)]),
    ("_kg_per_m", "kg/m", &[("g/m", MILLI), ("mg/m", MICRO)]),
    ("_k_per_w", "K/W", &[("K/kW", MILLI), ("K/mW", KILO)]),
    ("_j_per_k", "J/K", &[("kJ/K", KILO), ("mJ/K", MILLI)]),
    ("_s_per_m", "s/m", &[]),
    ("_per_m", "1/m", &[("1/mm", KILO)]),
    ("_per_s", "1/s", &[("1/ms", KILO)]),
    ("_n_m2", "N m^2", &[("N mm^2", MICRO)]),
    ("_a_m2", "A m^2", &[("mA m^2", MILLI), ("A mm^2", MICRO)]),
    ("_mpa", "MPa", &[("Pa", MICRO), ("GPa", KILO)]),
    ("_kpa", "kPa", &[("Pa", MILLI), ("MPa", KILO)]),
    ("_ohm", "ohm", &[("mohm", MILLI), ("kohm", KILO)]),
    ("_mm", "mm", &[("m", KILO), ("um", MILLI)]),
    ("_ms", "ms", &[("s", KILO), ("us", MILLI)]),
    ("_us", "us", &[("ms", KILO), ("s", MEGA)]),
    ("_hz", "Hz", &[("kHz", KILO), ("mHz", MILLI)]),
    ("_a", "A", &[("mA", MILLI)]),
    ("_h", "H", &[("mH", MILLI), ("uH", MICRO)]),
    ("_n", "N", &[("mN", MILLI), ("kN", KILO)]),
    ("_s", "s", &[("ms", MILLI), ("us", MICRO)]),
    ("_v", "V", &[("mV", MILLI), ("kV", KILO)]),
];

/// What to add to a refusal of `value`: nothing, or the unit it seems to have been given in.
pub(crate) fn hint(key: &str, value: f64, least: f64, most: f64) -> String {
    let Some((_, unit, others)) = UNITS.iter().find(|(end, ..)| key.ends_with(end)) else {
        return String::new();
    };
    let meant = others.iter().find_map(|(other, (times, over))| {
        let meant = value * times / over;
        (meant != 0.0 && meant >= least && meant <= most).then_some((other, meant))
    });
    meant.map_or_else(String::new, |(other, meant)| format!(", in {unit}: {value} {other} would be {meant}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_in_another_unit_is_told_with_the_number_that_was_meant() {
        for (key, value, least, most, hint_wanted) in [
            ("young_modulus_mpa", 4.8e6, 1e-3, 1e6, ", in MPa: 4800000 Pa would be 4.8"),
            ("young_modulus_mpa", 4.8e9, 1e-3, 1e6, ", in MPa: 4800000000 Pa would be 4800"),
            ("current_max_a", 8000.0, 1e-3, 1e3, ", in A: 8000 mA would be 8"),
            ("slew_max_a_per_s", 0.3, 0.8, 1e6, ", in A/s: 0.3 A/ms would be 300"),
            ("distance_mm", 0.1021, 1.0, 1e4, ", in mm: 0.1021 m would be 102.1"),
            ("gravity_m_per_s2", 9810.0, 0.0, 100.0, ", in m/s^2: 9810 mm/s^2 would be 9.81"),
        ] {
            assert_eq!(hint(key, value, least, most), hint_wanted, "{key} = {value}");
        }
    }

    #[test]
    fn nothing_is_said_of_a_value_that_no_other_unit_explains() {
        for (key, value) in
            [("current_max_a", -8.0), ("current_max_a", 0.0), ("current_max_a", f64::NAN), ("gain", 1e5)]
        {
            assert_eq!(hint(key, value, 1e-3, 1e3), "", "{key} = {value}");
        }
    }

    #[test]
    fn no_end_of_a_key_hides_a_longer_one() {
        for (at, (end, ..)) in UNITS.iter().enumerate() {
            let first = UNITS.iter().position(|(shorter, ..)| end.ends_with(shorter));
            assert_eq!(first, Some(at), "{end}");
        }
    }
}
