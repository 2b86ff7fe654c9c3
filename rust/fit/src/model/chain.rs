//! Selection of the chain type of one to seven joints, which is known at compile time, from a description at run time; chain dynamics row by row.

use crate::model::arm::WithArm;
use armgap_core::chain::{
    Chain, ChainJoint, JointKind, LINK_PARAMETERS, LinkInertia, PARAMETERS_PER_JOINT, parameter,
};

/// A serial arm of one to [`armgap_core::chain::MAX_JOINTS`] joints.
#[derive(Debug, Clone)]
pub struct ChainDescription {
    /// Joints of the chain, from the base.
    pub joints: Vec<ChainJoint<f64>>,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: [f64; 3],
}

/// Computation with a chain whose number of joints is known at compile time.
pub trait WithChain {
    /// Type of the computation's result.
    type Output;

    /// Runs the computation for `chain`.
    fn call<const N: usize>(self, chain: &Chain<f64, N>) -> Self::Output;
}

/// Calls `$call!(n)` for the number of joints `$n`, which becomes a constant.
macro_rules! by_size {
    ($n:expr, $call:ident) => {
        match $n {
            1 => $call!(1),
            2 => $call!(2),
            3 => $call!(3),
            4 => $call!(4),
            5 => $call!(5),
            6 => $call!(6),
            7 => $call!(7),
            _ => None,
        }
    };
}

impl ChainDescription {
    /// Runs `work` with the chain; `None` unless it has one to [`armgap_core::chain::MAX_JOINTS`] joints.
    pub fn dispatch<W: WithChain>(&self, work: W) -> Option<W::Output> {
        macro_rules! call {
            ($n:literal) => {
                Some(work.call(&self.chain::<$n>()?))
            };
        }
        by_size!(self.joints.len(), call)
    }

    /// Runs `work` with the chain as an arm with the parameters `theta`, 13 per joint; `None` if the number of parameters does not fit, or unless the
    /// chain has one to [`armgap_core::chain::MAX_JOINTS`] joints.
    pub fn dispatch_arm<W: WithArm>(&self, theta: &[f64], work: W) -> Option<W::Output> {
        macro_rules! call {
            ($n:literal) => {{
                const P: usize = PARAMETERS_PER_JOINT * $n;
                let theta: [f64; P] = theta.try_into().ok()?;
                Some(work.call::<_, $n, P, { P + $n }>(self.chain::<$n>()?, theta))
            }};
        }
        by_size!(self.joints.len(), call)
    }

    /// Names and units of the chain's parameters, in the order of `theta`.
    pub fn parameters(&self) -> Vec<(String, &'static str)> {
        let kinds: Vec<JointKind> = self.joints.iter().map(|joint| joint.kind).collect();
        let all = (0..).map_while(|i| parameter(&kinds, i));
        all.map(|p| (p.to_string(), p.unit)).collect()
    }

    /// The chain as a type of `N` joints; `None` for another number of joints.
    fn chain<const N: usize>(&self) -> Option<Chain<f64, N>> {
        Some(Chain::new(self.joints.as_slice().try_into().ok()?, self.gravity))
    }
}

/// Dynamic quantity of a chain that is computed at every row of states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Inertia matrix with rotors, `(n, n)`.
    Inertia,
    /// Bias torque `C dq + g`, `(n,)`.
    Bias,
    /// Torques of a motion with given accelerations, without friction, `(n,)`.
    InverseDynamics,
    /// Derivatives of the torques of a motion by positions, `(n, n)`; rows are torques.
    TorqueByPosition,
    /// Derivatives of the torques of a motion by velocities, `(n, n)`; rows are torques.
    TorqueByVelocity,
    /// Accelerations under given torques, without friction, `(n,)`.
    Acceleration,
    /// Regressor of the torque over the links' parameters, `(n, 10 n)`.
    Regressor,
    /// Regressor of the momentum `M dq` over the links' parameters, `(n, 10 n)`.
    MomentumRegressor,
    /// Regressor of `g - dK/dq` over the links' parameters, with `K` the kinetic energy, `(n, 10 n)`.
    PotentialRegressor,
    /// Regressor of the total energy, above that of the arm at rest at `q = 0`, over the links' parameters, `(10 n,)`.
    EnergyRegressor,
    /// Kinetic energy with rotors, J, one number.
    KineticEnergy,
    /// Potential energy above that at `q = 0`, J, one number.
    PotentialEnergy,
}

impl Quantity {
    /// Shape of the quantity at one row for a chain of `n` joints.
    pub fn shape(self, n: usize) -> Vec<usize> {
        match self {
            Self::Inertia | Self::TorqueByPosition | Self::TorqueByVelocity => vec![n, n],
            Self::Bias | Self::InverseDynamics | Self::Acceleration => vec![n],
            Self::Regressor | Self::MomentumRegressor | Self::PotentialRegressor => {
                vec![n, LINK_PARAMETERS * n]
            }
            Self::EnergyRegressor => vec![LINK_PARAMETERS * n],
            Self::KineticEnergy | Self::PotentialEnergy => Vec::new(),
        }
    }
}

/// A dynamic quantity of a chain at many states; arrays by rows, one entry per joint in each row.
#[derive(Debug, Clone)]
pub struct ChainRows<'a> {
    /// Quantity that is computed at every row.
    pub quantity: Quantity,
    /// Parameters of the chain, 13 per joint; unused by regressors.
    pub theta: &'a [f64],
    /// Positions, rad or m, by rows.
    pub q: &'a [f64],
    /// Velocities, rad/s or m/s, by rows; unused by quantities that do not depend on velocity.
    pub dq: &'a [f64],
    /// Accelerations for inverse dynamics, its derivatives and the torque regressor; torques for [`Quantity::Acceleration`].
    pub input: &'a [f64],
}

impl WithChain for ChainRows<'_> {
    type Output = Vec<f64>;

    /// All entries of the quantity by rows; missing velocities, inputs and parameters count as zero.
    fn call<const N: usize>(self, chain: &Chain<f64, N>) -> Vec<f64> {
        let width: usize = self.quantity.shape(N).iter().product();
        let rows = self.q.len() / N;
        let mut all = vec![0.0; rows * width];
        let model = Model::<N>::new(self.theta);
        let of = |x: &[f64], row: usize| {
            x.get(row * N..).and_then(<[f64]>::first_chunk::<N>).copied().unwrap_or([0.0; N])
        };
        for (row, out) in all.chunks_exact_mut(width).enumerate() {
            let state = [of(self.q, row), of(self.dq, row), of(self.input, row)];
            self.quantity.write(chain, &model, &state, out);
        }
        all
    }
}

/// Inertial parameters of a chain's links and rotors.
struct Model<const N: usize> {
    links: [LinkInertia<f64>; N],
    rotors: [f64; N],
}

impl<const N: usize> Model<N> {
    fn new(theta: &[f64]) -> Self {
        let (links, rest) = theta.split_at((LINK_PARAMETERS * N).min(theta.len()));
        Self {
            links: links.as_chunks().0.first_chunk().copied().unwrap_or([[0.0; LINK_PARAMETERS]; N]),
            rotors: rest.first_chunk().copied().unwrap_or([0.0; N]),
        }
    }

    /// Inertia of the rotors, a diagonal matrix.
    fn constant_inertia(&self) -> [[f64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { self.rotors[j] } else { 0.0 }))
    }
}

impl Quantity {
    /// Writes the quantity of a chain in the state `[q, dq, input]` to `out`, row by row; `input` as in [`ChainRows`].
    fn write<const N: usize>(
        self,
        chain: &Chain<f64, N>,
        model: &Model<N>,
        [q, dq, input]: &[[f64; N]; 3],
        out: &mut [f64],
    ) {
        let Model { links, rotors } = model;
        let mut put = |i: usize, k: usize, row: LinkInertia<f64>| {
            let at = LINK_PARAMETERS * (N * i + k);
            out[at..at + LINK_PARAMETERS].copy_from_slice(&row);
        };
        match self {
            Self::Inertia => {
                let inertia = chain.inertia_matrix(links, q);
                for i in 0..N {
                    out[N * i..N * (i + 1)].copy_from_slice(&inertia[i]);
                    out[(N + 1) * i] += rotors[i];
                }
            }
            Self::Bias => out.copy_from_slice(&chain.bias(links, q, dq)),
            Self::InverseDynamics => {
                out.copy_from_slice(&chain.inverse_dynamics(links, q, dq, input));
                (0..N).for_each(|j| out[j] += rotors[j] * input[j]);
            }
            Self::TorqueByPosition => {
                let derivatives = chain.torque_derivatives(links, [q, dq, input]);
                out.copy_from_slice(derivatives.by_position.as_flattened());
            }
            Self::TorqueByVelocity => {
                let derivatives = chain.torque_derivatives(links, [q, dq, input]);
                out.copy_from_slice(derivatives.by_velocity.as_flattened());
            }
            Self::Acceleration => {
                let constant = model.constant_inertia();
                out.copy_from_slice(&chain.forward_dynamics(links, &constant, [q, dq, input]));
            }
            Self::Regressor => chain.torque_regressor([q, dq, input], put),
            Self::MomentumRegressor => chain.momentum_regressors(q, dq, |i, k, row, _| put(i, k, row)),
            Self::PotentialRegressor => chain.momentum_regressors(q, dq, |i, k, _, row| put(i, k, row)),
            Self::EnergyRegressor => out.copy_from_slice(chain.links_energy_regressor(q, dq).as_flattened()),
            Self::KineticEnergy => {
                let of_rotors: f64 = (0..N).map(|j| 0.5 * rotors[j] * dq[j] * dq[j]).sum();
                out[0] = chain.links_kinetic_energy(links, q, dq) + of_rotors;
            }
            Self::PotentialEnergy => out[0] = chain.links_potential_energy(links, q),
        }
    }
}
