//! Online estimators of serial arms, in three sizes of memory; the number of joints and of parameters is chosen at run time.
//!
//! A smaller arm than the size has room for is continued by joints that stand still and carry nothing.

use super::monitored::MonitoredEstimator;
use super::{EstimatorSettings, OnlineError, check_start};
use crate::chain::{Chain, ChainJoint, JointKind, LINK_PARAMETERS, PARAMETERS_PER_JOINT, Vector3};
use crate::real::{Real, lit};
use crate::regression::ChosenColumns;

/// An estimator of up to `R` of the `P = 13 N` parameters, and constant torques, of a serial arm of up to `N` joints.
pub type ChainEstimator<T, const N: usize, const P: usize, const R: usize> =
    MonitoredEstimator<T, Chain<T, N>, N, P, R, ChosenColumns<T, N, P, R>>;

/// Up to 2 joints and 20 parameters.
pub type SmallChain<T> = ChainEstimator<T, 2, 26, 20>;
/// Up to 4 joints and 40 parameters.
pub type MediumChain<T> = ChainEstimator<T, 4, 52, 40>;
/// Up to 7 joints and 72 parameters.
pub type LargeChain<T> = ChainEstimator<T, 7, 91, 72>;

/// Sizes of estimators. Each has room for the base parameters of any arm of so many joints: `7 n - 4` of its links, `n - 1` rotor
/// inertias, and viscous, Coulomb and constant torques.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainSize {
    /// [`SmallChain`].
    Small,
    /// [`MediumChain`].
    Medium,
    /// [`LargeChain`].
    Large,
}

impl ChainSize {
    /// Every size.
    pub const ALL: [Self; 3] = [Self::Small, Self::Medium, Self::Large];

    /// Most joints and parameters.
    pub const fn room(self) -> [usize; 2] {
        match self {
            Self::Small => [2, 20],
            Self::Medium => [4, 40],
            Self::Large => [7, 72],
        }
    }

    /// The smallest that has room.
    pub fn of(joints: usize, parameters: usize) -> Option<Self> {
        Self::ALL.into_iter().find(|size| joints <= size.room()[0] && parameters <= size.room()[1])
    }
}

/// Settings of an estimator of a serial arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainSettings<'a, T> {
    /// What does not depend on the arm.
    pub common: EstimatorSettings<T>,
    /// Joints, from the base; rotations orthogonal, axes of unit length.
    pub joints: &'a [ChainJoint<T>],
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: Vector3<T>,
    /// Estimated parameters, strictly ascending, as indices into the arm's 13 parameters per joint ([`crate::chain::parameter`]); `13 n + j`
    /// is a constant torque of joint `j`.
    pub columns: &'a [usize],
    /// Values of the 13 parameters per joint, of which those count that are not estimated; or none, for zeros.
    pub known: &'a [T],
}

/// Largest departure of a rotation from orthogonality, and of an axis from unit length.
const ORTHOGONAL: f64 = 1e-4;

impl<T: Real> ChainSettings<'_, T> {
    fn check(&self, theta0: &[T]) -> Result<(), OnlineError> {
        self.common.check()?;
        check_start(theta0, self.columns.len())?;
        let possible = |x: &T| x.abs() <= lit(1e9);
        if !self.gravity.iter().all(possible) {
            return Err(OnlineError::Range("gravity"));
        }
        if !self.joints.iter().all(|joint| joint.translation.iter().all(possible) && is_rigid(joint)) {
            return Err(OnlineError::Range("joints"));
        }
        let expected = PARAMETERS_PER_JOINT * self.joints.len();
        if !(self.known.is_empty() || self.known.len() == expected) {
            return Err(OnlineError::Length { name: "known", expected });
        }
        if !self.known.iter().all(possible) {
            return Err(OnlineError::Range("known"));
        }
        Ok(())
    }

    /// Index in the order of a chain of `room` joints.
    fn index(&self, i: usize, room: usize) -> usize {
        let n = self.joints.len();
        match i.checked_sub(LINK_PARAMETERS * n) {
            Some(k) => {
                let (kind, j) = (k.checked_div(n).unwrap_or(0), k.checked_rem(n).unwrap_or(0));
                (LINK_PARAMETERS + kind) * room + j
            }
            None => i,
        }
    }
}

/// Whether a joint's rotation is one, and its axis of unit length.
fn is_rigid<T: Real>(joint: &ChainJoint<T>) -> bool {
    let dot = |a: &Vector3<T>, b: &Vector3<T>| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [x, y, z] = &joint.rotation;
    let near = |a: T, b: f64| (a - lit(b)).abs() <= lit(ORTHOGONAL);
    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    let unit = [x, y, z, &joint.axis].into_iter().all(|row| near(dot(row, row), 1.0));
    unit & near(dot(x, y), 0.0) & near(dot(y, z), 0.0) & near(dot(x, z), 0.0) & near(dot(&cross, z), 1.0)
}

impl<T: Real, const N: usize, const P: usize, const R: usize> ChainEstimator<T, N, P, R> {
    /// An estimator that has seen nothing yet; `theta0` has one entry per estimated parameter, or none for zeros.
    pub fn of_chain(settings: &ChainSettings<'_, T>, theta0: &[T]) -> Result<Self, OnlineError> {
        const { assert!(P == PARAMETERS_PER_JOINT * N, "a chain has 13 parameters per joint") }
        settings.check(theta0)?;
        let n = settings.joints.len();
        if n == 0 || n > N {
            return Err(OnlineError::Range("joints"));
        }
        let unused = ChainJoint {
            kind: JointKind::Prismatic,
            rotation: core::array::from_fn(|i| core::array::from_fn(|j| lit(f64::from(u8::from(i == j))))),
            translation: [T::zero(); 3],
            axis: [T::zero(), T::zero(), T::one()],
        };
        let (mut joints, mut known) = ([unused; N], [T::zero(); P]);
        for (joint, given) in joints.iter_mut().zip(settings.joints) {
            *joint = *given;
        }
        for (i, value) in settings.known.iter().enumerate() {
            if let Some(entry) = known.get_mut(settings.index(i, N)) {
                *entry = *value;
            }
        }
        if settings.columns.iter().any(|i| *i >= (PARAMETERS_PER_JOINT + 1) * n) {
            return Err(OnlineError::Range("columns"));
        }
        let columns = settings.columns.iter().map(|i| settings.index(*i, N));
        let Some(columns) = ChosenColumns::new(columns, &known) else {
            return Err(OnlineError::Range("columns"));
        };
        if columns.is_empty() {
            return Err(OnlineError::Range("columns"));
        }
        let arm = Chain::new(joints, settings.gravity);
        Ok(Self::of_columns(arm, columns, [n, columns.len()], &settings.common, theta0))
    }
}
