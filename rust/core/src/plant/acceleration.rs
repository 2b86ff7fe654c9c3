//! Accelerations of the joints, and the residual torque by inverse dynamics.

use super::{Accelerations, Mode, Plant};
use crate::arm::{Arm, EquationTerms};
use crate::kinematics::{JointState, KinematicState};
use crate::linear::solve_positive_definite;
use crate::real::{Real, lit};
use crate::transmission::LatentState;
use nalgebra::SVector;

/// Least change of a fixed-point step's residual, squared and relative to the residual, from which Aitken's relaxation is computed anew: with less
/// the steps run in parallel, as those of friction that is as large as its load while it brakes, and have no point in common.
const LEAST_CHANGE: f64 = 1e-4;

/// Fixed-point steps, with Aitken's relaxation (Irons and Tuck 1969), for accelerations on which friction depends through the load: one joint alone
/// takes two while the load keeps its sign.
const LOAD_STEPS: usize = 4;

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Plant<T, A, N, P> {
    /// Equation of motion solved for `ddq` under the torques `tau`, N m (N), that reach the joints through their transmissions.
    #[inline]
    pub(super) fn undriven(
        &self,
        t: T,
        kinematics: &KinematicState<T, N>,
        tau: &SVector<T, N>,
        modes: &[Mode; N],
        latent: &LatentState<T, N>,
    ) -> Accelerations<T, N> {
        let KinematicState {
            joints: JointState { q, dq },
            equation_terms: equation_terms @ EquationTerms { inertia, bias },
            ..
        } = kinematics;
        let memory =
            if self.has_hysteresis { self.memory(&SVector::from(*q), latent) } else { latent.memory };
        let mut held = *modes;
        for j in 0..N {
            if self.drivetrain.brakes_motor(j, latent) {
                // Friction acts on the motor, so that no friction holds the link.
                held[j] = Mode::Forward;
            }
        }
        let forces = |loads: &[T; N]| {
            let mut rhs = SVector::<T, N>::zeros();
            for j in 0..N {
                let hooks = self.hooks[j];
                if self.drivetrain.brakes_motor(j, latent) {
                    rhs[j] = tau[j] - bias[j];
                    if hooks.force {
                        let mut x = self.point(j, t, q[j], dq[j], tau[j], loads[j]);
                        x.other = self.sliding((j + 1) % N, dq, modes);
                        x.memory = memory[j];
                        rhs[j] += self.force(j, &x);
                    }
                    continue;
                }
                if !(hooks.force || hooks.coulomb) {
                    let dry = self.rigid.coulomb[j].max(T::zero()) * self.sliding(j, dq, modes);
                    rhs[j] = tau[j] - bias[j] - self.rigid.viscous[j] * dq[j] - dry;
                    continue;
                }
                let mut x = self.point(j, t, q[j], dq[j], tau[j], loads[j]);
                if hooks.force {
                    x.other = self.sliding((j + 1) % N, dq, modes);
                    x.memory = memory[j];
                }
                rhs[j] =
                    tau[j] - bias[j] - self.rigid.viscous[j] * dq[j] - self.dry_friction(j, &x, modes[j])
                        + self.force(j, &x);
            }
            rhs
        };
        let mut motion = self.solve(inertia, &forces(bias), &held);
        if A::ROTORS_APART && self.passes_load {
            let mut links = *equation_terms;
            self.drivetrain.take_closed_rotors(&mut links.inertia, latent);
            let next = |ddq: &SVector<T, N>| {
                self.solve(inertia, &forces(&self.rigid.loads(&links, &(*ddq).into())), &held)
            };
            let (mut ddq, mut part, mut before) = (motion.ddq, T::one(), SVector::<T, N>::zeros());
            for i in 0..LOAD_STEPS {
                motion = next(&ddq);
                let off = motion.ddq - ddq;
                let change = off - before;
                let square = change.norm_squared();
                if i > 0 && square > lit::<T>(LEAST_CHANGE) * before.norm_squared() {
                    part = -part * before.dot(&change) / square;
                }
                ddq += off * part;
                before = off;
            }
            motion = next(&ddq);
        }
        motion
    }

    /// Residual torque by inverse dynamics, N m (N): the torque that the measured motion `[q, dq, ddq]` needs beyond `tau`, with rigid transmissions
    /// and with friction regularised over the plant's widths.
    pub fn residual_torque(
        &self,
        t: T,
        motion: [&SVector<T, N>; 3],
        tau: &SVector<T, N>,
        latent: &LatentState<T, N>,
    ) -> SVector<T, N> {
        let [q, dq, ddq] = motion;
        let joints = JointState { q: core::array::from_fn(|j| q[j]), dq: core::array::from_fn(|j| dq[j]) };
        let links = self.rigid.equation_terms(&joints);
        let EquationTerms { mut inertia, bias } = links;
        self.drivetrain.add_rotors(&mut inertia);
        let memory = self.memory(q, latent);
        let modes: [Mode; N] = core::array::from_fn(|j| Mode::of(dq[j]));
        let loads = self.rigid.loads(&links, &(*ddq).into());
        let mut residual = -tau;
        for j in 0..N {
            for k in 0..N {
                residual[j] += inertia[j][k] * ddq[k];
            }
            let mut x = self.point(j, t, q[j], dq[j], tau[j], loads[j]);
            x.other = self.sliding((j + 1) % N, &joints.dq, &modes);
            x.memory = memory[j];
            let friction = self.rigid.viscous[j] * dq[j] + self.dry_friction(j, &x, modes[j]);
            residual[j] += bias[j] + friction - self.force(j, &x);
        }
        residual
    }

    /// Solves `M ddq = rhs` without the rows and columns of stuck joints.
    #[inline]
    fn solve(&self, inertia: &[[T; N]; N], rhs: &SVector<T, N>, modes: &[Mode; N]) -> Accelerations<T, N> {
        let stuck = self.stuck(modes);
        let (mut reduced, mut b) = (*inertia, *rhs);
        for j in 0..N {
            if stuck[j] {
                for k in 0..N {
                    reduced[j][k] = T::zero();
                    reduced[k][j] = T::zero();
                }
                reduced[j][j] = T::one();
                b[j] = T::zero();
            }
        }
        let ddq = SVector::from(solve_positive_definite(reduced, b.into()));
        let mut friction_at_rest = SVector::zeros();
        for j in 0..N {
            if stuck[j] {
                friction_at_rest[j] = rhs[j];
                for k in 0..N {
                    friction_at_rest[j] -= inertia[j][k] * ddq[k];
                }
            }
        }
        let zero = SVector::zeros();
        Accelerations { ddq, friction_at_rest, deflection_acceleration: zero, motor_friction: zero }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::{Chain, ChainJoint, JointKind, point_mass};
    use crate::effect::{Active, find};

    /// One turning link of inertia 0.8 kg m^2 without gravity, with a rotor of 0.3 kg m^2 and an effect of size `p`, such as friction by load.
    fn turning(name: &'static str, p: f64) -> Plant<f64, Chain<f64, 1>, 1, 13> {
        let joint = ChainJoint {
            kind: JointKind::Revolute,
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            translation: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
        };
        let mut theta = [0.0; 13];
        theta[..10].copy_from_slice(&point_mass(0.8, [1.0, 0.0, 0.0]));
        theta[10..].copy_from_slice(&[0.3, 0.5, 0.4]);
        let law = find::<f64>(name).unwrap();
        Plant::new(Chain::new([joint], [0.0; 3]), theta)
            .with_effect(Active { law, joint: 0, p: [p, 0.0, 0.0] })
            .unwrap()
    }

    #[test]
    fn friction_by_load_takes_the_torque_for_the_links_inertia_without_the_rotors() {
        assert!(turning("coulomb_asymmetry", 0.2).is_plain());
        for (tau, dq, mu) in [
            (3.0, 0.7, 0.2),
            (-3.0, 0.7, 0.2),
            (-2.0, -0.5, 0.2),
            (9.0, 0.7, 0.7),
            (9.0, 0.7, 1.2),
            (-3.0, 0.7, 0.6),
        ] {
            let plant = turning("load_dependent_friction", mu);
            assert!(!plant.is_plain());
            let kinematics = plant.rigid().kinematics(&JointState { q: [0.0], dq: [dq] });
            let latent = LatentState::none(SVector::zeros());
            let ddq = plant.acceleration(0.0, &kinematics, &[tau].into(), &[Mode::of(dq)], &latent).ddq[0];
            let load = 0.8 * ddq;
            let left = tau - 0.3 * ddq - load - 0.5 * dq - (0.4 + mu * f64::abs(load)) * dq.signum();
            assert!(left.abs() < 1e-12, "{left} of {load}");
            let motion = [SVector::zeros(), [dq].into(), [ddq].into()];
            let [q, dq, ddq] = &motion;
            let residual = plant.residual_torque(0.0, [q, dq, ddq], &[tau].into(), &latent)[0];
            assert!((residual + left).abs() < 1e-12, "{residual}");
        }
    }
}
