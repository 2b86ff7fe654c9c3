//! Selection of the arm type, which is known at compile time, from a description of an arm at run time.

use armgap_core::arm::{Arm, ArmKind, Axis, Pendulum, TwoLink};
use armgap_core::transmission::Sides;

/// Arm as described by an arm file; lists have one entry per parameter or joint.
#[derive(Debug, Clone)]
pub struct ArmDescription {
    /// Kind of arm, which fixes its equation of motion.
    pub kind: ArmKind,
    /// Acceleration of gravity, m/s^2.
    pub gravity: f64,
    /// Nominal values of all parameters, SI.
    pub theta: Vec<f64>,
    /// Prior standard deviations of all parameters, SI.
    pub sigma: Vec<f64>,
    /// Encoder counts per revolution (per metre on a linear joint), per joint.
    pub counts_per_rev: Option<Vec<f64>>,
    /// Torque limit per joint, N m or N.
    pub torque_limit: Option<Vec<f64>>,
    /// Link lengths, m.
    pub link_length: Option<Vec<f64>>,
    /// Per joint, whether the encoder measures the motor's position; `None` where that is unknown.
    pub encoder_at_motor: Option<Vec<Option<bool>>>,
    /// Per joint, whether friction acts on the motor; `None` where that is unknown.
    pub friction_at_motor: Option<Vec<Option<bool>>>,
    /// Gear ratio per joint: turns of the motor per turn of the joint.
    pub gear_ratio: Option<Vec<f64>>,
}

/// Gear ratio below which a rotor may ride on the preceding link, so that it turns with the joints before it.
const RIDES: f64 = 2.0;

/// Computation with an arm whose numbers of joints and parameters are known at compile time.
pub trait WithArm {
    /// Type of the computation's result.
    type Output;

    /// Runs the computation for `arm` with parameters `theta`; `R = P + N` is the number of parameters with one friction asymmetry per joint.
    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Self::Output;
}

impl ArmDescription {
    /// An arm of which only the parameters are known, each with a standard deviation of one unit.
    pub fn plain(kind: ArmKind, gravity: f64, theta: Vec<f64>, link_length: Option<Vec<f64>>) -> Self {
        Self {
            kind,
            gravity,
            sigma: vec![1.0; theta.len()],
            theta,
            counts_per_rev: None,
            torque_limit: None,
            link_length,
            encoder_at_motor: None,
            friction_at_motor: None,
            gear_ratio: None,
        }
    }

    /// Smallest steps of the position measurement per joint, rad or m, where the encoders are known.
    pub fn steps(&self) -> Option<Vec<f64>> {
        let whole = if self.kind.rotary() { std::f64::consts::TAU } else { 1.0 };
        self.counts_per_rev.as_ref().map(|counts| counts.iter().map(|count| whole / count).collect())
    }

    /// Sides of joint `j`'s transmission that encoder and friction may be on, those with both on one side first.
    pub fn sides(&self, j: usize) -> Vec<Sides> {
        let known =
            |list: &Option<Vec<Option<bool>>>| list.as_ref().and_then(|l| l.get(j).copied().flatten());
        let (encoder, friction) = (known(&self.encoder_at_motor), known(&self.friction_at_motor));
        let rides = self.gear_ratio.as_ref().and_then(|ratios| ratios.get(j)).map(|ratio| *ratio < RIDES);
        let mixed = |encoder_at_motor| Sides {
            encoder_at_motor,
            friction_at_motor: !encoder_at_motor,
            rotor_rides: false,
        };
        let all = [false, true].into_iter().flat_map(|rotor_rides| {
            [Sides::LINK, Sides::MOTOR, mixed(true), mixed(false)].map(|s| Sides { rotor_rides, ..s })
        });
        // The first joint has no preceding link on which its rotor could ride.
        all.filter(|s| if j == 0 { !s.rotor_rides } else { rides.is_none_or(|r| r == s.rotor_rides) })
            .filter(|s| encoder.is_none_or(|e| e == s.encoder_at_motor))
            .filter(|s| friction.is_none_or(|f| f == s.friction_at_motor))
            .collect()
    }

    /// Runs `work` with the arm type of the description's kind; `None` if the number of parameters does not fit the kind.
    pub fn dispatch<W: WithArm>(&self, work: W) -> Option<W::Output> {
        let gravity = self.gravity;
        let first_length = self.link_length.as_ref().and_then(|l| l.first().copied());
        match self.kind {
            ArmKind::Axis => {
                let theta: [f64; 4] = self.theta.as_slice().try_into().ok()?;
                Some(work.call::<_, 1, 4, 5>(Axis { gravity }, theta))
            }
            ArmKind::Pendulum => {
                let theta: [f64; 4] = self.theta.as_slice().try_into().ok()?;
                Some(work.call::<_, 1, 4, 5>(Pendulum { gravity }, theta))
            }
            ArmKind::TwoLink => {
                let theta: [f64; 9] = self.theta.as_slice().try_into().ok()?;
                Some(work.call::<_, 2, 9, 11>(TwoLink::new(gravity, first_length, &theta), theta))
            }
        }
    }
}
