//! Instant at which a velocity vanishes within a step, from velocities and accelerations at the ends of the step.

use crate::kinematics::JointState;
use crate::real::{Real, lit};

/// Newton correction of the instant of zero velocity, as a part of a step, below which the motion up to that instant is taken as linear in time: the
/// error is quadratic in the correction.
pub(super) const STRAIGHT: f64 = 1e-6;

/// Newton correction of the instant of zero velocity, as a part of a step, below which the motion up to that instant is taken as of constant jerk:
/// the error is cubic in the correction.
const CURVED: f64 = 1e-3;

/// Part of a step below which the jerk, from accelerations at both ends of the part, is not known well enough.
const SHORT: f64 = 0.01;

/// Newton step, as a part of a step, at which the search for a root of the cubic through both ends stops: the motion is not exactly that cubic.
const ROOT: f64 = 1e-3;

/// Joint state close to where joint `j`'s velocity vanishes, `length` seconds after the start of a step, with accelerations at the start and at this
/// state.
pub(crate) struct VelocityZero<'a, T, const N: usize> {
    pub(crate) joints: &'a JointState<T, N>,
    pub(crate) j: usize,
    pub(crate) length: T,
    pub(crate) ddq: [&'a [T; N]; 2],
}

impl<T: Real, const N: usize> VelocityZero<'_, T, N> {
    /// Time from the known state to zero velocity by one Newton step, s; negative if the velocity vanished before.
    #[inline]
    pub(crate) fn correction(&self) -> T {
        -self.joints.dq[self.j] / self.ddq[1][self.j]
    }

    /// Time to zero velocity, s, and the joint state at zero velocity, if it is so close, in a step of `whole` seconds, that no further integration
    /// is needed.
    #[inline]
    pub(crate) fn reached(&self, whole: T) -> Option<(T, JointState<T, N>)> {
        let correction = self.correction();
        let curved = correction.abs() < whole * lit(CURVED) && self.length > whole * lit(SHORT);
        let straight = correction.abs() < whole * lit(STRAIGHT);
        if !curved && !straight {
            return None;
        }
        let [first, ddq] = self.ddq;
        let mut rate = [T::zero(); N];
        if curved {
            for i in 0..N {
                rate[i] = (ddq[i] - first[i]) / self.length;
            }
        }
        let (j, half): (usize, T) = (self.j, lit(0.5));
        let d = -(self.joints.dq[j] + half * rate[j] * correction * correction) / ddq[j];
        let mut next = *self.joints;
        for i in 0..N {
            next.q[i] += (self.joints.dq[i] + (ddq[i] + rate[i] * (d / lit(3.0))) * (half * d)) * d;
            next.dq[i] += (ddq[i] + rate[i] * (half * d)) * d;
        }
        Some((d, next))
    }
}

/// First root in `(0, 1)` of the cubic with values `v0, v1` and slopes `d0, d1` at 0 and 1, where `v0 v1 <= 0` or the cubic leaves zero at 0; by
/// bisection and Newton's method.
#[inline]
pub(crate) fn hermite_root<T: Real>(v0: T, d0: T, v1: T, d1: T) -> T {
    let (two, three) = (lit::<T>(2.0), lit::<T>(3.0));
    let (c3, c2) = (two * (v0 - v1) + d0 + d1, three * (v1 - v0) - two * d0 - d1);
    let value = |s: T| v0 + s * (d0 + s * (c2 + s * c3));
    let slope = |s: T| d0 + s * (two * c2 + s * three * c3);
    let (mut low, mut high) = (T::zero(), T::one());
    let mut s = if v0 == T::zero() { lit(0.5) } else { v0 / (v0 - v1) };
    for _ in 0..40 {
        let f = value(s);
        if f * v1 > T::zero() {
            high = s;
        } else {
            low = s;
        }
        let newton = s - f / slope(s);
        if (newton - s).abs() < lit(ROOT) {
            return newton.max(low).min(high);
        }
        s = if newton > low && newton < high { newton } else { (low + high) / two };
    }
    s
}
