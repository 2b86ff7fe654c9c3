//! Filters of friction over an interval in which joints may reverse.
//!
//! A sampled `sgn(dq)` says only that the sign changed somewhere between two samples. Taken as a ramp it is wrong by up to half a period
//! at every reversal, and a regressor with this error draws its coefficient towards zero. With the velocity linear between states
//! the reversal is at a share `c` of the interval, and all filter outputs have a closed form. With `x = lambda h`, `a = exp(-x)`,
//! `E = exp(-x (1 - c))` (1 without a reversal), `s` the sign at the start and `Delta` the change of velocity:
//!
//! ```text
//! F[sgn dq]  <-  a y + G,                                 G = s (2 E - 1 - a)
//! F[|dq|]    <-  a y + |dq_to| - a |dq_from| - G Delta/x
//! F[dq^2]    <-  a y + the parabola's filter, middle Delta^2/4 below the chord
//! ```
//!
//! Friction is `f_j = b_j dq_j + fc_j sgn dq_j`, as for every arm ([`crate::arm`]), plus one constant torque per joint where
//! Coulomb asymmetry is estimated.

use crate::cpu::Cpu;
use crate::filter::FilterCoefficients;
use crate::real::{Real, lit, sgn};
use nalgebra::SVector;

/// Velocity of a joint that is linear in time between two states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VelocitySegment<T> {
    from: T,
    to: T,
    /// Sign of the velocity at the start of the segment.
    sign: T,
    /// Whether the velocity changes its sign within the segment.
    reverses: bool,
}

impl<T: Real> VelocitySegment<T> {
    /// Segment from the velocity `from` to the velocity `to`, rad/s or m/s, linear in time.
    #[inline(always)]
    pub(super) fn new(from: T, to: T) -> Self {
        let reverses = (from > T::zero() && to < T::zero()) || (from < T::zero() && to > T::zero());
        let sign = if reverses { sgn(from) } else { sgn(from + to) };
        Self { from, to, sign, reverses }
    }

    /// Term that the sign of the velocity adds to the output of the low-pass filter `F` over the segment: the output for zero initial output.
    #[inline(always)]
    pub(super) fn sign(&self, step: &FilterCoefficients<T>) -> T {
        let mut end = T::one();
        if self.reverses {
            end = after_reversal(step.x, self.from, self.to);
        }
        self.sign * (end + end - T::one() - step.decay)
    }

    /// Output of the low-pass filter `F` for the absolute velocity at the end of the segment, from the output `y` at its start.
    #[inline(always)]
    pub(super) fn speed<C: Cpu>(&self, step: &FilterCoefficients<T>, y: T) -> T {
        if !self.reverses {
            return step.ramp::<C>(y, self.from.abs(), self.to.abs());
        }
        let slope = (self.to - self.from) / step.x;
        step.decay * (y - self.from.abs()) + self.to.abs() - slope * self.sign(step)
    }

    /// Output of the low-pass filter `F` for the squared velocity at the end of the segment, from the output `y` at its start.
    #[inline(always)]
    pub(super) fn square<C: Cpu>(&self, step: &FilterCoefficients<T>, y: T) -> T {
        let change = self.to - self.from;
        step.curve::<C>(y, self.from * self.from, self.to * self.to, change * change * lit(-0.25))
    }

    /// Integral of the absolute velocity over a segment of unit length in time.
    #[inline(always)]
    pub(super) fn distance(&self) -> T {
        let (from, to) = (self.from.abs(), self.to.abs());
        let total = from + to;
        let mean = if self.reverses { (from * from + to * to) / total } else { total };
        mean * lit(0.5)
    }

    /// Integral of the squared velocity over a segment of unit length in time.
    #[inline(always)]
    pub(super) fn distance_squared(&self) -> T {
        (self.from * (self.from + self.to) + self.to * self.to) * lit(1.0 / 3.0)
    }
}

/// Decay of a filter over the part of a segment after the reversal, `E = exp(-x (1 - c))`; `x = lambda h`.
#[inline(never)]
fn after_reversal<T: Real>(x: T, from: T, to: T) -> T {
    (-x * (to / (to - from))).exp()
}

/// Filter outputs or integrals of viscous, Coulomb and constant friction, one entry per joint for each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction<T, const N: usize> {
    pub(super) viscous: SVector<T, N>,
    pub(super) coulomb: SVector<T, N>,
    pub(super) constant: SVector<T, N>,
}

impl<T: Real, const N: usize> Friction<T, N> {
    /// Zero filter outputs and integrals.
    #[inline(always)]
    pub(super) fn zero() -> Self {
        Self { viscous: SVector::zeros(), coulomb: SVector::zeros(), constant: SVector::zeros() }
    }

    /// Advances the filters of friction torques by a step with velocities `dq` held, as Reyes and Kelly (1997) do.
    #[inline(always)]
    pub(super) fn hold_torques<C: Cpu>(&mut self, step: &FilterCoefficients<T>, dq: &SVector<T, N>) {
        for j in 0..N {
            self.viscous[j] = step.held::<C>(self.viscous[j], dq[j]);
            self.coulomb[j] = step.held::<C>(self.coulomb[j], sgn(dq[j]));
            self.constant[j] = step.held::<C>(self.constant[j], T::one());
        }
    }

    /// Advances the filters of friction torques by a step with velocities linear in time.
    #[inline(always)]
    pub(super) fn filter_torques<C: Cpu>(
        &mut self,
        step: &FilterCoefficients<T>,
        from: &SVector<T, N>,
        to: &SVector<T, N>,
    ) {
        for j in 0..N {
            let segment = VelocitySegment::new(from[j], to[j]);
            self.viscous[j] = step.ramp::<C>(self.viscous[j], from[j], to[j]);
            self.coulomb[j] = step.decay * self.coulomb[j] + segment.sign(step);
            self.constant[j] = step.held::<C>(self.constant[j], T::one());
        }
    }

    /// Advances the filters of dissipated powers by a step with velocities `dq` held, as Reyes and Kelly (1997) do.
    #[inline(always)]
    pub(super) fn hold_powers<C: Cpu>(&mut self, step: &FilterCoefficients<T>, dq: &SVector<T, N>) {
        for j in 0..N {
            self.viscous[j] = step.held::<C>(self.viscous[j], dq[j] * dq[j]);
            self.coulomb[j] = step.held::<C>(self.coulomb[j], dq[j].abs());
            self.constant[j] = step.held::<C>(self.constant[j], dq[j]);
        }
    }

    /// Advances the filters of dissipated powers by a step with velocities linear in time.
    #[inline(always)]
    pub(super) fn filter_powers<C: Cpu>(
        &mut self,
        step: &FilterCoefficients<T>,
        from: &SVector<T, N>,
        to: &SVector<T, N>,
    ) {
        for j in 0..N {
            let segment = VelocitySegment::new(from[j], to[j]);
            self.viscous[j] = segment.square::<C>(step, self.viscous[j]);
            self.coulomb[j] = segment.speed::<C>(step, self.coulomb[j]);
            self.constant[j] = step.ramp::<C>(self.constant[j], from[j], to[j]);
        }
    }

    /// Adds the dissipated energies of `h` seconds, J, by the trapezoidal rule, as Reyes and Kelly (1997) do.
    #[inline(always)]
    pub(super) fn add_trapezes(&mut self, h: T, from: &SVector<T, N>, to: &SVector<T, N>) {
        let half = h * lit(0.5);
        for j in 0..N {
            self.viscous[j] += (from[j] * from[j] + to[j] * to[j]) * half;
            self.coulomb[j] += (from[j].abs() + to[j].abs()) * half;
            self.constant[j] += (from[j] + to[j]) * half;
        }
    }

    /// Adds the dissipated energies of `h` seconds, J, exactly for velocities linear in time.
    #[inline(always)]
    pub(super) fn add_energies(&mut self, h: T, from: &SVector<T, N>, to: &SVector<T, N>) {
        for j in 0..N {
            let segment = VelocitySegment::new(from[j], to[j]);
            self.viscous[j] += h * segment.distance_squared();
            self.coulomb[j] += h * segment.distance();
            self.constant[j] += h * lit(0.5) * (from[j] + to[j]);
        }
    }

    /// Calls `put(kind, joint, value)` for viscous (0), Coulomb (1) and constant (2) friction of the joint `only`, or of all joints.
    #[inline(always)]
    pub(super) fn write(&self, only: Option<usize>, mut put: impl FnMut(usize, usize, T)) {
        for j in 0..N {
            if only.is_none_or(|joint| joint == j) {
                put(0, j, self.viscous[j]);
                put(1, j, self.coulomb[j]);
                put(2, j, self.constant[j]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::Portable;
    use crate::filter::Cutoff;

    const STEP: f64 = 0.0025;
    const PIECES: u32 = 200_000;

    /// Output of the low-pass filter `F` for a function `of` the velocity, from very small steps.
    fn numeric(lambda: f64, y: f64, (from, to): (f64, f64), of: impl Fn(f64) -> f64) -> f64 {
        let step = Cutoff { rad_per_s: lambda }.step(STEP / f64::from(PIECES));
        (0..PIECES).fold(y, |y, k| {
            let share = (f64::from(k) + 0.5) / f64::from(PIECES);
            step.held::<Portable>(y, of(from + (to - from) * share))
        })
    }

    #[test]
    fn closed_forms_are_the_filters_of_the_swing() {
        for lambda in [5.0, 50.0, 900.0] {
            let step = Cutoff { rad_per_s: lambda }.step(STEP);
            for (from, to) in [(0.3, 1.1), (-1.0, 3.0), (1.0, -0.01), (0.0, 0.4), (-0.4, 0.0), (0.0, 0.0)] {
                let (segment, y) = (VelocitySegment::new(from, to), 0.7);
                let close = |a: f64, of: fn(f64) -> f64| {
                    let b = numeric(lambda, y, (from, to), of);
                    assert!((a - b).abs() < 2e-5, "{lambda} rad/s, {from} to {to}: {a} and {b}");
                };
                close(step.decay * y + segment.sign(&step), sgn);
                close(segment.speed::<Portable>(&step, y), f64::abs);
                close(segment.square::<Portable>(&step, y), |v| v * v);
            }
        }
    }

    #[test]
    fn distances_are_integrals() {
        for (from, to) in [(0.3_f64, 1.1), (-1.0, 3.0), (1.0, -0.01), (0.0, 0.4)] {
            let at = |k: u32| from + (to - from) * (f64::from(k) + 0.5) / f64::from(PIECES);
            let mean = |of: fn(f64) -> f64| (0..PIECES).map(|k| of(at(k))).sum::<f64>() / f64::from(PIECES);
            let segment = VelocitySegment::new(from, to);
            assert!((segment.distance() - mean(f64::abs)).abs() < 1e-9);
            assert!((segment.distance_squared() - mean(|v| v * v)).abs() < 1e-9);
        }
    }

    #[test]
    fn a_start_from_rest_already_has_its_sign() {
        assert_eq!(VelocitySegment::new(0.0, 0.1).sign, 1.0);
        assert_eq!(VelocitySegment::new(-0.1, 0.0).sign, -1.0);
        assert_eq!(VelocitySegment::new(0.0, 0.0).sign, 0.0);
    }
}
