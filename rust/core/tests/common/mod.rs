//! Functions shared by several test files.

/// Torques (31) and (32) of Reyes and Kelly (1997) at the time `t`, s, in N m.
pub fn seed_torque(t: f64) -> [f64; 2] {
    [
        (1.0 - (-0.8 * t).exp()) * 29.0 + 68.0 * (16.0 * t + 0.1).sin() + 9.0 * (20.0 * t + 0.15).sin(),
        (1.0 - (-1.8 * t).exp()) * 1.2 + 8.0 * (26.0 * t + 0.08).sin() + 2.0 * (12.0 * t + 0.34).sin(),
    ]
}
