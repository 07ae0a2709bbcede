//! What a sample says of what it was drawn from, with 95 % intervals.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, k | trials, successes |
//! | p | share of successes, k / n |
//! | z | 1.96, the normal distribution's quantile at 97.5 % |
//! | q | level of a quantile, 0 to 1 |
//!
//! Sources: E. B. Wilson, *Probable inference, the law of succession, and statistical inference*, J. Am.
//! Stat. Assoc. 22, 1927, for the interval of a share; H. A. David, H. N. Nagaraja, *Order Statistics*, 3rd
//! ed., section 7.1, for that of a quantile, which presumes nothing of the distribution.

/// z: the normal distribution's quantile at 97.5 %.
const Z: f64 = 1.959_963_984_540_054;
/// Probability that the interval of a quantile leaves out on either side, at most.
const TAIL: f64 = 0.025;

/// Wilson's 95 % interval of a share of which `successes` of `trials` were seen; all of [0, 1] when there
/// were no trials.
///
/// `(p + z^2 / 2n -+ z sqrt(p (1 - p) / n + z^2 / 4n^2)) / (1 + z^2 / n)`
#[must_use]
pub fn wilson_interval(successes: u64, trials: u64) -> [f64; 2] {
    if trials == 0 {
        return [0.0, 1.0];
    }
    let n = trials as f64;
    let p = successes as f64 / n;
    let centre = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    // At no or nothing but successes an end is exactly 0 or 1, which rounding would miss.
    let low = if successes == 0 { 0.0 } else { (centre - half) / scale };
    let high = if successes >= trials { 1.0 } else { (centre + half) / scale };
    [low, high]
}

/// Quantile of a sample in rising order, linear between neighbours; `None` of nothing.
#[must_use]
pub fn quantile(sorted: &[f64], level: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let position = level.clamp(0.0, 1.0) * last as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (position - below as f64) * (sorted[above] - sorted[below]))
}

/// 95 % interval of the quantile of what the sample in rising order was drawn from: two of its members,
/// between which the quantile lies whatever the distribution. An end for which there are too few members is
/// `None`.
///
/// With B, how many of n members lie below the quantile, binomial (n, q): the l-th member is the greatest
/// with P(B < l) <= 2.5 %, the u-th the least with P(B >= u) <= 2.5 %.
#[must_use]
pub fn quantile_interval(sorted: &[f64], level: f64) -> [Option<f64>; 2] {
    let below = cumulative_binomial(sorted.len(), level);
    // below[k] = P(B <= k), and so P(B < l) = below[l - 1]. Members count from 1.
    let low = (1..=sorted.len()).rev().find(|l| below[l - 1] <= TAIL);
    let high = (1..=sorted.len()).find(|u| below[u - 1] >= 1.0 - TAIL);
    [low, high].map(|member| Some(sorted[member? - 1]))
}

/// P(B <= k) for k = 0 to n, of B binomial (n, q) with 0 < q < 1.
fn cumulative_binomial(n: usize, q: f64) -> Vec<f64> {
    // In logarithms: (1 - q)^n underflows for large n.
    let mut logarithm = n as f64 * (1.0 - q).ln();
    let odds = (q / (1.0 - q)).ln();
    let mut sum = 0.0;
    (0..=n)
        .map(|k| {
            sum += logarithm.exp();
            logarithm += ((n - k) as f64 / (k + 1) as f64).ln() + odds;
            sum
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SplitMix;

    fn assert_interval(actual: [f64; 2], expected: [f64; 2]) {
        for (actual, expected) in actual.iter().zip(expected) {
            assert!((actual - expected).abs() < 5e-5, "{actual} instead of {expected}");
        }
    }

    /// Goal: published examples. 81 of 263 and 15 of 148: Newcombe, Statistics in Medicine 17, 1998, table I,
    /// method 3; 0 of 20 and 1 of 29 there too.
    #[test]
    fn wilson_interval_agrees_with_published_values() {
        assert_interval(wilson_interval(81, 263), [0.2553, 0.3662]);
        assert_interval(wilson_interval(15, 148), [0.0624, 0.1605]);
        assert_interval(wilson_interval(0, 20), [0.0, 0.1611]);
        assert_interval(wilson_interval(1, 29), [0.0061, 0.1718]);
    }

    #[test]
    fn wilson_interval_holds_the_share_and_stays_within_zero_and_one() {
        assert_eq!(wilson_interval(0, 0), [0.0, 1.0]);
        for trials in [1, 2, 10, 200, 1000] {
            for successes in 0..=trials {
                let [low, high] = wilson_interval(successes, trials);
                let share = successes as f64 / trials as f64;
                assert!(0.0 <= low && low <= share && share <= high && high <= 1.0, "{successes}/{trials}");
            }
        }
    }

    #[test]
    fn quantile_is_linear_between_neighbours() {
        let sample = [1.0, 2.0, 4.0];
        for (level, expected) in [(0.0, 1.0), (0.25, 1.5), (0.5, 2.0), (0.75, 3.0), (1.0, 4.0)] {
            assert_eq!(quantile(&sample, level), Some(expected));
        }
        assert_eq!((quantile(&[], 0.5), quantile(&[3.0], 0.95)), (None, Some(3.0)));
    }

    /// Goal: the ranks of tables of binomial intervals: median of 10: 2nd to 9th; of 20: 6th to 15th; of 100:
    /// 40th to 61st.
    #[test]
    fn interval_of_the_median_has_the_ranks_of_tables() {
        for (count, low, high) in [(10, 2.0, 9.0), (20, 6.0, 15.0), (100, 40.0, 61.0)] {
            let sample: Vec<f64> = (1..=count).map(f64::from).collect();
            assert_eq!(quantile_interval(&sample, 0.5), [Some(low), Some(high)], "{count}");
        }
        assert_eq!(quantile_interval(&[1.0, 2.0, 3.0], 0.5), [None, None]);
        assert_eq!(quantile_interval(&[], 0.5), [None, None]);
    }

    /// Goal: of 2,000 samples of 100 the interval holds the 90 % quantile of what they were drawn from in 95
    /// % and a little more.
    #[test]
    fn interval_of_a_quantile_holds_it_as_often_as_it_says() {
        let mut stream = SplitMix::new(3);
        let mut held = 0;
        for _ in 0..2000 {
            let mut sample: Vec<f64> = (0..100).map(|_| stream.unit()).collect();
            sample.sort_by(f64::total_cmp);
            let [low, high] = quantile_interval(&sample, 0.9).map(|end| end.expect("enough members"));
            held += u32::from(low <= 0.9 && 0.9 <= high);
        }
        assert!((1890..=1970).contains(&held), "{held}");
    }
}
