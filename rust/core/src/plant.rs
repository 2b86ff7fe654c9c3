//! The arm as a simulator sees it: rigid dynamics, friction and effects, given the state of each joint's friction.
//!
//! Dry friction is a set of modes: a joint slides in one direction, with its Coulomb torque constant in sign, or it sticks, with
//! its velocity exactly zero and whatever friction torque that takes. [`Plant::acceleration`] is smooth while no mode changes;
//! [`crate::integrate`] decides when one does.

use crate::arm::Arm;
use crate::effect::{Active, JointPoint};
use crate::linear::solve_positive_definite;
use crate::real::{Real, lit};
use crate::transmission::{Drive, Hidden};
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
    /// Acceleration of the twist of driven joints; zero for rigid ones.
    pub ddtwist: SVector<T, N>,
}

/// An arm with parameter values, effects and a friction model.
#[derive(Clone)]
pub struct Plant<T: Real, A, const N: usize, const P: usize> {
    arm: A,
    theta: [T; P],
    viscous: SVector<T, N>,
    coulomb: SVector<T, N>,
    added: SMatrix<T, N, N>,
    drives: [Option<Drive<T>>; N],
    tilt: T,
    smoothing: T,
    effects: [Option<Active<T>>; MAX_EFFECTS],
    forces: bool,
    levels: bool,
    remembers: bool,
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
            added: SMatrix::zeros(),
            drives: [None; N],
            tilt: T::zero(),
            smoothing: T::zero(),
            effects: [None; MAX_EFFECTS],
            forces: false,
            levels: false,
            remembers: false,
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
        self.remembers |= hooks.memory;
        let joint = effect.joint;
        let own = *self.arm.inertia(&self.theta, &SVector::zeros()).get((joint, joint))?;
        *self.added.get_mut((joint, joint))? += effect.law.inertia(&effect.p);
        if let Some(drive) = effect.law.drive(&effect.p, own) {
            *self.drives.get_mut(joint)? = Some(drive);
            if drive.inside {
                *self.added.get_mut((joint, joint))? -= drive.inertia;
            }
        }
        self.couple(effect.law.coupling(&effect.p));
        self.tilt += effect.law.tilt(&effect.p);
        if let Some((mass, distance)) = effect.law.payload(&effect.p) {
            let delta = self.arm.payload(&self.theta, mass, distance);
            for (value, change) in self.theta.iter_mut().zip(delta) {
                *value += change;
            }
        }
        Some(self)
    }

    /// Adds to the inertia between the first two joints.
    fn couple(&mut self, inertia: T) {
        for at in [(0, 1), (1, 0)] {
            if let Some(entry) = self.added.get_mut(at) {
                *entry += inertia;
            }
        }
    }

    /// Whether a joint has a motor side of its own.
    #[inline]
    pub fn is_driven(&self) -> bool {
        self.drives.iter().any(Option::is_some)
    }

    /// Whether a joint remembers its path.
    #[inline]
    pub fn remembers(&self) -> bool {
        self.remembers
    }

    /// The motor side of joint `j`.
    pub fn drive(&self, j: usize) -> Option<&Drive<T>> {
        self.drives.get(j)?.as_ref()
    }

    /// What reaches the joints of the motors' torque `tau`.
    #[inline]
    pub fn transmitted(&self, tau: &SVector<T, N>, hidden: &Hidden<T, N>) -> SVector<T, N> {
        SVector::from_fn(|j, _| match &self.drives[j] {
            Some(drive) => drive.transmitted(hidden.twist[j], hidden.dtwist[j]),
            None => tau[j],
        })
    }

    /// What the joints remember at `q`.
    #[inline]
    pub fn memory(&self, q: &SVector<T, N>, hidden: &Hidden<T, N>) -> SVector<T, N> {
        let mut memory = hidden.memory;
        if self.remembers {
            for effect in self.effects.iter().flatten().filter(|e| e.law.spec().hooks.memory) {
                let j = effect.joint;
                if let (Some(z), Some(to), Some(from)) = (memory.get_mut(j), q.get(j), hidden.anchor.get(j)) {
                    *z = effect.law.remember(&effect.p, *z, *to - *from);
                }
            }
        }
        memory
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
        JointPoint { t, q, dq, tau, load, friction, other: T::zero(), memory: T::zero() }
    }

    /// Direction in which joint `j` slides, between -1 and 1 where friction is smoothed.
    #[inline]
    fn sliding(&self, j: usize, dq: &SVector<T, N>, modes: &[Mode; N]) -> T {
        if self.smoothing > T::zero() { (dq[j] / self.smoothing).tanh() } else { modes[j].direction() }
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

    /// Equation (1) solved for `ddq` under the motors' torque `tau`, with stuck joints held at rest.
    #[inline]
    pub fn acceleration(
        &self,
        t: T,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
        tau: &SVector<T, N>,
        modes: &[Mode; N],
        hidden: &Hidden<T, N>,
    ) -> Motion<T, N> {
        if !self.is_driven() {
            return self.rigid(t, q, dq, tau, modes, hidden);
        }
        let transmitted = self.transmitted(tau, hidden);
        let mut motion = self.rigid(t, q, dq, &transmitted, modes, hidden);
        for j in 0..N {
            if let Some(drive) = &self.drives[j] {
                motion.ddtwist[j] = (tau[j] - transmitted[j]) / drive.inertia - motion.ddq[j];
            }
        }
        motion
    }

    /// The same for given torques at the joints.
    #[inline]
    fn rigid(
        &self,
        t: T,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
        tau: &SVector<T, N>,
        modes: &[Mode; N],
        hidden: &Hidden<T, N>,
    ) -> Motion<T, N> {
        let (mut inertia, bias) = self.arm.dynamics(&self.theta, q, dq, self.tilt);
        inertia += self.added;
        let memory = self.memory(q, hidden);
        let mut rhs = SVector::<T, N>::zeros();
        for j in 0..N {
            let mut x = self.point(j, t, q[j], dq[j], tau[j], bias[j]);
            if self.forces {
                x.other = self.sliding((j + 1) % N, dq, modes);
                x.memory = memory[j];
            }
            rhs[j] = tau[j] - bias[j] - self.viscous[j] * dq[j] - self.dry_friction(j, &x, modes[j])
                + self.force(j, &x);
        }
        self.solve(&inertia, &rhs, modes)
    }

    /// Equation (1) read the other way: the torque that a measured motion needs beyond `tau`, with motors riding rigidly on their
    /// links and friction smoothed as set.
    pub fn lacking(
        &self,
        t: T,
        motion: [&SVector<T, N>; 3],
        tau: &SVector<T, N>,
        hidden: &Hidden<T, N>,
    ) -> SVector<T, N> {
        let [q, dq, ddq] = motion;
        let (mut inertia, bias) = self.arm.dynamics(&self.theta, q, dq, self.tilt);
        inertia += self.added;
        for (j, drive) in self.drives.iter().enumerate() {
            inertia[(j, j)] += drive.as_ref().map_or_else(T::zero, |d| d.inertia);
        }
        let memory = self.memory(q, hidden);
        let modes: [Mode; N] = core::array::from_fn(|j| Mode::of(dq[j]));
        let mut lack = inertia * ddq + bias - tau;
        for j in 0..N {
            let mut x = self.point(j, t, q[j], dq[j], tau[j], bias[j]);
            x.other = self.sliding((j + 1) % N, dq, &modes);
            x.memory = memory[j];
            lack[j] += self.viscous[j] * dq[j] + self.dry_friction(j, &x, modes[j]) - self.force(j, &x);
        }
        lack
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
        Motion { ddq, holding, ddtwist: SVector::zeros() }
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

    /// Inertia of joint `j` at `q` with all other joints free to move.
    fn free_inertia(j: usize, inertia: &SMatrix<T, N, N>) -> T {
        let mut least = inertia[(j, j)];
        for k in 0..N {
            if k != j {
                least -= inertia[(j, k)] * inertia[(j, k)] / inertia[(k, k)];
            }
        }
        least.max(lit(1e-9))
    }

    /// Fastest rate of the plant at `q`, 1/s: at which smoothed friction stops a joint, or a motor swings against its link. Zero for
    /// a rigid arm with exact friction.
    pub fn fastest(&self, q: &SVector<T, N>) -> T {
        let mut fastest = T::zero();
        if self.smoothing == T::zero() && !self.is_driven() {
            return fastest;
        }
        let inertia = self.arm.dynamics(&self.theta, q, &SVector::zeros(), self.tilt).0 + self.added;
        for j in 0..N {
            let free = Self::free_inertia(j, &inertia);
            if self.smoothing > T::zero() {
                let x = self.point(j, T::zero(), q[j], T::zero(), T::zero(), T::zero());
                fastest = fastest.max(self.level(j, &x, T::one()) / (self.smoothing * free));
            }
            if let Some(drive) = &self.drives[j] {
                fastest = fastest.max(drive.rate(free));
            }
        }
        fastest
    }
}
