//! What a campaign draws: values follow their distributions, from seeds that follow from the campaign's;
//! distributions without sense are refused.

use magsteer::config::{CampaignConfig, Document, Number, run_seed};

/// Draws of every kind, and the numbers that they replace.
const RIGHT: &str = r#"
[plant]
seed = 1
step_us = 500
sensor = "tracker"

[plant.errors]
modulus_relative = 0.1

[plant.sensors.tracker]
latency_ms = 5.0
rate_hz = 200.0

[campaign]
experiment = "some.toml"

[[campaign.draw]]
key = "plant.errors.modulus_relative"
uniform = { low = -0.15, high = 0.25 }

[[campaign.draw]]
key = "plant.sensors.tracker.latency_ms"
normal = { mean = 5.0, deviation = 2.0, low = 3.0, high = 20.0 }

[[campaign.draw]]
key = "plant.step_us"
choice = [250, 500, 1000]

[[campaign.draw]]
key = "plant.sensors.tracker.rate_hz"
normal = { mean = 200.0, deviation = 40.0, low = 180.0, high = 210.0 }
"#;

const RUNS: u64 = 4000;

fn document(text: &str) -> Document {
    Document::from_text("campaign.toml", text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// Values of one draw over many runs, in rising order.
fn sample(text: &str, index: usize) -> Vec<f64> {
    let document = document(text);
    let campaign: CampaignConfig = document.section("campaign").expect("right");
    assert_eq!(campaign.check(&document), vec![]);
    let value = |run| campaign.values(&document, run_seed(1, run))[index].value();
    let mut sample: Vec<f64> = (0..RUNS).map(value).collect();
    sample.sort_by(f64::total_cmp);
    sample
}

/// Greatest distance of the sample's distribution from `below`, the probability of a smaller value; in units
/// of 1 / sqrt(n) a true one exceeds 1.95 once in a thousand times (Kolmogorov, Smirnov).
fn distance(sorted: &[f64], below: impl Fn(f64) -> f64) -> f64 {
    let count = sorted.len() as f64;
    let gap = |(index, value): (usize, &f64)| {
        let expected = below(*value);
        (expected - index as f64 / count).abs().max((expected - (index + 1) as f64 / count).abs())
    };
    sorted.iter().enumerate().map(gap).fold(0.0, f64::max) * count.sqrt()
}

/// Probability of a smaller value of a truncated normal distribution, by Simpson's rule.
fn truncated_normal(mean: f64, deviation: f64, low: f64, high: f64) -> impl Fn(f64) -> f64 {
    let mass = move |to: f64| {
        let pieces = 2000;
        let width = (to - low) / f64::from(pieces);
        let density = |x: f64| (-0.5 * ((x - mean) / deviation).powi(2)).exp();
        let weight = |index: i32| match index {
            0 => 1.0,
            index if index == pieces => 1.0,
            index if index % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (0..=pieces).map(|index| weight(index) * density(low + f64::from(index) * width)).sum::<f64>() * width
    };
    let whole = mass(high);
    move |value| mass(value) / whole
}

#[test]
fn uniform_values_are_uniform() {
    let values = sample(RIGHT, 0);
    assert!(values[0] >= -0.15 && values[values.len() - 1] <= 0.25);
    let distance = distance(&values, |value| (value + 0.15) / 0.4);
    assert!(distance < 1.95, "{distance}");
}

/// Goal: both ways of drawing a truncated normal distribution, for a wide and for a narrow range, give that
/// distribution.
#[test]
fn truncated_normal_values_follow_their_density() {
    for (index, [mean, deviation, low, high]) in
        [(1, [5.0, 2.0, 3.0, 20.0]), (3, [200.0, 40.0, 180.0, 210.0])]
    {
        let values = sample(RIGHT, index);
        assert!(values[0] >= low && values[values.len() - 1] <= high);
        let distance = distance(&values, truncated_normal(mean, deviation, low, high));
        assert!(distance < 1.95, "{index}: {distance}");
    }
}

#[test]
fn choices_come_equally_often() {
    let values = sample(RIGHT, 2);
    for choice in [250.0, 500.0, 1000.0] {
        let count = values.iter().filter(|value| **value == choice).count() as f64;
        let share = RUNS as f64 / 3.0;
        // Four deviations of a binomial number.
        assert!((count - share).abs() < 4.0 * (share * 2.0 / 3.0).sqrt(), "{choice}: {count}");
    }
}

/// Goal: what is written as a whole number is drawn as one, both ends as often as the rest.
#[test]
fn whole_numbers_are_drawn_whole() {
    let text = RIGHT.replace("choice = [250, 500, 1000]", "uniform = { low = 50, high = 53 }");
    let values = sample(&text, 2);
    for whole in 50..=53 {
        let count = values.iter().filter(|value| **value == f64::from(whole)).count();
        assert!((880..1120).contains(&count), "{whole}: {count}");
    }
    let document = document(&text);
    let campaign: CampaignConfig = document.section("campaign").expect("right");
    assert!(matches!(
        campaign.values(&document, 5)[..],
        [Number::Decimal(_), Number::Decimal(_), Number::Whole(_), _]
    ));
}

/// Goal: the rule of seeds as it is documented, so that a recorded campaign can be replayed by later
/// versions.
#[test]
fn seeds_follow_the_stated_rule() {
    let scramble = |number: u64| {
        let mixed = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    };
    let mut seeds = std::collections::BTreeSet::new();
    for campaign in [0, 1, 2, u64::MAX] {
        for run in [0_u64, 1, 2, 1_000_000] {
            let step = (run + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            assert_eq!(run_seed(campaign, run), scramble(scramble(campaign).wrapping_add(step)) >> 1);
            assert!(run_seed(campaign, run) < 1 << 63);
            seeds.insert(run_seed(campaign, run));
        }
    }
    assert_eq!(seeds.len(), 16);
    // What runs of the first campaign draw never changes.
    assert_eq!(run_seed(1, 0), 6_915_206_964_022_700_985);
}

/// Goal: a further entry changes no other value, and values of two keys of one run have nothing to do with
/// each other.
#[test]
fn draws_of_different_keys_are_independent() {
    let document = document(RIGHT);
    let campaign: CampaignConfig = document.section("campaign").expect("right");
    let mut shorter = campaign.clone();
    shorter.draw.remove(0);
    assert_eq!(campaign.values(&document, 9)[1..], shorter.values(&document, 9)[..]);
    let pairs = (0..RUNS).map(|run| campaign.values(&document, run_seed(1, run)));
    let normed = pairs.map(|values| (values[0].value() - 0.05, values[3].value() - 195.3));
    let (mut both, mut first, mut second) = (0.0, 0.0, 0.0);
    for (a, b) in normed {
        both += a * b;
        first += a * a;
        second += b * b;
    }
    let correlation = both / f64::sqrt(first * second);
    assert!(correlation.abs() < 4.0 / (RUNS as f64).sqrt(), "{correlation}");
}

#[test]
fn distributions_without_sense_are_refused_with_their_key() {
    let two = "uniform = { low = 1, high = 2 }\nchoice =";
    let cases = [
        ("plant.errors.modulus_relative", "plant.errors.modulus", "draw[0].key", "a number below [plant]"),
        ("plant.errors.modulus_relative", "plant.sensor", "draw[0].key", "a number below [plant]"),
        ("plant.errors.modulus_relative", "campaign.experiment", "draw[0].key", "a number below [plant]"),
        ("plant.errors.modulus_relative", "plant.seed", "draw[0].key", "drawn for every run anyway"),
        ("plant.step_us", "plant.errors.modulus_relative", "draw[2].key", "once, not twice"),
        ("low = -0.15, high = 0.25", "low = 0.25, high = -0.15", "draw[0].uniform.low", "< high"),
        ("low = -0.15", "low = -inf", "draw[0].uniform.low", "finite"),
        ("low = -0.15", "low = nan", "draw[0].uniform.low", "finite"),
        ("deviation = 2.0", "deviation = 0.0", "draw[1].normal.deviation", "> 0"),
        ("mean = 5.0", "mean = 2.0", "draw[1].normal.mean", "from 3 to 20"),
        ("choice = [250, 500, 1000]", "choice = []", "draw[2].choice", "at least one"),
        ("choice = [250, 500, 1000]", "choice = [250, nan]", "draw[2].choice", "finite"),
        ("choice = [250, 500, 1000]", "choice = [250, 0.5]", "draw[2].choice[1]", "a whole number"),
        ("choice = [250, 500, 1000]", "", "draw[2]", "exactly one of uniform, normal, choice"),
        ("choice =", two, "draw[2]", "exactly one of uniform, normal, choice"),
    ];
    let (plant, table) = RIGHT.split_once("[campaign]").expect("has the table");
    for (right, wrong, key, expected) in cases {
        assert!(table.contains(right), "{right}");
        let text = format!("{plant}[campaign]{}", table.replacen(right, wrong, 1));
        let document = document(&text);
        let campaign: CampaignConfig = document.section("campaign").expect("of the right types");
        let refused = campaign.check(&document);
        assert_eq!(refused.len(), 1, "{wrong}: {refused:?}");
        assert_eq!(refused[0].key, format!("campaign.{key}"), "{wrong}");
        assert!(refused[0].expected.contains(expected), "{wrong}: {refused:?}");
    }
}
