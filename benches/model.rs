//! Time of the models that the control cycle evaluates: `cargo bench --bench model`.

#[path = "../tests/field_support/mod.rs"]
mod field_support;

fn main() {
    divan::main();
}

/// The field and its derivatives at one point.
mod field {
    use divan::{Bencher, black_box};
    use magsteer::magnetics::{AppliedField, CoilArray, CoilPose, FieldSample, Multipole};
    use nalgebra::Vector3;

    use super::field_support::bigmag;

    const POINT: Vector3<f64> = Vector3::new(0.02, 0.01, -0.015);

    /// One coil for 1 A, with gradient and second gradient, by order.
    #[divan::bench(args = [1, 2, 4, 6, 10], sample_size = 4000)]
    fn one_coil_both_gradients(bencher: Bencher, order: usize) {
        let mut coefficients = bigmag().coils[0].coefficients.clone();
        coefficients.resize(order, 1e-15);
        let coil = Multipole::new(&coefficients);
        let pose = CoilPose { origin: Vector3::new(-0.08, 0.0, -0.06), axis: Vector3::new(0.8, 0.0, 0.6) };
        bencher.bench_local(|| {
            let made = black_box(&coil).evaluate(black_box(&pose), black_box(&POINT));
            // By reference: the answer is made once, not copied.
            black_box(&made);
        });
    }

    /// All six coils of BigMag: field, both gradients, and the columns of six currents and two angles.
    #[divan::bench(sample_size = 2000)]
    fn six_coils_all_columns(bencher: Bencher) {
        let posed = CoilArray::new(&bigmag()).posed(&[0.5, -0.75]);
        let field = posed.actuated(&[3.0, -2.0, 5.0, 1.0, -7.0, 4.0]);
        let mut sample = FieldSample::default();
        bencher.bench_local(|| {
            black_box(&field).evaluate(black_box(&POINT), &mut sample);
            black_box(&sample);
        });
    }

    /// Turning both frames of BigMag to new angles.
    #[divan::bench(sample_size = 2000)]
    fn pose_six_coils(bencher: Bencher) {
        let array = CoilArray::new(&bigmag());
        let mut posed = array.posed(&[0.0, 0.0]);
        bencher.bench_local(|| {
            array.pose_into(black_box(&[0.5, -0.75]), &mut posed);
            black_box(&posed);
        });
    }
}
