//! The arm as a simulator sees it: rigid dynamics, friction and effects, given the state of each joint's friction.
//!
//! Dry friction is a set of modes: a joint slides in one direction, with its Coulomb torque constant in sign, or it sticks, with
//! its velocity exactly zero and whatever friction torque that takes. [`Plant::acceleration`] is smooth while no mode changes;
//! [`crate::integrate`] decides when one does.

use crate::arm::Arm;
use crate::effect::{Active, JointPoint};
use crate::linear::solve_positive_definite;
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// Most effects one plant can carry.
pub const MAX_EFFECTS: usize = 8;

/// What a joint's dry friction does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// At rest, held by friction.
    Stuck,
    /// Sliding towards larger `q`.
    Forward,
    /// Sliding towards smaller `q`.
    Backward,
}

impl Mode {
    /// Direction as a number: -1, 0 or 1.
    #[inline]
    pub fn direction<T: Real>(self) -> T {
        match self {
            Self::Stuck => T::zero(),
            Self::Forward => T::one(),
            Self::Backward => -T::one(),
        }
    }

    /// The mode of a joint that slides with this sign.
    #[inline]
    pub fn of<T: Real>(direction: T) -> Self {
        if direction > T::zero() {
            Self::Forward
        } else if direction < T::zero() {
            Self::Backward
        } else {
            Self::Stuck
        }
    }
}

/// Acceleration, and the friction torque that each stuck joint needs to stay at rest.
#[derive(Debug, Clone, Copy)]
pub struct Motion<T, const N: usize> {
    /// `ddq`; exactly zero for stuck joints.
    pub ddq: SVector<T, N>,
    /// Friction torque of stuck joints; zero for sliding ones.
    pub holding: SVector<T, N>,
}

/// An arm with parameter values, effects and a friction model.
#[derive(Clone)]
pub struct Plant<T: Real, A, const N: usize, const P: usize> {
    arm: A,
    theta: [T; P],
    viscous: SVector<T, N>,
    coulomb: SVector<T, N>,
    armature: SVector<T, N>,
    tilt: T,
    smoothing: T,
    effects: [Option<Active<T>>; MAX_EFFECTS],
    forces: bool,
    levels: bool,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Plant<T, A, N, P> {
    /// The arm without effects and with exact Coulomb friction.
    pub fn new(arm: A, theta: [T; P]) -> Self {
        let (viscous, coulomb) = (arm.viscous(&theta), arm.coulomb(&theta));
        Self {
            arm,
            theta,
            viscous,
            coulomb,
            armature: SVector::zeros(),
            tilt: T::zero(),
            smoothing: T::zero(),
            effects: [None; MAX_EFFECTS],
            forces: false,
            levels: false,
        }
    }

    /// Replaces `sgn(dq)` by `tanh(dq / width)`; a width of zero keeps exact dry friction.
    pub fn with_smoothing(mut self, width: T) -> Self {
        self.smoothing = if width > T::zero() { width } else { T::zero() };
        self
    }

    /// Adds an effect; beyond [`MAX_EFFECTS`], or on a joint the arm does not have, `None`.
    pub fn with_effect(mut self, effect: Active<T>) -> Option<Self> {
        let slot = self.effects.iter_mut().find(|slot| slot.is_none())?;
        *slot = Some(effect);
        let hooks = effect.law.spec().hooks;
        self.forces |= hooks.force;
        self.levels |= hooks.coulomb;
        *self.armature.get_mut(effect.joint)? += effect.law.inertia(&effect.p);
        self.tilt += effect.law.tilt(&effect.p);
        if let Some((mass, distance)) = effect.law.payload(&effect.p) {
            let delta = self.arm.payload(&self.theta, mass, distance);
            for (value, change) in self.theta.iter_mut().zip(delta) {
                *value += change;
            }
        }
        Some(self)
    }

    /// Parameter values, payloads included.
    pub fn theta(&self) -> &[T; P] {
        &self.theta
    }

    /// Width of the smoothed sign, zero for exact dry friction.
    pub fn smoothing(&self) -> T {
        self.smoothing
    }

    /// A plant none of whose numbers is infinite or undefined.
    pub fn is_finite(&self) -> bool {
        self.theta.iter().all(nalgebra::ComplexField::is_finite)
    }

    /// Joint `j` at an instant.
    #[inline]
    fn point(&self, j: usize, t: T, q: T, dq: T, tau: T, load: T) -> JointPoint<T> {
        let friction = self.viscous[j] * dq.abs() + self.coulomb[j];
        JointPoint { t, q, dq, tau, load, friction }
    }

    /// Coulomb level of joint `j` in a direction, never negative.
    #[inline]
    fn level(&self, j: usize, x: &JointPoint<T>, direction: T) -> T {
        let mut level = self.coulomb[j];
        if self.levels {
            for effect in self.effects.iter().flatten() {
                if effect.joint == j && effect.law.spec().hooks.coulomb {
                    level += effect.law.coulomb(&effect.p, x, direction);
                }
            }
        }
        level.max(T::zero())
    }

    /// Torque of the force effects on joint `j`.
    #[inline]
    fn force(&self, j: usize, x: &JointPoint<T>) -> T {
        let mut sum = T::zero();
        if self.forces {
            for effect in self.effects.iter().flatten() {
                if effect.joint == j && effect.law.spec().hooks.force {
                    sum += effect.law.force(&effect.p, x);
                }
            }
        }
        sum
    }

    /// Dry friction torque of a joint that is not stuck.
    #[inline]
    fn dry_friction(&self, j: usize, x: &JointPoint<T>, mode: Mode) -> T {
        if self.smoothing > T::zero() {
            let soft = (x.dq / self.smoothing).tanh();
            return self.level(j, x, if soft < T::zero() { -T::one() } else { T::one() }) * soft;
        }
        match mode {
            Mode::Stuck => T::zero(),
            slides => self.level(j, x, slides.direction()) * slides.direction(),
        }
    }

    /// Equation (1) solved for `ddq`, with stuck joints held at rest.
    #[inline]
    pub fn acceleration(
        &self,
        t: T,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
        tau: &SVector<T, N>,
        modes: &[Mode; N],
    ) -> Motion<T, N> {
        let (mut inertia, bias) = self.arm.dynamics(&self.theta, q, dq, self.tilt);
        let mut rhs = SVector::<T, N>::zeros();
        for j in 0..N {
            let x = self.point(j, t, q[j], dq[j], tau[j], bias[j]);
            inertia[(j, j)] += self.armature[j];
            rhs[j] = tau[j] - bias[j] - self.viscous[j] * dq[j] - self.dry_friction(j, &x, modes[j])
                + self.force(j, &x);
        }
        self.solve(&inertia, &rhs, modes)
    }

    /// `M ddq = rhs` with the rows and columns of stuck joints taken out.
    #[inline]
    fn solve(&self, inertia: &SMatrix<T, N, N>, rhs: &SVector<T, N>, modes: &[Mode; N]) -> Motion<T, N> {
        let stuck = self.stuck(modes);
        let (mut reduced, mut b) = (*inertia, *rhs);
        for j in 0..N {
            if stuck[j] {
                for k in 0..N {
                    reduced[(j, k)] = T::zero();
                    reduced[(k, j)] = T::zero();
                }
                reduced[(j, j)] = T::one();
                b[j] = T::zero();
            }
        }
        let ddq = solve_positive_definite(reduced, b);
        let mut holding = SVector::zeros();
        for j in 0..N {
            if stuck[j] {
                holding[j] = rhs[j];
                for k in 0..N {
                    holding[j] -= inertia[(j, k)] * ddq[k];
                }
            }
        }
        Motion { ddq, holding }
    }

    /// Which joints are held; none with smoothed friction.
    #[inline]
    fn stuck(&self, modes: &[Mode; N]) -> [bool; N] {
        let exact = self.smoothing == T::zero();
        core::array::from_fn(|j| exact && modes[j] == Mode::Stuck)
    }

    /// By how much the holding torque of joint `j` exceeds what friction can give, and the direction it would slide in.
    /// Not positive: it stays.
    #[inline]
    pub fn excess(&self, j: usize, t: T, q: &SVector<T, N>, tau: &SVector<T, N>, holding: T) -> (T, T) {
        let direction = if holding < T::zero() { -T::one() } else { T::one() };
        // At rest the load of a joint is what has to be held.
        let x = self.point(j, t, q[j], T::zero(), tau[j], holding - tau[j]);
        (holding.abs() - self.level(j, &x, direction), direction)
    }

    /// Fastest rate at which smoothed friction pulls a velocity to zero, 1/s; zero for exact friction.
    pub fn friction_rate(&self, q: &SVector<T, N>) -> T {
        if self.smoothing == T::zero() {
            return T::zero();
        }
        let (inertia, _) = self.arm.dynamics(&self.theta, q, &SVector::zeros(), self.tilt);
        let mut fastest = T::zero();
        for j in 0..N {
            let x = self.point(j, T::zero(), q[j], T::zero(), T::zero(), T::zero());
            let mut least = inertia[(j, j)] + self.armature[j];
            for k in 0..N {
                if k != j {
                    let coupling = inertia[(j, k)];
                    least -= coupling * coupling / (inertia[(k, k)] + self.armature[k]);
                }
            }
            let rate = self.level(j, &x, T::one()) / (self.smoothing * least.max(lit(1e-9)));
            fastest = fastest.max(rate);
        }
        fastest
    }
}
