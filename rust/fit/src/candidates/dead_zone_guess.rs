//! Initial guess of a drive that delivers nothing below a level of its command and the whole command above it.
//!
//! Below the level the residual torque is the command that is missing. The level is found by a line search over the sizes of the commands: it is the one
//! below which the missing command removes most of the squared residual torque.

use crate::predict::residual_torque::InverseDynamicsResidual;

/// Level, N m or N, of a joint's drive from the residual torques of logs; `None` if the missing commands remove nothing.
pub fn dead_zone_guess<const N: usize>(rows: &[InverseDynamicsResidual<N>], joint: usize) -> Option<f64> {
    let mut samples: Vec<[f64; 2]> = rows.iter().map(|r| [r.tau[joint], r.residual[joint]]).collect();
    level(&mut samples)
}

/// Level of commands and residual torques, which are the torque that the motion needs minus the command.
fn level(samples: &mut [[f64; 2]]) -> Option<f64> {
    samples.sort_by(|a, b| a[0].abs().total_cmp(&b[0].abs()));
    let (mut removed, mut best) = (0.0, (0.0, None));
    for (i, [tau, residual]) in samples.iter().enumerate() {
        removed += residual * residual - (residual + tau).powi(2);
        if removed > best.0 {
            let next = samples.get(i + 1).map_or(*tau, |next| next[0]);
            best = (removed, Some(0.5 * (tau.abs() + next.abs())));
        }
    }
    best.1.filter(|level| *level > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_is_where_commands_begin_to_move_the_joint() {
        let sample = |i: usize| {
            let t = 0.01 * i as f64;
            let tau = 2.0 * (0.9 * t).sin();
            let noise = 0.05 * (37.0 * t).sin();
            [tau, if tau.abs() < 0.6 { noise - tau } else { noise }]
        };
        let mut samples: Vec<[f64; 2]> = (0..4000).map(sample).collect();
        assert!((level(&mut samples).expect("a dead zone") - 0.6).abs() < 0.03);
        // A residual in the direction of the command is no missing command.
        for sample in &mut samples {
            sample[1] = 0.1 * sample[0];
        }
        assert_eq!(level(&mut samples), None);
        assert_eq!(level(&mut []), None);
    }
}
