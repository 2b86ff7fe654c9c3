//! Online estimators of serial arms, in three sizes of memory; the number of joints and of parameters is chosen at run time.
//!
//! An arm of fewer joints than the size has room for is extended by massless joints that stand still.

use super::monitored::MonitoredEstimator;
use super::{EstimatorSettings, OnlineError, check_start};
use crate::chain::{Chain, ChainJoint, JointKind, LINK_PARAMETERS, PARAMETERS_PER_JOINT, Vector3};
use crate::real::{Real, lit};
use crate::regression::ChosenColumns;

/// Online estimator of up to `R` of the `P = 13 N` parameters, and constant torques, of a serial arm of up to `N` joints.
pub type ChainEstimator<T, const N: usize, const P: usize, const R: usize> =
    MonitoredEstimator<T, Chain<T, N>, N, P, R, ChosenColumns<T, N, P, R>>;

/// Online estimator of a serial arm of up to 2 joints and 20 parameters.
pub type SmallChain<T> = ChainEstimator<T, 2, 26, 20>;
/// Online estimator of a serial arm of up to 4 joints and 40 parameters.
pub type MediumChain<T> = ChainEstimator<T, 4, 52, 40>;
/// Online estimator of a serial arm of up to 7 joints and 72 parameters.
pub type LargeChain<T> = ChainEstimator<T, 7, 91, 72>;

/// Memory sizes of online estimators of serial arms. Each has room for the base parameters of any arm of `n` joints: `7 n - 4` of its links, `n - 1`
/// rotor inertias, and viscous, Coulomb and constant torques.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChainSize {
    /// Up to 2 joints and 20 parameters: [`SmallChain`].
    Small,
    /// Up to 4 joints and 40 parameters: [`MediumChain`].
    Medium,
    /// Up to 7 joints and 72 parameters: [`LargeChain`].
    Large,
}

impl ChainSize {
    /// All sizes, from the smallest.
    pub const ALL: [Self; 3] = [Self::Small, Self::Medium, Self::Large];

    /// Largest numbers of joints and of estimated parameters that an estimator of this size has room for.
    pub const fn room(self) -> [usize; 2] {
        match self {
            Self::Small => [2, 20],
            Self::Medium => [4, 40],
            Self::Large => [7, 72],
        }
    }

    /// Smallest size that has room for this number of joints and of estimated parameters; `None` if there is none.
    pub fn of(joints: usize, parameters: usize) -> Option<Self> {
        Self::ALL.into_iter().find(|size| joints <= size.room()[0] && parameters <= size.room()[1])
    }
}

/// Settings of an online estimator of a serial arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainSettings<'a, T> {
    /// Settings that do not depend on the arm.
    pub common: EstimatorSettings<T>,
    /// Joints of the arm, from the base outwards; rotations orthogonal, axes of unit length.
    pub joints: &'a [ChainJoint<T>],
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: Vector3<T>,
    /// Estimated parameters, strictly ascending, as indices into the arm's 13 parameters per joint ([`crate::chain::parameter`]); `13 n + j` is a
    /// constant torque of joint `j`, `n` the number of joints.
    pub columns: &'a [usize],
    /// Values, SI, of all 13 parameters per joint (ten inertial, rotor inertia, viscous and Coulomb friction) in the order of
    /// [`crate::chain::parameter`]; used for the parameters that are not estimated. Empty for zeros.
    pub known: &'a [T],
}

/// Largest accepted departure of a joint's rotation matrix from orthogonality, and of a joint axis from unit length.
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

    /// Index of parameter `i` of the arm in `theta` of a chain of `room` joints.
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

/// Whether a joint's rotation matrix is orthogonal and right-handed, and its axis of unit length.
fn is_rigid<T: Real>(joint: &ChainJoint<T>) -> bool {
    let dot = |a: &Vector3<T>, b: &Vector3<T>| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let [x, y, z] = &joint.rotation;
    let near = |a: T, b: f64| (a - lit(b)).abs() <= lit(ORTHOGONAL);
    let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
    let unit = [x, y, z, &joint.axis].into_iter().all(|row| near(dot(row, row), 1.0));
    unit & near(dot(x, y), 0.0) & near(dot(y, z), 0.0) & near(dot(x, z), 0.0) & near(dot(&cross, z), 1.0)
}

impl<T: Real, const N: usize, const P: usize, const R: usize> ChainEstimator<T, N, P, R> {
    /// Estimator before its first sample; the initial estimate `theta0` has one entry per estimated parameter, or is empty for zeros.
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
