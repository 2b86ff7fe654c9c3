//! Choice of the processor's instructions that the online estimator uses, made when the estimator is made.
//!
//! One Python wheel and one library run on every x86-64 processor, while four doubles at once and `a b + c` with one rounding reduce the computing
//! time of a sample by a third. So the hot code is written once, generic over a [`Cpu`], and compiled on x86-64 for every processor, for processors
//! with AVX2 and FMA, and for [`Level::run_wide`], which rollouts and estimators of many parameters use, also for AVX-512. A [`Level`] says which
//! version runs, and one call without a branch in between enters the code.
//!
//! `a b + c` goes through [`Cpu::fused`], because a compiler does not fuse product and sum on its own, and because the standard library's `mul_add`
//! is a function call where the instruction is missing. Everything below [`Kernel::run`] has to be inlined: a function that stays outside is compiled
//! for every processor.
//!
//! Lanes of doubles ([`crate::lanes`]) are worked on by named vector instructions (`cpu/vector.rs`): [`Cpu::each`].
//!
//! Without the feature `std` only the instructions of the builder's `target-cpu` are used, and there is no unsafe code.

pub(crate) mod vector;

use crate::real::Real;
use vector::Operation;

/// Kind of processor that code is compiled for, as a type parameter: vector width and fused multiply-add.
pub trait Cpu: Copy {
    /// Number of doubles that a vector instruction of the processor takes together.
    const DOUBLES: usize;

    /// `a b + c`, rounded once where the processor has one instruction for it.
    fn fused<T: Real>(a: T, b: T, c: T) -> T;

    /// The operation `O` on each of `W` numbers, by vector instructions where the processor has them for `W` numbers of type `T`.
    #[doc(hidden)]
    #[inline(always)]
    fn each<O: Operation, T: Real, const W: usize>(a: [T; W], b: [T; W], c: [T; W]) -> [T; W] {
        vector::one_by_one::<Self, O, T, W>(a, b, c)
    }
}

/// Processor that offers no more than the instructions of the compilation target.
#[derive(Debug, Clone, Copy)]
pub struct Portable;

impl Cpu for Portable {
    const DOUBLES: usize = 2;

    #[inline(always)]
    fn fused<T: Real>(a: T, b: T, c: T) -> T {
        if cfg!(all(feature = "std", target_feature = "fma")) { a.mul_add(b, c) } else { a * b + c }
    }
}

/// Processor with fused multiply-add and vectors of `DOUBLES` doubles.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[derive(Debug, Clone, Copy)]
struct Fused<const DOUBLES: usize>;

#[cfg(all(feature = "std", target_arch = "x86_64"))]
impl<const DOUBLES: usize> Cpu for Fused<DOUBLES> {
    const DOUBLES: usize = DOUBLES;

    #[inline(always)]
    fn fused<T: Real>(a: T, b: T, c: T) -> T {
        a.mul_add(b, c)
    }

    #[inline(always)]
    #[allow(unsafe_code)]
    fn each<O: Operation, T: Real, const W: usize>(a: [T; W], b: [T; W], c: [T; W]) -> [T; W] {
        // SAFETY: code for this processor runs inside of `avx2` or `avx512` alone, which are entered where the processor has these instructions;
        // eight doubles only in the latter.
        unsafe { vector::side_by_side::<Self, O, T, W, DOUBLES>(a, b, c) }
    }
}

/// Computation that is compiled once for each instruction set.
pub trait Kernel {
    /// Type of the result of the computation.
    type Output;

    /// Runs the computation with the instructions of the processor `C`; the implementation, and all it calls that has to be fast, must be
    /// `#[inline(always)]`.
    fn run<C: Cpu>(self) -> Self::Output;
}

/// Instruction set that kernels are run with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Level(InstructionSet);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum InstructionSet {
    Portable,
    /// AVX2 and FMA; made by [`Level::detect`] alone, where the processor has both.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    Avx2,
    /// AVX-512 in addition to AVX2 and FMA; made by [`Level::widest`] alone, where the processor has all of them.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    Avx512,
}

impl Level {
    /// Instruction set that the code was compiled for.
    pub const PORTABLE: Self = Self(InstructionSet::Portable);

    /// Level of AVX2 and FMA where the processor has AVX2, FMA and ADX, else, or without the standard library, [`Level::PORTABLE`].
    #[inline]
    pub fn detect() -> Self {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("fma")
            // Processors with AVX2 have ADX too, except the first generation and the one that valgrind emulates, which does not know every form of
            // the AVX instructions.
            && std::arch::is_x86_feature_detected!("adx")
        {
            return Self(InstructionSet::Avx2);
        }
        Self::PORTABLE
    }

    /// Level of AVX-512 (F, DQ and VL), eight doubles at once, where the processor has it, else [`Level::detect`]; for kernels run by
    /// [`Level::run_wide`].
    #[inline]
    pub fn widest() -> Self {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if Self::detect() != Self::PORTABLE
            && std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("avx512vl")
        {
            return Self(InstructionSet::Avx512);
        }
        Self::detect()
    }

    /// Name of the instruction set in tables.
    pub const fn name(self) -> &'static str {
        match self.0 {
            InstructionSet::Portable => "portable",
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            InstructionSet::Avx2 => "AVX2 and FMA",
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            InstructionSet::Avx512 => "AVX-512",
        }
    }

    /// Runs a kernel with the instructions of this level, AVX2 at most.
    #[inline(always)]
    pub fn run<W: Kernel>(self, kernel: W) -> W::Output {
        match self.0 {
            InstructionSet::Portable => portable(kernel),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            InstructionSet::Avx2 | InstructionSet::Avx512 => on_avx2(kernel),
        }
    }

    /// Runs a kernel that works on eight doubles side by side, with AVX-512 where this level has it.
    #[inline(always)]
    pub fn run_wide<W: Kernel>(self, kernel: W) -> W::Output {
        match self.0 {
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            InstructionSet::Avx512 => on_avx512(kernel),
            _ => self.run(kernel),
        }
    }
}

/// Runs a kernel compiled for every processor; not inlined, so that there is one copy of the kernel.
#[inline(never)]
fn portable<W: Kernel>(kernel: W) -> W::Output {
    kernel.run::<Portable>()
}

/// Runs a kernel compiled for AVX2 and FMA.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[inline(always)]
#[allow(unsafe_code)]
fn on_avx2<W: Kernel>(kernel: W) -> W::Output {
    // SAFETY: called for `InstructionSet::Avx2` and `InstructionSet::Avx512` only. `Level::detect` makes the first after asking the processor
    // for AVX2 and FMA, `Level::widest` the second only where `Level::detect` has found both. The function itself is safe code; what could
    // go wrong is a processor without these instructions, and nothing else.
    unsafe { avx2(kernel) }
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[target_feature(enable = "avx2,fma")]
fn avx2<W: Kernel>(kernel: W) -> W::Output {
    kernel.run::<Fused<4>>()
}

/// Runs a kernel compiled for AVX-512.
#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[inline(always)]
#[allow(unsafe_code)]
fn on_avx512<W: Kernel>(kernel: W) -> W::Output {
    // SAFETY: called for `InstructionSet::Avx512` only, which only `Level::widest` makes, after asking the processor for all of them.
    unsafe { avx512(kernel) }
}

#[cfg(all(feature = "std", target_arch = "x86_64"))]
#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
fn avx512<W: Kernel>(kernel: W) -> W::Output {
    kernel.run::<Fused<8>>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kernel that returns the rounding error of the square of its number.
    struct Rounding(f64);

    impl Kernel for Rounding {
        type Output = f64;

        #[inline(always)]
        fn run<C: Cpu>(self) -> f64 {
            C::fused(self.0, self.0, -(self.0 * self.0))
        }
    }

    #[test]
    fn portable_code_rounds_twice_and_the_processors_own_once() {
        let x = 1.0 / 3.0;
        let once = f64::mul_add(x, x, -(x * x));
        assert!(once != 0.0);
        let compiled = if cfg!(target_feature = "fma") { once } else { 0.0 };
        assert_eq!(Level::PORTABLE.run(Rounding(x)), compiled);
        let best = if Level::detect() == Level::PORTABLE { compiled } else { once };
        assert_eq!(Level::detect().run(Rounding(x)), best);
    }
}
