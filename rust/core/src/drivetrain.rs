//! The transmissions of all joints: the torques that reach the links, and the motion of the rotors.
//!
//! While backlash is open, rotor and link move independently; while it is closed, they move as one body for as long as the flank
//! pushes. At an impact rotor and link stay together, and the rotor's momentum goes over to the arm at once (a plastic impact,
//! Brogliato 1999, chapter 4).

use crate::linear::solve_positive_definite;
use crate::real::Real;
use crate::transmission::{LatentState, Sides, Transmission};
use nalgebra::SVector;

/// Inertia matrix of an arm, by rows.
type InertiaMatrix<T, const N: usize> = [[T; N]; N];

/// Transmissions of all joints; a rigid joint has none. Loops count joints by index so that compilers leave out range checks.
#[derive(Debug, Clone, Copy)]
pub struct Drivetrain<T, const N: usize> {
    of: [Option<Transmission<T>>; N],
    sides: [Sides; N],
    any: bool,
    has_backlash: bool,
    brakes_motors: bool,
}

impl<T: Real, const N: usize> Drivetrain<T, N> {
    /// Drivetrain of an arm whose joints are all rigid.
    pub(crate) fn none() -> Self {
        Self { of: [None; N], sides: [Sides::LINK; N], any: false, has_backlash: false, brakes_motors: false }
    }

    /// Puts a transmission on joint `j`, and subtracts its rotor from the inertia matrix `inertia` if the rotor is a part of the link's nominal
    /// inertia; `None` if there is no joint `j`.
    pub(crate) fn add(
        &mut self,
        j: usize,
        transmission: Transmission<T>,
        inertia: &mut InertiaMatrix<T, N>,
    ) -> Option<()> {
        *self.of.get_mut(j)? = Some(transmission);
        self.any = true;
        self.has_backlash |= transmission.backlash > T::zero();
        if transmission.part_of_link {
            add_rotor_inertia(inertia, -transmission.inertia, &transmission.rotor_jacobian(j));
        }
        Some(())
    }

    /// Sets where encoder and friction of joint `j` sit, which matters only with a transmission; `None` if there is no joint `j`.
    pub(crate) fn set_sides(&mut self, j: usize, sides: Sides) -> Option<()> {
        *self.sides.get_mut(j)? = sides;
        self.brakes_motors |= sides.friction_at_motor;
        if let Some(transmission) = self.of.get_mut(j)?.as_mut().filter(|t| t.backlash <= T::zero()) {
            transmission.coupling_ratio = if sides.rotor_rides { T::one() } else { T::zero() };
        }
        Some(())
    }

    /// Whether encoder and friction of joint `j` sit on the link's or the motor's side of its transmission.
    #[inline]
    pub fn sides(&self, j: usize) -> Sides {
        if self.get(j).is_some() { self.sides[j] } else { Sides::LINK }
    }

    /// Whether the encoder of any joint measures the position of its motor.
    pub fn measures_motors(&self) -> bool {
        (0..N).any(|j| self.sides(j).encoder_at_motor)
    }

    /// Whether friction of any joint acts on its motor rather than on its link.
    #[inline]
    pub fn brakes_motors(&self) -> bool {
        self.brakes_motors
    }

    /// Whether friction of joint `j` acts on a motor that moves against its link; behind closed backlash both move as one.
    #[inline]
    pub fn brakes_motor(&self, j: usize, latent: &LatentState<T, N>) -> bool {
        self.brakes_motors && self.sides(j).friction_at_motor && latent.side[j] == T::zero()
    }

    /// Velocity, rad/s or m/s, on which the friction of joint `j` acts: of the motor or of the joint, which moves at `dq`.
    #[inline]
    pub fn friction_velocity(&self, j: usize, dq: T, latent: &LatentState<T, N>) -> T {
        if self.brakes_motor(j, latent) { dq + latent.deflection_rate[j] } else { dq }
    }

    /// Torque that the shaft of joint `j` passes on to the link, N m (N); 0 for rigid joints and for backlash.
    #[inline]
    pub(crate) fn transmitted(&self, j: usize, latent: &LatentState<T, N>) -> T {
        match self.get(j) {
            Some(transmission) if transmission.backlash <= T::zero() => {
                transmission.transmitted(latent.deflection[j], latent.deflection_rate[j])
            }
            _ => T::zero(),
        }
    }

    /// Positions that the encoders measure when the joints are at `q`, rad or m.
    #[inline]
    pub fn shown(&self, q: &SVector<T, N>, latent: &LatentState<T, N>) -> SVector<T, N> {
        SVector::from_fn(
            |j, _| if self.sides(j).encoder_at_motor { q[j] + latent.deflection[j] } else { q[j] },
        )
    }

    /// Whether any joint has a transmission, elastic or with backlash.
    #[inline]
    pub fn any(&self) -> bool {
        self.any
    }

    /// Whether any transmission has backlash.
    #[inline]
    pub fn has_backlash(&self) -> bool {
        self.has_backlash
    }

    /// Transmission of joint `j`, `None` for a rigid joint.
    #[inline]
    pub fn get(&self, j: usize) -> Option<&Transmission<T>> {
        self.of.get(j)?.as_ref()
    }

    /// Index and transmission of each joint that has a transmission.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (usize, &Transmission<T>)> {
        self.of.iter().enumerate().filter_map(|(j, transmission)| Some((j, transmission.as_ref()?)))
    }

    /// Part of the motor torque `tau` of joint `j` that accelerates the rotor instead of reaching the link, N m (N); 0 with closed backlash,
    /// where rotor and link move as one.
    #[inline]
    fn retained(j: usize, transmission: &Transmission<T>, tau: T, latent: &LatentState<T, N>) -> T {
        if transmission.backlash > T::zero() {
            return if latent.side[j] == T::zero() { tau } else { T::zero() };
        }
        tau - transmission.transmitted(latent.deflection[j], latent.deflection_rate[j])
    }

    /// Torques that reach the joints when the motors give `tau`, N m (N).
    #[inline]
    pub fn torque_at_joints(&self, tau: &SVector<T, N>, latent: &LatentState<T, N>) -> SVector<T, N> {
        let mut torque_at_joints = *tau;
        for j in 0..N {
            let Some(transmission) = &self.of[j] else { continue };
            let retained = Self::retained(j, transmission, tau[j], latent);
            for (torque, part) in torque_at_joints.iter_mut().zip(transmission.rotor_jacobian::<N>(j)) {
                *torque -= part * retained;
            }
        }
        torque_at_joints
    }

    /// Adds to an inertia matrix the rotors that move with their links because their backlash is closed.
    #[inline]
    pub(crate) fn add_closed_rotors(&self, inertia: &mut InertiaMatrix<T, N>, latent: &LatentState<T, N>) {
        for j in 0..N {
            let Some(transmission) = &self.of[j] else { continue };
            if latent.side[j] != T::zero() {
                add_rotor_inertia(inertia, transmission.inertia, &transmission.rotor_jacobian(j));
            }
        }
    }

    /// Takes the rotors that [`Self::add_closed_rotors`] adds from an inertia matrix.
    #[inline]
    pub(crate) fn take_closed_rotors(&self, inertia: &mut InertiaMatrix<T, N>, latent: &LatentState<T, N>) {
        for j in 0..N {
            let Some(transmission) = &self.of[j] else { continue };
            if latent.side[j] != T::zero() {
                add_rotor_inertia(inertia, -transmission.inertia, &transmission.rotor_jacobian(j));
            }
        }
    }

    /// Adds to an inertia matrix all rotors, as if each moved with its link.
    pub(crate) fn add_rotors(&self, inertia: &mut InertiaMatrix<T, N>) {
        for (j, transmission) in self.iter() {
            add_rotor_inertia(inertia, transmission.inertia, &transmission.rotor_jacobian(j));
        }
    }

    /// Accelerations of the transmissions' deflections, rad/s^2 (m/s^2), for motor torques `tau`, N m (N), and joint accelerations `ddq`.
    #[inline]
    pub(crate) fn deflection_accelerations(
        &self,
        tau: &SVector<T, N>,
        ddq: &SVector<T, N>,
        latent: &LatentState<T, N>,
    ) -> SVector<T, N> {
        let mut deflection_acceleration = SVector::zeros();
        for j in 0..N {
            let Some(transmission) = &self.of[j] else { continue };
            if latent.side[j] == T::zero() {
                let retained = Self::retained(j, transmission, tau[j], latent);
                deflection_acceleration[j] = retained / transmission.inertia
                    - SVector::from(transmission.rotor_jacobian::<N>(j)).dot(ddq);
            }
        }
        deflection_acceleration
    }

    /// Force by which the flank of joint `j`'s closed backlash would have to pull, N m (N); positive where the backlash opens. `None` if the joint
    /// has no closed backlash.
    #[inline]
    pub(crate) fn flank_tension(
        &self,
        j: usize,
        tau: T,
        ddq: &SVector<T, N>,
        latent: &LatentState<T, N>,
    ) -> Option<T> {
        let transmission = self.get(j)?;
        let side = *latent.side.get(j).filter(|side| **side != T::zero())?;
        Some(
            (transmission.inertia * SVector::from(transmission.rotor_jacobian::<N>(j)).dot(ddq) - tau) * side,
        )
    }

    /// Depth of joint `j`'s rotor behind the nearer flank of its open backlash, rad or m, negative between the flanks. `None` if the joint has no
    /// open backlash.
    #[inline]
    pub(crate) fn depth(&self, j: usize, latent: &LatentState<T, N>) -> Option<T> {
        let transmission = self.get(j).filter(|d| d.backlash > T::zero())?;
        let open = *latent.side.get(j)? == T::zero();
        open.then(|| latent.deflection[j].abs() - transmission.half_backlash())
    }

    /// Plastic impact of joint `j`'s rotor on the nearer flank of its backlash, in an arm with the inertia matrix `inertia`: velocities `dq` and
    /// deflection rates jump.
    pub(crate) fn impact(
        &self,
        j: usize,
        inertia: &InertiaMatrix<T, N>,
        dq: &mut SVector<T, N>,
        latent: &mut LatentState<T, N>,
    ) {
        if j >= N {
            return;
        }
        let Some(transmission) = &self.of[j] else { return };
        let side = if latent.deflection[j] < T::zero() { -T::one() } else { T::one() };
        let rate = latent.deflection_rate[j];
        (latent.side[j], latent.deflection[j]) = (side, side * transmission.half_backlash());
        let mut combined = *inertia;
        self.add_closed_rotors(&mut combined, latent);
        let gained = transmission.rotor_jacobian::<N>(j).map(|part| part * transmission.inertia * rate);
        let change = SVector::from(solve_positive_definite(combined, gained));
        *dq += change;
        for k in 0..N {
            let Some(other) = &self.of[k] else { continue };
            if latent.side[k] == T::zero() {
                latent.deflection_rate[k] -= SVector::from(other.rotor_jacobian::<N>(k)).dot(&change);
            }
        }
        latent.deflection_rate[j] = T::zero();
    }
}

/// Adds to an inertia matrix a rotor of `inertia`, kg m^2 (kg), whose velocity is `rotor_jacobian . dq`.
#[inline]
fn add_rotor_inertia<T: Real, const N: usize>(
    matrix: &mut InertiaMatrix<T, N>,
    inertia: T,
    rotor_jacobian: &[T; N],
) {
    for (row, a) in matrix.iter_mut().zip(rotor_jacobian) {
        for (entry, b) in row.iter_mut().zip(rotor_jacobian) {
            *entry += inertia * *a * *b;
        }
    }
}
