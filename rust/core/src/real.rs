//! The scalar type: `f64` on a desktop, `f32` on a controller.

use nalgebra::RealField;

/// A real number the core computes with: `f32` or `f64`.
pub trait Real: RealField + Copy {}
impl<T: RealField + Copy> Real for T {}

/// A literal constant in the scalar type `T`.
#[inline]
pub fn lit<T: Real>(x: f64) -> T {
    nalgebra::convert(x)
}

/// Beyond this many quarter turns the argument is reduced by the library.
const MANY_TURNS: f64 = 1e5;

/// Sine and cosine together, to rounding: quarter turns are taken off in three exact parts (Cody and Waite 1980), and Taylor's series to
/// the fifteenth and sixteenth power gives the rest. No call, so it can be inlined.
#[inline]
pub fn sin_cos<T: Real>(x: T) -> (T, T) {
    let wide: f64 = nalgebra::try_convert(x).unwrap_or(f64::NAN);
    let turns = wide * core::f64::consts::FRAC_2_PI;
    if !(turns.abs() < MANY_TURNS) {
        return x.sin_cos();
    }
    let quarter = (turns + if turns < 0.0 { -0.5 } else { 0.5 }) as i32;
    let k = f64::from(quarter);
    // The first two parts end in so many zeros that their products with the count are exact.
    let r = lit::<T>(
        wide - k * 1.570_796_326_734_125_6 - k * 6.077_100_506_303_966e-11 - k * 2.022_266_248_795_950_6e-21,
    );
    let s = r * r;
    let sine = [-1.0 / 6.0, 20.0, 42.0, 72.0, 110.0, 156.0, 210.0];
    let cosine = [-0.5, 12.0, 30.0, 56.0, 90.0, 132.0, 182.0, 240.0];
    let series = |ratios: &[f64]| {
        let mut sum = T::one();
        for ratio in ratios.iter().skip(1).rev() {
            sum = T::one() - sum * s * lit(1.0 / ratio);
        }
        T::one() + sum * s * lit(ratios.first().copied().unwrap_or(0.0))
    };
    let (sin, cos) = (r * series(&sine), series(&cosine));
    match quarter & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// Sign with `sgn(0) = 0`, as Coulomb friction at rest exerts no torque of its own.
#[inline]
pub fn sgn<T: Real>(x: T) -> T {
    if x > T::zero() {
        T::one()
    } else if x < T::zero() {
        -T::one()
    } else {
        T::zero()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::sin_cos;

    #[test]
    fn sine_and_cosine_are_good_to_rounding() {
        for i in -200_000..=200_000_i32 {
            let x = f64::from(i) * 1.234_567e-3;
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs() < 3e-16 && (c - x.cos()).abs() < 3e-16, "{x}");
        }
        let (s, c) = sin_cos(1e9_f64);
        assert!((s - 1e9_f64.sin()).abs() < 1e-15 && (c - 1e9_f64.cos()).abs() < 1e-15);
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
    }
}
