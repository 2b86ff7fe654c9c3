//! Operations on several numbers side by side, each by one vector instruction where the processor has it.
//!
//! A compiler takes the numbers of an array apart, and puts those that it computes alike together again; in code as long as the equation of motion
//! of seven joints it misses half of them, and moves the others number by number. An instruction that is named stays whole.

use super::Cpu;
use crate::real::Real;

#[cfg(all(feature = "std", target_arch = "x86_64"))]
use core::arch::x86_64::{
    __m256d, __m512d, _CMP_EQ_OQ, _mm256_add_pd, _mm256_andnot_pd, _mm256_blendv_pd, _mm256_cmp_pd,
    _mm256_div_pd, _mm256_fmadd_pd, _mm256_max_pd, _mm256_mul_pd, _mm256_set1_pd, _mm256_setzero_pd,
    _mm256_sub_pd, _mm256_xor_pd, _mm512_abs_pd, _mm512_add_pd, _mm512_castpd_si512, _mm512_castsi512_pd,
    _mm512_cmp_pd_mask, _mm512_div_pd, _mm512_fmadd_pd, _mm512_mask_blend_pd, _mm512_max_pd, _mm512_mul_pd,
    _mm512_set1_pd, _mm512_setzero_pd, _mm512_sub_pd, _mm512_xor_si512,
};

/// Operation on up to three numbers, alike in every lane; those with fewer leave out the last.
pub trait Operation {
    /// Result in one lane.
    fn one<C: Cpu, T: Real>(a: T, b: T, c: T) -> T;

    /// Results in four lanes of doubles.
    ///
    /// # Safety
    /// The processor has AVX2 and FMA.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    #[allow(unsafe_code)]
    unsafe fn four(a: __m256d, b: __m256d, c: __m256d) -> __m256d;

    /// Results in eight lanes of doubles.
    ///
    /// # Safety
    /// The processor has AVX-512F.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    #[allow(unsafe_code)]
    unsafe fn eight(a: __m512d, b: __m512d, c: __m512d) -> __m512d;
}

/// Declares operations: for one number, for four doubles and for eight.
macro_rules! operations {
    ($($(#[$doc:meta])* $name:ident, |$a:ident, $b:ident, $c:ident| $one:expr, $four:expr, $eight:expr;)*) => {
        $($(#[$doc])*
        #[derive(Debug, Clone, Copy)]
        pub struct $name;

        impl Operation for $name {
            #[inline(always)]
            fn one<C: Cpu, T: Real>($a: T, $b: T, $c: T) -> T {
                let _ = ($a, $b, $c);
                $one
            }

            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            #[inline(always)]
            #[allow(unsafe_code)]
            unsafe fn four($a: __m256d, $b: __m256d, $c: __m256d) -> __m256d {
                let _ = ($a, $b, $c);
                // SAFETY: the caller sees to it that the processor has the instructions; they work on values, not on memory.
                unsafe { $four }
            }

            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            #[inline(always)]
            #[allow(unsafe_code)]
            unsafe fn eight($a: __m512d, $b: __m512d, $c: __m512d) -> __m512d {
                let _ = ($a, $b, $c);
                // SAFETY: the caller sees to it that the processor has the instructions; they work on values, not on memory.
                unsafe { $eight }
            }
        })*
    };
}

operations! {
    /// `a + b`.
    Sum, |a, b, c| a + b, _mm256_add_pd(a, b), _mm512_add_pd(a, b);
    /// `a - b`.
    Difference, |a, b, c| a - b, _mm256_sub_pd(a, b), _mm512_sub_pd(a, b);
    /// `a b`.
    Product, |a, b, c| a * b, _mm256_mul_pd(a, b), _mm512_mul_pd(a, b);
    /// `a / b`.
    Quotient, |a, b, c| a / b, _mm256_div_pd(a, b), _mm512_div_pd(a, b);
    /// `a b + c`, as [`Cpu::fused`].
    Fused, |a, b, c| C::fused(a, b, c), _mm256_fmadd_pd(a, b, c), _mm512_fmadd_pd(a, b, c);
    /// `-a`.
    Negative, |a, b, c| -a, _mm256_xor_pd(a, _mm256_set1_pd(-0.0)), _mm512_castsi512_pd(
        _mm512_xor_si512(_mm512_castpd_si512(a), _mm512_castpd_si512(_mm512_set1_pd(-0.0))),
    );
    /// Absolute value of `a`.
    Size, |a, b, c| a.abs(), _mm256_andnot_pd(_mm256_set1_pd(-0.0), a), _mm512_abs_pd(a);
    /// The larger of `a` and `b`; `b` where `a` is NaN.
    Larger, |a, b, c| if a > b { a } else { b }, _mm256_max_pd(a, b), _mm512_max_pd(a, b);
    /// `b` where `a` is zero, `c` where it is not.
    WhereZero, |a, b, c| if a == T::zero() { b } else { c },
    _mm256_blendv_pd(c, b, _mm256_cmp_pd::<_CMP_EQ_OQ>(a, _mm256_setzero_pd())),
    _mm512_mask_blend_pd(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(a, _mm512_setzero_pd()), c, b);
}

/// The operation `O` on each of `W` numbers, one by one.
#[inline(always)]
pub fn one_by_one<C: Cpu, O: Operation, T: Real, const W: usize>(a: [T; W], b: [T; W], c: [T; W]) -> [T; W] {
    let mut x = a;
    for l in 0..W {
        x[l] = O::one::<C, T>(a[l], b[l], c[l]);
    }
    x
}

/// The operation `O` on each of `W` numbers: four or eight doubles by one instruction, all others one by one.
///
/// # Safety
/// The processor has AVX2 and FMA, and if `DOUBLES` is 8 also AVX-512F.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[inline(always)]
#[allow(unsafe_code)]
pub unsafe fn side_by_side<C: Cpu, O: Operation, T: Real, const W: usize, const DOUBLES: usize>(
    a: [T; W],
    b: [T; W],
    c: [T; W],
) -> [T; W] {
    use core::any::TypeId;
    use core::mem::transmute_copy;
    if (W == 4 || (W == 8 && DOUBLES == 8)) && TypeId::of::<T>() == TypeId::of::<f64>() {
        // SAFETY: `[T; W]` is `[f64; W]`, of the size of a vector, and every pattern of bits is a value of either; the caller answers for the
        // instructions.
        unsafe {
            return if W == 4 {
                let result = O::four(transmute_copy(&a), transmute_copy(&b), transmute_copy(&c));
                transmute_copy(&result)
            } else {
                let result = O::eight(transmute_copy(&a), transmute_copy(&b), transmute_copy(&c));
                transmute_copy(&result)
            };
        }
    }
    one_by_one::<C, O, T, W>(a, b, c)
}

#[cfg(test)]
mod tests {
    use super::{Difference, Fused, Larger, Negative, Operation, Product, Quotient, Size, Sum, WhereZero};
    use crate::cpu::{Cpu, Kernel, Level};

    const NUMBERS: [f64; 9] =
        [0.0, -0.0, 1.0, -1.0 / 3.0, 1e300, -7e-310, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];

    /// Kernel that counts the lanes in which an operation on `W` numbers and on one number differ in any bit.
    struct Differences<const W: usize>;

    impl<const W: usize> Differences<W> {
        #[inline(always)]
        fn count<C: Cpu, O: Operation>() -> usize {
            let mut count = 0;
            for i in 0..NUMBERS.len().pow(3) {
                let of = |factor: usize| {
                    std::array::from_fn::<f64, W, _>(|l| NUMBERS[(i / factor + l) % NUMBERS.len()])
                };
                let (a, b, c) = (of(1), of(9), of(81));
                let all = C::each::<O, f64, W>(a, b, c);
                for l in 0..W {
                    let one = O::one::<C, f64>(a[l], b[l], c[l]);
                    count +=
                        usize::from(all[l].to_bits() != one.to_bits() && !(all[l].is_nan() && one.is_nan()));
                }
            }
            count
        }
    }

    impl<const W: usize> Kernel for Differences<W> {
        type Output = [usize; 9];

        #[inline(always)]
        fn run<C: Cpu>(self) -> [usize; 9] {
            [
                Self::count::<C, Sum>(),
                Self::count::<C, Difference>(),
                Self::count::<C, Product>(),
                Self::count::<C, Quotient>(),
                Self::count::<C, Fused>(),
                Self::count::<C, Negative>(),
                Self::count::<C, Size>(),
                Self::count::<C, Larger>(),
                Self::count::<C, WhereZero>(),
            ]
        }
    }

    #[test]
    fn operations_side_by_side_are_those_on_one_number() {
        for level in [Level::PORTABLE, Level::detect(), Level::widest()] {
            assert_eq!(level.run_wide(Differences::<3>), [0; 9], "{level:?}");
            assert_eq!(level.run_wide(Differences::<4>), [0; 9], "{level:?}");
            assert_eq!(level.run_wide(Differences::<8>), [0; 9], "{level:?}");
        }
    }
}
