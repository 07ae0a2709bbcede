//! Logarithmic axes: where they end, and how their numbers are written.
//!
//! The plotting library numbers 1, 2 and 5 of each decade where an axis reaches into three at most, and powers of ten alone
//! where it reaches into more.

use std::sync::Arc;

use kuva::render::layout::TickFormat;

/// How the numbers of an axis with these ends are written: all of them out, or, where the longest would then have more than so
/// many characters, all of them by their power of ten.
pub(super) fn numbers((least, most): (f64, f64), characters_max: usize) -> TickFormat {
    let mut written = numbered(least, most).map(|number| text(number, true));
    let is_plain = written.all(|number| number.len() <= characters_max);
    TickFormat::Custom(Arc::new(move |value| text(value, is_plain)))
}

fn text(value: f64, is_plain: bool) -> String {
    // Powers of ten are not exact.
    let power = (value.log10() + 1e-9).floor();
    if is_plain {
        let digits = (-power).max(0.0) as usize;
        format!("{value:.digits$}")
    } else if power == 0.0 {
        format!("{value:.0}")
    } else {
        format!("{:.0}e{power}", value / 10_f64.powf(power))
    }
}

/// Ends so far apart that at least two numbers stand between them: one alone tells no scale.
pub(super) fn with_two_numbers(ends: (f64, f64)) -> (f64, f64) {
    let (mut least, mut most) = ends;
    while !(least > 0.0 && numbered(least, most).count() >= 2) {
        let all = || numbered(least / 10.0, most * 10.0);
        let (Some(below), Some(above)) =
            (all().rfind(|number| *number < least), all().find(|number| *number > most))
        else {
            break;
        };
        // The one that is nearer; a little beyond, so that it is not lost to rounding.
        if least / below <= above / most { least = 0.99 * below } else { most = 1.01 * above }
    }
    (least, most)
}

/// Ends between which no more numbers stand than have room: an axis that reaches into three decades is led into a
/// fourth, where powers of ten alone are numbered.
#[cfg(feature = "record")]
pub(super) fn sparse((least, most): (f64, f64), numbers_max: usize) -> (f64, f64) {
    let first = least.log10().floor();
    if numbered(least, most).count() <= numbers_max {
        return (least, most);
    }
    if most.log10().ceil() - first == 3.0 { (0.99 * 10_f64.powf(first), most) } else { (least, most) }
}

/// 1, 2 and 5 of each decade between two ends, upwards.
fn numbered(least: f64, most: f64) -> impl DoubleEndedIterator<Item = f64> {
    let decades = least.log10().floor() as i32..=most.log10().ceil() as i32;
    let numbers = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|number| number * 10_f64.powi(decade)));
    numbers.filter(move |number| (least..=most).contains(number))
}

#[cfg(test)]
mod tests {
    use super::{numbered, numbers, text, with_two_numbers};

    #[test]
    fn numbers_of_an_axis_are_of_one_style() {
        let written = |values: &[f64], is_plain| -> Vec<String> {
            values.iter().map(|value| text(*value, is_plain)).collect()
        };
        assert_eq!(
            written(&[0.05, 0.1, 0.2, 0.5, 1.0, 20.0], true),
            ["0.05", "0.1", "0.2", "0.5", "1", "20"]
        );
        let powers = [10_f64.powi(-4), 10_f64.powi(-3), 2.0 * 10_f64.powi(-2), 1.0];
        assert_eq!(written(&powers, false), ["1e-4", "1e-3", "2e-2", "1"]);
        for decade in -8..8 {
            let value = 10_f64.powi(decade);
            assert_eq!(text(value, true).parse::<f64>(), Ok(value), "not rounded to nothing");
        }
    }

    #[test]
    fn numbers_are_written_out_as_long_as_there_is_room_for_the_longest() {
        let written = |ends, characters_max, value| numbers(ends, characters_max).format(value);
        assert_eq!(written((0.004, 2.0), 5, 0.1), "0.1");
        assert_eq!(written((0.0004, 2.0), 5, 0.1), "1e-1");
        assert_eq!(written((1.0, 3e5), 6, 1e5), "100000");
        assert_eq!(written((1.0, 3e5), 5, 1e5), "1e5");
    }

    #[test]
    fn an_axis_has_two_numbers_at_least_and_keeps_what_it_showed() {
        for (least, most) in [(0.03, 0.09), (0.051, 0.052), (0.3, 0.4), (1.0, 1.0), (7.0, 900.0), (2.1, 4.9)]
        {
            let (from, to) = with_two_numbers((least, most));
            assert!(from <= least && to >= most, "{from} {to}");
            assert!(numbered(from, to).count() >= 2, "{from} {to}");
            assert!(to / from <= (most / least).max(1.0) * 12.0, "no wider than it must be: {from} {to}");
        }
        assert_eq!(with_two_numbers((0.04, 3.0)), (0.04, 3.0), "wide enough already");
    }
}
