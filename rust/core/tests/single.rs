use armgap_core::real::{Real, lit};
use armgap_core::rls::Rls;
use nalgebra::{SMatrix, SVector};
struct Noise(u64);
impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
fn life<T: Real + std::fmt::LowerExp>(p0: f64, mu: f64, scale: [f64; 6]) {
    let truth = [2.0, -0.1, 0.3, 38.0, 1.8, 7.6];
    let mut noise = Noise(3);
    let mut rls = Rls::<T, 6>::new(SVector::zeros(), lit(p0), lit(mu));
    let mut first_bad = None;
    let mut worst = f64::INFINITY;
    for k in 0..1_000_000 {
        let psi64 = SMatrix::<f64, 2, 6>::from_fn(|_, j| noise.next() * scale[j]);
        let y = psi64 * SVector::from(truth);
        rls.update(&psi64.map(lit::<T>), &y.map(lit::<T>));
        if k % 1000 == 0 || k < 2000 {
            let p = rls.covariance().map(|x| nalgebra::try_convert::<T, f64>(x).unwrap());
            let e = p.symmetric_eigenvalues();
            worst = worst.min(e.min() / e.max());
            if e.min() <= 0.0 && first_bad.is_none() {
                first_bad = Some(k);
            }
        }
    }
    let th = rls.theta().map(|x| nalgebra::try_convert::<T, f64>(x).unwrap());
    let off = (0..6).map(|i| ((th[i] - truth[i]) / truth[i]).abs()).fold(0.0, f64::max);
    println!(
        "{} p0 {p0} mu {mu} scale {scale:?}: bad at {first_bad:?}, min eig ratio {worst:e}, theta off {off:e}, rejected {} maxP {:e}",
        std::any::type_name::<T>(),
        rls.rejected(),
        rls.covariance().amax()
    );
}
#[test]
fn x() {
    for scale in [[1.0, 1e-2, 10.0, 1.0, 0.3, 5.0], [1.0; 6], [1.0, 1e-3, 100.0, 1.0, 1.0, 1.0]] {
        for p0 in [1.0, 1e3, 1e6] {
            for mu in [1.0, 0.999] {
                life::<f64>(p0, mu, scale);
                life::<f32>(p0, mu, scale);
            }
        }
    }
}
