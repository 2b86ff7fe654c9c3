//! Hyperbolic tangent of one number or several side by side, by arithmetic alone.
//!
//! The argument is divided by 32 and brought back by five doublings, `tanh 2y = 2 tanh y / (1 + tanh^2 y)`; for the small argument Lambert's
//! continued fraction is cut off after `y^2/17`, which is off by 1e-20 of the value. Rounding adds a few units in the last place.

use crate::number::Number;
use crate::real::lit;

/// Argument beyond which the hyperbolic tangent is 1 in double precision.
pub(crate) const TANH_SATURATION: f64 = 20.0;

/// Number of doublings of the argument, which is first divided by `2^DOUBLINGS`.
const DOUBLINGS: i32 = 5;

/// Coefficients of the numerator, divided by `y`, of Lambert's continued fraction for `tanh y`, in powers of `y^2`.
const NUMERATOR: [f64; 5] = [34_459_425.0, 4_729_725.0, 135_135.0, 990.0, 1.0];

/// Coefficients of the denominator of Lambert's continued fraction for `tanh y`, in powers of `y^2`.
const DENOMINATOR: [f64; 5] = [34_459_425.0, 16_216_200.0, 945_945.0, 13_860.0, 45.0];

/// Hyperbolic tangent of `x`.
#[inline(always)]
pub fn tanh<V: Number>(x: V) -> V {
    let c = |x: f64| V::of(lit(x));
    let within = -((-x).larger(c(-TANH_SATURATION)));
    let y = within.larger(c(-TANH_SATURATION)) * c(1.0 / f64::from(1 << DOUBLINGS));
    let square = y * y;
    let polynomial = |of: &[f64; 5]| {
        let mut sum = c(of[4]);
        for i in (0..4).rev() {
            sum = sum.fused(square, c(of[i]));
        }
        sum
    };
    let mut value = y * polynomial(&NUMERATOR) / polynomial(&DENOMINATOR);
    for _ in 0..DOUBLINGS {
        value = (value + value) / value.fused(value, c(1.0));
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_that_of_the_library() {
        for i in -40_000..=40_000 {
            let x = f64::from(i) * 1e-3 + 1e-7;
            let (own, theirs) = (tanh(x), x.tanh());
            assert!((own - theirs).abs() <= 2e-15 * theirs.abs(), "{x}: {own} {theirs}");
        }
        assert!(tanh(0.0_f64) == 0.0 && tanh(1e300_f64) == 1.0 && tanh(f64::NEG_INFINITY) == -1.0);
        assert!((tanh(0.3_f32) - 0.3_f32.tanh()).abs() < 1e-6);
    }
}
