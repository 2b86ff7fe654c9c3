#[path = "../../../benches/src/lib.rs"]
mod run;
use armgap_core::filter::Cutoff;
use armgap_core::identify::*;
use armgap_core::real::{Real, lit};
use armgap_core::regression::*;
use nalgebra::SVector;
fn go<T: Real>(scheme: Scheme, variant: Variant, p0: f64) -> (SVector<f64, 9>, Option<u32>, f64, u64) {
    let s = Settings {
        scheme,
        variant,
        cutoff: Cutoff { rad_per_s: lit(50.0) },
        forgetting: T::one(),
        theta0: SVector::<T, 9>::zeros(),
        p0: lit(p0),
    };
    let mut e = Estimator::<T, _, 2, 9, 9>::new(run::arm::<T>(), s);
    let mut bad = None;
    let mut worst = 1.0f64;
    let mut nb = 0u64;
    for (k, x) in run::samples::<T>().iter().enumerate() {
        e.update(x);
        let p =
            e.rls().covariance().map(|x| nalgebra::try_convert::<T, f64>(x).unwrap()).symmetric_eigenvalues();
        let r = p.min() / p.max();
        worst = worst.min(r);
        if r <= 0.0 {
            nb += 1;
            if bad.is_none() {
                bad = Some(k as u32);
            }
        }
    }
    (e.rls().theta().map(|x| nalgebra::try_convert::<T, f64>(x).unwrap()), bad, worst, nb)
}
#[test]
fn y() {
    for v in [Variant::Paper, Variant::Exact] {
        for s in Scheme::ALL {
            for p0 in [1.0, 1e3] {
                let a = go::<f64>(s, v, p0);
                let b = go::<f32>(s, v, p0);
                let d = (0..9).map(|i| (b.0[i] - a.0[i]).abs() / a.0[i].abs()).fold(0.0, f64::max);
                println!(
                    "p0 {p0} {} {v:?}: f64 bad {:?} worst {:e}; f32 bad {:?} n {} worst {:e} theta f32 vs f64 {d:e}",
                    s.name(),
                    a.1,
                    a.2,
                    b.1,
                    b.3,
                    b.2
                );
            }
        }
    }
}
