//! The map as a picture: what is reached by angle from rest and by bend, and what it takes, ring by ring.

use anyhow::anyhow;
use kuva::backend::png::PngBackend;
use kuva::plot::{LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::figure::{Figure, FigureLegendPosition};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use magsteer::control::plan::{Plan, Unreached};

use super::sample::Sample;
use super::survey::Survey;

/// Colours that stay apart in print and for colour-blind readers (Okabe, Ito 2008).
const REACHED: &str = "#0072B2";
const UNREACHED: &str = "#D55E00";
/// Rings, from the innermost; the last stands for all beyond.
const RINGS: [&str; 6] = ["#009E73", "#56B4E9", "#E69F00", "#CC79A7", "#000000", "#999999"];
/// Pixels per unit of the layout: sharp at a journal's column width.
const SCALE: f32 = 2.0;

type Panel = (Vec<Plot>, Layout);

/// Draws the map; returns the bytes of a PNG.
///
/// # Errors
/// When the picture cannot be rendered.
pub fn draw(
    magnets: &[&str],
    samples: &[Sample],
    plans: &[Result<Plan, Unreached>],
    survey: &Survey,
) -> anyhow::Result<Vec<u8>> {
    let map = Map { magnets, samples, plans, survey };
    let panels = vec![
        map.by_angle(),
        map.by_bend(),
        map.shares(),
        map.cumulative(["currents", "largest current on the way (A)"], Sense::AtMost, |plan| {
            plan.walked.current_max
        }),
        map.cumulative(["stability", "least margin of stability on the way"], Sense::AtLeast, |plan| {
            plan.walked.margin_min
        }),
        map.cumulative(["conditioning", "condition number at the target"], Sense::AtMost, |plan| {
            plan.posture.condition
        }),
    ];
    let (plots, layouts): (Vec<_>, Vec<_>) = panels.into_iter().unzip();
    let figure = Figure::new(2, 3)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(400.0, 330.0)
        .with_padding(30.0)
        .with_shared_legend_entries(map.legend())
        .with_shared_legend_position(FigureLegendPosition::BottomCenter);
    let picture = PngBackend::new().with_scale(SCALE).render_scene(&figure.render());
    picture.map_err(|reason| anyhow!("the picture cannot be drawn: {reason}"))
}

/// Which samples a curve counts.
#[derive(Clone, Copy, PartialEq)]
enum Sense {
    AtMost,
    AtLeast,
}

struct Map<'a> {
    magnets: &'a [&'a str],
    samples: &'a [Sample],
    plans: &'a [Result<Plan, Unreached>],
    survey: &'a Survey,
}

impl Map<'_> {
    fn color(&self, ring: usize) -> &'static str {
        RINGS[ring.min(RINGS.len() - 1)]
    }

    fn cone_deg(&self) -> f64 {
        self.survey.rings.last().map_or(0.0, |ring| ring.to_deg)
    }

    /// Dots of what was reached, and over them those of what was not.
    fn dots(&self, place: impl Fn(&Sample) -> (f64, f64)) -> Vec<Plot> {
        let of = |reached: bool| -> Vec<(f64, f64)> {
            let each = self.samples.iter().zip(self.plans).filter(|(_, plan)| plan.is_ok() == reached);
            each.map(|(sample, _)| place(sample)).collect()
        };
        let plot = |points: Vec<(f64, f64)>, color: &str, size: f64| -> Plot {
            ScatterPlot::new()
                .with_data(points)
                .with_color(color)
                .with_size(size)
                .with_marker_opacity(0.7)
                .into()
        };
        vec![plot(of(true), REACHED, 2.2), plot(of(false), UNREACHED, 3.0)]
    }

    /// The first two magnets against each other; of a single one where it points, seen along its rest direction.
    fn by_angle(&self) -> Panel {
        let most = self.cone_deg();
        let layout = |least: f64| {
            let layout =
                Layout::new((least, most), (least, most)).with_x_axis_min(least).with_x_axis_max(most);
            layout.with_y_axis_min(least).with_y_axis_max(most)
        };
        if let [first, second, ..] = self.magnets {
            let plots =
                self.dots(|sample| (sample.from_rest[0].to_degrees(), sample.from_rest[1].to_degrees()));
            let label = |magnet: &str| format!("target of {magnet} from its rest (deg)");
            let layout = layout(0.0).with_title("targets by angle from rest").with_title_size(14);
            return (plots, layout.with_x_label(label(first)).with_y_label(label(second)));
        }
        let plots = self.dots(|sample| {
            let [x, y, z] = sample.target[0];
            let turn = y.atan2(z.hypot(x).copysign(z));
            let angle = sample.from_rest[0].to_degrees();
            (angle * turn.cos(), angle * turn.sin())
        });
        let layout = layout(-most).with_title("targets about rest").with_title_size(14);
        let layout = layout.with_x_label("tilt from rest (deg)").with_y_label("tilt across (deg)");
        (plots, layout)
    }

    fn by_bend(&self) -> Panel {
        let farthest = |sample: &Sample| sample.from_rest.iter().copied().fold(0.0, f64::max).to_degrees();
        let plots = self.dots(|sample| (farthest(sample), sample.bend.to_degrees()));
        let top = self.samples.iter().map(|sample| sample.bend.to_degrees()).fold(1.0, f64::max).ceil();
        let layout = Layout::new((0.0, self.cone_deg()), (0.0, top))
            .with_x_axis_min(0.0)
            .with_x_axis_max(self.cone_deg())
            .with_y_axis_min(0.0)
            .with_y_axis_max(top)
            .with_x_label("farthest magnet from its rest (deg)")
            .with_y_label("angle between the magnets (deg)")
            .with_title("targets by bend")
            .with_title_size(14);
        (plots, layout)
    }

    /// Share of each ring with its interval.
    fn shares(&self) -> Panel {
        let mut plots: Vec<Plot> = Vec::new();
        let shown = self.survey.rings.iter().enumerate().filter(|(_, ring)| ring.samples > 0);
        for (index, ring) in shown {
            let middle = 0.5 * (ring.from_deg + ring.to_deg);
            let [low, high] = ring.reached_interval.map(|share| 100.0 * share);
            let line = |points: Vec<(f64, f64)>| -> Plot {
                LinePlot::new().with_data(points).with_color(self.color(index)).with_stroke_width(1.6).into()
            };
            let cap = 0.1 * (ring.to_deg - ring.from_deg);
            plots.push(line(vec![(middle, low), (middle, high)]));
            plots.extend([low, high].map(|at| line(vec![(middle - cap, at), (middle + cap, at)])));
            let dot = vec![(middle, 100.0 * ring.reached_fraction.unwrap_or(0.0))];
            plots.push(ScatterPlot::new().with_data(dot).with_color(self.color(index)).with_size(4.0).into());
        }
        let layout = Layout::new((0.0, self.cone_deg()), (0.0, 103.0))
            .with_x_axis_min(0.0)
            .with_x_axis_max(self.cone_deg())
            .with_y_axis_min(0.0)
            .with_y_axis_max(103.0)
            .with_x_label("farthest magnet from its rest (deg)")
            .with_y_label("reached, with 95 % interval (%)")
            .with_title("share reached")
            .with_title_size(14);
        (plots, layout)
    }

    /// One curve a ring: the share of its targets, by solid angle, that are reached with at most, or at least, a value.
    fn cumulative(&self, [title, label]: [&str; 2], sense: Sense, of: impl Fn(&Plan) -> f64) -> Panel {
        let values = || self.plans.iter().filter_map(|plan| plan.as_ref().ok()).map(&of);
        let top = values().filter(|value| value.is_finite()).fold(0.0, f64::max).max(1e-6);
        let end = 1.04 * top;
        let mut plots: Vec<Plot> = Vec::new();
        for ring in 0..self.survey.rings.len() {
            let each = || self.samples.iter().zip(self.plans).filter(|(sample, _)| sample.ring == ring);
            let whole: f64 = each().map(|(sample, _)| sample.weight).sum();
            let mut steps: Vec<(f64, f64)> =
                each().filter_map(|(sample, plan)| Some((of(plan.as_ref().ok()?), sample.weight))).collect();
            steps.sort_by(|a, b| a.0.total_cmp(&b.0));
            let reached: f64 = steps.iter().map(|step| step.1).sum();
            let mut share = if sense == Sense::AtMost { 0.0 } else { reached };
            let mut curve = vec![(0.0, 100.0 * share / whole)];
            for (value, weight) in steps {
                curve.push((value.min(end), 100.0 * share / whole));
                share += if sense == Sense::AtMost { weight } else { -weight };
                curve.push((value.min(end), 100.0 * share.max(0.0) / whole));
            }
            curve.push((end, 100.0 * share.max(0.0) / whole));
            if whole > 0.0 {
                let line = LinePlot::new().with_data(curve).with_color(self.color(ring));
                plots.push(line.with_stroke_width(1.6).into());
            }
        }
        let y_label = match sense {
            Sense::AtMost => "reached with at most that (%)",
            Sense::AtLeast => "reached with at least that (%)",
        };
        let layout = Layout::new((0.0, end), (0.0, 103.0))
            .with_x_axis_min(0.0)
            .with_x_axis_max(end)
            .with_y_axis_min(0.0)
            .with_y_axis_max(103.0)
            .with_x_label(label)
            .with_y_label(y_label)
            .with_title(title)
            .with_title_size(14);
        (plots, layout)
    }

    fn legend(&self) -> Vec<LegendEntry> {
        let entry = |label: String, color: &str, shape: LegendShape| LegendEntry {
            label,
            color: color.to_owned(),
            shape,
            dasharray: None,
        };
        let mut entries = vec![
            entry("reached".to_owned(), REACHED, LegendShape::Circle),
            entry("not reached".to_owned(), UNREACHED, LegendShape::Circle),
        ];
        for (index, ring) in self.survey.rings.iter().enumerate() {
            let label = format!("{:.0} to {:.0} deg from rest", ring.from_deg, ring.to_deg);
            entries.push(entry(label, self.color(index), LegendShape::Line));
        }
        entries
    }
}
