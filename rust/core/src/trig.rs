//! Sine and cosine together, with the same few instructions for every angle an arm can have.
//!
//! Library functions branch for small, medium and large angles and, without a platform's mathematical library, take more time than the whole
//! least-squares update. Here the angle is brought into half a turn around zero by Cody and Waite's subtraction of `k pi` in three parts, whose
//! products with `k` are exact; both series are evaluated at once, in pairs of terms, and an odd `k` changes both signs. Larger angles and NaN go to
//! the library. Errors stay below 1.5 rounding units of 1.
//!
//! W. J. Cody and W. Waite 1980, *Software manual for the elementary functions*, chapter 8. The coefficients interpolate the series at
//! Chebyshev's points of `r^2` up to `(pi/2)^2`; the polynomials are off by less than 4e-17, in single precision by 1.1e-10.

use crate::cpu::{Cpu, Kernel, Level};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::real::{Real, lit};

/// Constants of the series of sine and cosine for one precision.
struct Constants {
    /// Largest angle, rad, that the series is used for; up to it `k`, the number of half turns, has few enough bits.
    largest: f64,
    /// Number that, added to a value and subtracted again, rounds the value to an integer.
    rounder: f64,
    /// `pi` as a sum of three parts.
    parts: [f64; 3],
    /// Coefficients of `(sin r - r)/r^3` in powers of `r^2`.
    sine: [f64; 8],
    /// Coefficients of `(cos r - 1 + r^2/2)/r^4` in powers of `r^2`.
    cosine: [f64; 8],
}

const DOUBLE: Constants = Constants {
    largest: 1e5,
    rounder: 6_755_399_441_055_744.0,
    parts: [3.141_592_653_468_251_2, 1.215_420_101_260_793_2e-10, 4.044_532_497_591_901e-21],
    sine: [
        -0.166_666_666_666_666_66,
        0.008_333_333_333_333_316,
        -0.000_198_412_698_412_549_55,
        2.755_731_921_915_843e-6,
        -2.505_210_761_638_459_5e-8,
        1.605_897_727_281_550_6e-10,
        -7.643_969_031_052_769e-13,
        2.731_428_986_122_616e-15,
    ],
    cosine: [
        0.041_666_666_666_666_664,
        -0.001_388_888_888_888_888,
        2.480_158_730_157_984_4e-5,
        -2.755_731_922_156_715_4e-7,
        2.087_675_660_256_890_5e-9,
        -1.147_071_225_287_516_3e-11,
        4.777_877_290_768_691e-14,
        -1.521_855_926_409_455e-16,
    ],
};

const SINGLE: Constants = Constants {
    largest: 3e3,
    rounder: 12_582_912.0,
    parts: [3.140_625, 9.675_025_939_941_406e-4, 1.509_957_990_978_376_5e-7],
    sine: [
        -0.166_666_666_638_784_66,
        0.008_333_332_768_305_049,
        -0.000_198_410_864_525_061_94,
        2.753_645_532_390_914e-6,
        -2.407_999_973_210_464e-8,
        0.0,
        0.0,
        0.0,
    ],
    cosine: [
        0.041_666_666_664_667_756,
        -0.001_388_888_848_382_245_5,
        2.480_145_585_149_674e-5,
        -2.754_236_948_124_441e-7,
        2.018_074_052_986_643e-9,
        0.0,
        0.0,
        0.0,
    ],
};

/// Largest angle whose sine and cosine are taken by the series in double precision, rad; the library takes larger ones.
pub const LARGEST: f64 = DOUBLE.largest;

#[inline(always)]
fn constants<T: Real>() -> (&'static Constants, bool) {
    if T::default_epsilon() < lit(1e-12) { (&DOUBLE, true) } else { (&SINGLE, false) }
}

/// Largest angle, rad, whose sine and cosine are taken by the series in the precision of `T`.
#[inline(always)]
pub(crate) fn largest<T: Real>() -> f64 {
    constants::<T>().0.largest
}

/// Sine and cosine of the angle `x`, rad.
#[inline(always)]
pub fn sin_cos<T: Real>(x: T) -> (T, T) {
    if x.abs() <= lit(largest::<T>()) { series_of(x) } else { x.sin_cos() }
}

/// Sines and cosines of several angles, rad, side by side in a vector unit.
#[inline(always)]
pub fn sines_cosines<C: Cpu, T: Real, const N: usize>(angles: [T; N]) -> [SinCos<T>; N] {
    let mut within = true;
    for x in angles {
        within &= x.abs() <= lit(largest::<T>());
    }
    if within {
        let (sine, cosine) = series_of(Lanes::<T, C, N>::new(angles));
        return core::array::from_fn(|i| SinCos { sine: sine.0[i], cosine: cosine.0[i] });
    }
    angles.map(|x| {
        let (sine, cosine) = sin_cos(x);
        SinCos { sine, cosine }
    })
}

/// Sines and cosines of any number of angles, rad, eight at a time side by side.
#[inline(always)]
pub(crate) fn sines_cosines_of_many<C: Cpu, T: Real, const N: usize>(angles: &[T; N]) -> [SinCos<T>; N] {
    let mut found = [SinCos { sine: T::zero(), cosine: T::one() }; N];
    for (angles, found) in angles.chunks(8).zip(found.chunks_mut(8)) {
        let mut padded = [T::zero(); 8];
        for (place, angle) in padded.iter_mut().zip(angles) {
            *place = *angle;
        }
        for (place, both) in found.iter_mut().zip(sines_cosines::<C, T, 8>(padded)) {
            *place = both;
        }
    }
    found
}

/// Sines and cosines of `count` angles, rad, `angle(i)` each, eight at a time side by side with the widest instructions of the processor; `then(i, sine,
/// cosine)` takes them in order.
#[inline]
pub(crate) fn for_sines_cosines<T: Real>(
    count: usize,
    angle: impl Fn(usize) -> T,
    then: impl FnMut(usize, T, T),
) {
    struct Waves<A, F>(usize, A, F);

    impl<T: Real, A: Fn(usize) -> T, F: FnMut(usize, T, T)> Kernel
        for (Waves<A, F>, core::marker::PhantomData<T>)
    {
        type Output = ();

        #[inline(always)]
        fn run<C: Cpu>(self) {
            let Waves(count, angle, mut then) = self.0;
            for first in (0..count).step_by(8) {
                let last = count - 1;
                let found = sines_cosines::<C, T, 8>(core::array::from_fn(|l| angle((first + l).min(last))));
                for (i, both) in (first..count).zip(found) {
                    then(i, both.sine, both.cosine);
                }
            }
        }
    }

    Level::widest().run_wide((Waves(count, angle, then), core::marker::PhantomData));
}

/// Sine and cosine of the angle `x`, rad, by the series alone; valid up to [`largest`].
#[inline(always)]
pub(crate) fn series_of<V: Number>(x: V) -> (V, V) {
    let (constants, double) = constants::<V::Real>();
    let c = |x: f64| V::of(lit(x));
    let (one, rounder) = (c(1.0), c(constants.rounder));
    let k = x.fused(c(core::f64::consts::FRAC_1_PI), rounder) - rounder;
    let [high, middle, low] = constants.parts;
    let r = (-k).fused(c(high), x) - k.fused(c(middle), k * c(low));
    let z = r * r;
    let odd = k - (k.fused(c(0.5), rounder) - rounder) * c(2.0);
    let sign = one - odd * odd * c(2.0);
    let sine = (r * z).fused(series(z, &constants.sine, double), r);
    let cosine = (z * z).fused(series(z, &constants.cosine, double), (-z).fused(c(0.5), one));
    (sine * sign, cosine * sign)
}

/// Polynomial in `z` with the coefficients `c`, by pairs of terms that are computed independently; with all eight coefficients if `whole`, else with
/// the first five.
#[inline(always)]
fn series<V: Number>(z: V, c: &[f64; 8], whole: bool) -> V {
    let c = |i: usize| V::of(lit(c[i]));
    let pair = |i: usize| z.fused(c(i + 1), c(i));
    let z2 = z * z;
    let z4 = z2 * z2;
    let low = z2.fused(pair(2), pair(0));
    if whole { z4.fused(z2.fused(pair(6), pair(4)), low) } else { z4.fused(c(4), low) }
}

/// Sine and cosine of one angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SinCos<V> {
    /// Sine of the angle.
    pub sine: V,
    /// Cosine of the angle.
    pub cosine: V,
}

/// Largest angle of [`Rotation::near`], rad, with errors below 1e-16; half a step of 2.5 ms at 80 rad/s.
pub const NEAR: f64 = 0.1;

/// Largest angle of [`Rotation::slight`], rad, with errors below 7e-16.
pub const SLIGHT: f64 = 0.0125;

/// Coefficients of `(sin r - r)/r^3` (`_SINE`) and `(cos r - 1)/r^2` (`_COSINE`) in powers of `r^2`, for angles `r` up to [`NEAR`] and [`SLIGHT`].
const NEAR_SINE: [f64; 3] =
    [-0.166_666_666_666_580_56, 0.008_333_333_178_343_767, -0.000_198_371_366_661_129_7];
const NEAR_COSINE: [f64; 4] =
    [-0.5, 0.041_666_666_666_597_78, -0.001_388_888_854_446_936_4, 2.479_607_641_181_604_4e-5];
const SLIGHT_SINE: [f64; 2] = [-0.166_666_666_666_061_17, 0.008_333_302_331_408_075];
const SLIGHT_COSINE: [f64; 2] = [-0.499_999_999_995_761_45, 0.041_666_449_653_307_6];

/// Rotation by a small angle: sine of the angle, and cosine of the angle minus one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation<V> {
    sine: V,
    less: V,
}

impl<V: Number> Rotation<V> {
    /// Rotation by `d` rad, at most [`NEAR`].
    #[inline(always)]
    pub fn near(d: V) -> Self {
        let (z, [s0, s1, s2], [c0, c1, c2, c3]) = (d * d, NEAR_SINE, NEAR_COSINE);
        let pair = |a: f64, b: f64| z.fused(V::of(lit(b)), V::of(lit(a)));
        let z2 = z * z;
        let sine = z2.fused(V::of(lit(s2)), pair(s0, s1));
        let cosine = z2.fused(pair(c2, c3), pair(c0, c1));
        Self { sine: (d * z).fused(sine, d), less: z * cosine }
    }

    /// Rotation by `d` rad, at most [`SLIGHT`].
    #[inline(always)]
    pub fn slight(d: V) -> Self {
        let ([s0, s1], [c0, c1], z) = (SLIGHT_SINE, SLIGHT_COSINE, d * d);
        let pair = |a: f64, b: f64| z.fused(V::of(lit(b)), V::of(lit(a)));
        Self { sine: (d * z).fused(pair(s0, s1), d), less: z * pair(c0, c1) }
    }
}

impl<V: Number> SinCos<V> {
    /// Sine and cosine of an angle, rad.
    #[inline(always)]
    pub fn of(angle: V) -> Self {
        let (sine, cosine) = angle.sine_cosine();
        Self { sine, cosine }
    }

    /// Sine and cosine of the angle plus a rotation, by the addition theorems.
    #[inline(always)]
    pub fn by(&self, rotation: &Rotation<V>) -> Self {
        let Rotation { sine, less } = *rotation;
        Self {
            sine: self.sine.fused(less, self.cosine.fused(sine, self.sine)),
            cosine: self.cosine.fused(less, (-self.sine).fused(sine, self.cosine)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bound of the error of sine and cosine, in units of machine epsilon, due to rounding of the reduced angle, its square and the final sum.
    const ROUNDINGS: f64 = 1.5;

    #[test]
    fn both_precisions_agree_with_the_library() {
        let mut state = 1_u64;
        for i in 0..400_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let x = ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0) * [1.0, 10.0, 1e3, 1e5][i % 4];
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs().max((c - x.cos()).abs()) < ROUNDINGS * f64::EPSILON, "{x}");
            let y = (x % 3e3) as f32;
            let (s, c) = sin_cos(y);
            let (fine, low) = f64::from(y).sin_cos();
            let off = (f64::from(s) - fine).abs().max((f64::from(c) - low).abs());
            assert!(off < ROUNDINGS * f64::from(f32::EPSILON), "{y}: {off}");
        }
    }

    #[test]
    fn multiples_of_a_quarter_turn_and_zero() {
        for k in -9..=9 {
            let x = f64::from(k) * core::f64::consts::FRAC_PI_2;
            let (s, c) = sin_cos(x);
            assert!((s - x.sin()).abs().max((c - x.cos()).abs()) < ROUNDINGS * f64::EPSILON, "{k}");
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }

    #[test]
    fn turning_on_is_turning_there() {
        for i in 0..1000 {
            let (x, part) = (0.01 * f64::from(i) - 5.0, f64::from(i % 41 - 20) / 20.0);
            let ways = [(NEAR, Rotation::near as fn(f64) -> Rotation<f64>), (SLIGHT, Rotation::slight)];
            for (largest, rotation) in ways {
                let way = largest * part;
                let (there, exact) = (SinCos::of(x).by(&rotation(way)), SinCos::of(x + way));
                let off = (there.sine - exact.sine).abs().max((there.cosine - exact.cosine).abs());
                // The sum of the angles is rounded too.
                assert!(off < 1.5e-15, "{x} by {way}: {off:e}");
            }
        }
    }

    #[test]
    fn beyond_the_range_the_library_answers() {
        assert_eq!(sin_cos(1e9_f64), 1e9_f64.sin_cos());
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f32::INFINITY).1.is_nan());
    }
}
