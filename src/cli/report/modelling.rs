//! What the model rests on: its field, and the forces that the field exerts.

use magsteer::magnetics::{CoilPose, Multipole};
use magsteer::math::angle_between;
use magsteer_hal::description::CoilDescription;
use nalgebra::Vector3;

use super::run::Run;
use crate::cli::figures::{Axis, Chart, Look, Sheet, Trace};
use crate::cli::model_shapes::Shapes;

/// How far the field is drawn, m from the expansion point.
const FIELD_REACH: f64 = 0.16;
/// Points of a curve.
const POINTS: u32 = 120;

/// The paper's Fig. 3: the field of each type of coil along its axis, by its whole series and by its dipole alone.
pub fn field(run: &Run) -> Sheet {
    let mut types: Vec<&CoilDescription> = Vec::new();
    for coil in &run.config.description.coils {
        if !types.iter().any(|known| known.coil_type == coil.coil_type) {
            types.push(coil);
        }
    }
    let charts = types.iter().map(|coil| {
        let from = coil.valid_from_x;
        let field = |series: &Multipole, x: f64| {
            let pose = CoilPose { origin: Vector3::zeros(), axis: Vector3::x() };
            series.evaluate(&pose, &Vector3::new(x, 0.0, 0.0)).column.field.x
        };
        let along =
            || (0..=POINTS).map(|index| from + (FIELD_REACH - from) * f64::from(index) / f64::from(POINTS));
        let whole = Multipole::new(&coil.coefficients);
        let unit = Multipole::new(&[1.0]);
        // The dipole nearest to the series in least squares along the axis: one unknown.
        let products = along().map(|x| field(&unit, x) * field(&whole, x)).sum::<f64>();
        let dipole = Multipole::new(&[products / along().map(|x| field(&unit, x).powi(2)).sum::<f64>()]);
        let curve = |series: &Multipole| -> Vec<(f64, f64)> {
            along().map(|x| (x * 1e3, field(series, x) * coil.current_max * 1e3)).collect()
        };
        Chart {
            title: Some(format!("{} coil", coil.coil_type)),
            x: Axis::new("distance (mm)"),
            y: Axis::new(format!("field at {} A (mT)", coil.current_max)).logarithmic(),
            traces: vec![
                Trace::new(
                    format!("multipole (P = {})", coil.coefficients.len()),
                    Look::Line(0),
                    curve(&whole),
                ),
                Trace::new("nearest dipole (P = 1)", Look::Line(1), curve(&dipole)),
            ],
            ..Chart::default()
        }
    });
    Sheet {
        name: "field",
        caption: "Field of each type of coil on its axis by the series of the configuration, from where that holds, and by the dipole \
                  that comes nearest to it there. `magsteer field fit` draws both beside measurements."
            .to_owned(),
        columns: 2,
        height: 220.0,
        charts: charts.collect(),
    }
}

/// The paper's Fig. 7: how far the model is off what was measured at the end of each step, with and without magnetic forces.
pub fn forces(run: &Run) -> Option<Sheet> {
    let mut models = [Shapes::at_rest(&run.config)?, Shapes::without_forces(&run.config)?];
    let magnets = run.magnets().len();
    let mut errors = [vec![Vec::new(); magnets], vec![Vec::new(); magnets]];
    let mut samples = run.samples.iter().peekable();
    let mut last = None;
    for (index, step) in run.steps.iter().enumerate() {
        while let Some(sample) = samples.next_if(|sample| sample.time <= step.end) {
            for model in &mut models {
                model.follow(&sample.currents, &sample.angles);
            }
            last = Some(sample);
        }
        let Some(sample) = last else { continue };
        for (model, errors) in models.iter().zip(&mut errors) {
            let posed = model.pass().magnets();
            for ((magnet, measured), errors) in posed.iter().zip(&sample.measured).zip(errors) {
                let error = angle_between(&magnet.tangent(), &Vector3::from(*measured));
                errors.push((index as f64 + 1.0, error.to_degrees()));
            }
        }
    }
    let [with, without] = errors;
    let most = without.iter().chain(&with).flatten().fold(0.0_f64, |most, point| most.max(point.1));
    let steps = run.steps.len();
    // Ten numbers have room.
    let number = |step: usize| {
        if step.is_multiple_of(steps.div_ceil(10)) { (step + 1).to_string() } else { String::new() }
    };
    let charts =
        run.magnets().iter().zip(with.into_iter().zip(without)).map(|(name, (with, without))| Chart {
            title: Some(name.clone()),
            x: Axis::new("step").named((0..steps).map(number)),
            y: Axis::new("model error (deg)").between(0.0, 1.1 * most.max(1e-3)),
            traces: vec![
                Trace::new("torques and forces", Look::Dots(0), with),
                Trace::new("torques alone", Look::Dots(1), without),
            ],
            ..Chart::default()
        });
    (!run.steps.is_empty()).then(|| Sheet {
        name: "forces",
        caption: "Angle between each magnet as measured at the end of a step and as the model has it at the same currents: with the forces that \
                  field gradients exert, and with torques alone."
            .to_owned(),
        columns: 2,
        height: 220.0,
        charts: charts.collect(),
    })
}
