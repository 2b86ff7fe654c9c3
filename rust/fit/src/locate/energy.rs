//! Energy balance of the residual torque.
//!
//! Power is torque times velocity. Friction that a model leaves out only takes energy from the joint; a spring, an inertia or a tilt takes energy and
//! gives it back; a motor that delivers more than its command supplies energy. So the work of the residual torque, relative to all energy that this
//! torque exchanges, distinguishes kinds of causes before any cause is named. Noise in the residual torque takes and gives energy at random: noise
//! reduces the size of the balance but does not change its sign.

use crate::locate::regimes::{ResidualTorque, ResidualTorques};
use schemars::JsonSchema;
use serde::Serialize;

/// Size of the energy balance (work of the residual torque over the integral of its absolute power, -1 to 1) beyond which the torque counts as mainly
/// taking or mainly giving energy.
const ONE_WAY: f64 = 0.5;

/// Direction in which a residual torque exchanges energy with the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum EnergyKind {
    /// Energy leaves the arm, as by friction that the model lacks.
    Takes,
    /// Energy is supplied to the arm, as by a motor that delivers more than its command.
    Gives,
    /// Energy is taken and given back, as by a spring.
    Both,
}

/// Energy that the residual torque of one joint exchanges with the arm.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Energy {
    /// Joint that the residual torque acts on, counted from 1.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Model whose residual torque is meant: `before` (the arm file as it is), `refit` (parameters re-estimated) or `after` (with the causes).
    pub model: &'static str,
    /// Mean power of the residual torque, W; negative: the model leaves out a loss.
    pub power: f64,
    /// Mean absolute power of the residual torque, W: energy taken and given.
    pub exchanged: f64,
    /// Mean absolute power of the commanded torque, W.
    pub commanded: f64,
    /// Energy balance `power / exchanged`, from -1 (the residual torque only takes energy) to 1 (it only gives energy).
    pub balance: f64,
    /// Direction in which the residual torque exchanges energy.
    pub kind: EnergyKind,
}

/// Energy balance of the residual torque of every joint under every model.
pub fn energy<const N: usize>(residuals: &ResidualTorques<N>) -> Vec<Energy> {
    let models = [("before", &residuals.before), ("refit", &residuals.refit), ("after", &residuals.after)];
    models.iter().flat_map(|(model, residuals)| of_model(model, residuals)).collect()
}

fn of_model<const N: usize>(model: &'static str, residuals: &[ResidualTorque<N>]) -> Vec<Energy> {
    let mean = |of: &dyn Fn(&ResidualTorque<N>) -> f64| {
        residuals.iter().map(of).sum::<f64>() / residuals.len().max(1) as f64
    };
    let of_joint = |j: usize| {
        let power = mean(&|x| x.residual[j] * x.dq[j]);
        let exchanged = mean(&|x| (x.residual[j] * x.dq[j]).abs());
        let balance = if exchanged > 0.0 { power / exchanged } else { 0.0 };
        let kind = match balance {
            b if b < -ONE_WAY => EnergyKind::Takes,
            b if b > ONE_WAY => EnergyKind::Gives,
            _ => EnergyKind::Both,
        };
        Energy {
            joint: j + 1,
            model,
            power,
            exchanged,
            commanded: mean(&|x| (x.tau[j] * x.dq[j]).abs()),
            balance,
            kind,
        }
    };
    (0..N).map(of_joint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector1;

    /// Residual torques of one joint that oscillates, as a function of its position and velocity.
    fn oscillation(residual: fn(f64, f64) -> f64) -> Vec<ResidualTorque<1>> {
        (0..1000)
            .map(|i| {
                let t = 0.01 * f64::from(i);
                let (q, dq) = (t.sin(), t.cos());
                ResidualTorque {
                    track: 0,
                    t,
                    q: Vector1::new(q),
                    dq: Vector1::new(dq),
                    tau: Vector1::new(2.0),
                    reversal: [false],
                    residual: Vector1::new(residual(q, dq)),
                }
            })
            .collect()
    }

    #[test]
    fn friction_takes_a_motor_gives_and_a_spring_does_both() {
        let of = |residual| {
            energy(&ResidualTorques { before: oscillation(residual), refit: Vec::new(), after: Vec::new() })
                .remove(0)
        };
        let friction = of(|_, dq| -0.3 * dq.signum());
        assert!(
            (friction.balance + 1.0).abs() < 1e-12
                && friction.kind == EnergyKind::Takes
                && friction.power < 0.0
        );
        assert!((friction.exchanged / friction.commanded - 0.15).abs() < 1e-12);
        assert_eq!(of(|_, dq| 0.1 * dq).kind, EnergyKind::Gives);
        let spring = of(|q, _| -5.0 * q);
        assert!(spring.balance.abs() < 0.1 && spring.kind == EnergyKind::Both && spring.exchanged > 1.0);
        assert_eq!(of(|_, _| 0.0).balance, 0.0);
    }
}
