//! The motor sides of an arm's joints: what reaches the links of the motors' torque, and how the rotors move.
//!
//! A play is open or closed. Open, its rotor and its link move apart from each other; closed, they move as one body for as long as the
//! flank pushes. When they meet they stay together, and the rotor's momentum goes over to the arm at once (a plastic impact,
//! Brogliato 1999, chapter 4).

use crate::linear::solve_positive_definite;
use crate::real::Real;
use crate::transmission::{Drive, Hidden};
use nalgebra::SVector;

/// An inertia matrix, by rows.
type Inertia<T, const N: usize> = [[T; N]; N];

/// The motor sides of all joints; a rigid joint has none. Loops count joints by their index, so that compilers see none out of range.
#[derive(Debug, Clone, Copy)]
pub struct Drives<T, const N: usize> {
    of: [Option<Drive<T>>; N],
    any: bool,
    play: bool,
}

impl<T: Real, const N: usize> Drives<T, N> {
    /// All joints rigid.
    pub(crate) fn none() -> Self {
        Self { of: [None; N], any: false, play: false }
    }

    /// Puts a motor side on joint `j`, if there is such a joint, and takes its inertia out of the link if it is a part of that.
    pub(crate) fn add(&mut self, j: usize, drive: Drive<T>, inertia: &mut Inertia<T, N>) -> Option<()> {
        *self.of.get_mut(j)? = Some(drive);
        self.any = true;
        self.play |= drive.gap > T::zero();
        if drive.inside {
            load(inertia, -drive.inertia, &drive.lever(j));
        }
        Some(())
    }

    /// Whether a joint has a motor side of its own.
    #[inline]
    pub fn any(&self) -> bool {
        self.any
    }

    /// Whether one of them has play.
    #[inline]
    pub fn play(&self) -> bool {
        self.play
    }

    /// The motor side of joint `j`.
    #[inline]
    pub fn get(&self, j: usize) -> Option<&Drive<T>> {
        self.of.get(j)?.as_ref()
    }

    /// Joints with a motor side.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (usize, &Drive<T>)> {
        self.of.iter().enumerate().filter_map(|(j, drive)| Some((j, drive.as_ref()?)))
    }

    /// What the motor of joint `j` does not pass on of its torque; what a closed play passes on is all of it, to rotor and link together.
    #[inline]
    fn kept(j: usize, drive: &Drive<T>, tau: T, hidden: &Hidden<T, N>) -> T {
        if drive.gap > T::zero() {
            return if hidden.side[j] == T::zero() { tau } else { T::zero() };
        }
        tau - drive.transmitted(hidden.twist[j], hidden.dtwist[j])
    }

    /// What reaches the joints of the motors' torque `tau`.
    #[inline]
    pub fn reaching(&self, tau: &SVector<T, N>, hidden: &Hidden<T, N>) -> SVector<T, N> {
        let mut reaching = *tau;
        for j in 0..N {
            let Some(drive) = &self.of[j] else { continue };
            let kept = Self::kept(j, drive, tau[j], hidden);
            for (torque, part) in reaching.iter_mut().zip(drive.lever::<N>(j)) {
                *torque -= part * kept;
            }
        }
        reaching
    }

    /// Adds the rotors that move with their links because their play is closed.
    #[inline]
    pub(crate) fn close(&self, inertia: &mut Inertia<T, N>, hidden: &Hidden<T, N>) {
        for j in 0..N {
            let Some(drive) = &self.of[j] else { continue };
            if hidden.side[j] != T::zero() {
                load(inertia, drive.inertia, &drive.lever(j));
            }
        }
    }

    /// Adds all rotors, as if they moved with their links.
    pub(crate) fn ride(&self, inertia: &mut Inertia<T, N>) {
        for (j, drive) in self.iter() {
            load(inertia, drive.inertia, &drive.lever(j));
        }
    }

    /// Accelerations of the twists beside those of the joints.
    #[inline]
    pub(crate) fn twisting(
        &self,
        tau: &SVector<T, N>,
        ddq: &SVector<T, N>,
        hidden: &Hidden<T, N>,
    ) -> SVector<T, N> {
        let mut ddtwist = SVector::zeros();
        for j in 0..N {
            let Some(drive) = &self.of[j] else { continue };
            if hidden.side[j] == T::zero() {
                let kept = Self::kept(j, drive, tau[j], hidden);
                ddtwist[j] = kept / drive.inertia - SVector::from(drive.lever::<N>(j)).dot(ddq);
            }
        }
        ddtwist
    }

    /// By how much the flank of joint `j`'s closed play would have to pull; positive where it opens. None for other joints.
    #[inline]
    pub(crate) fn pull(&self, j: usize, tau: T, ddq: &SVector<T, N>, hidden: &Hidden<T, N>) -> Option<T> {
        let drive = self.get(j)?;
        let side = *hidden.side.get(j).filter(|side| **side != T::zero())?;
        Some((drive.inertia * SVector::from(drive.lever::<N>(j)).dot(ddq) - tau) * side)
    }

    /// Depth of joint `j`'s rotor behind the nearer flank of its open play. None for other joints.
    #[inline]
    pub(crate) fn depth(&self, j: usize, hidden: &Hidden<T, N>) -> Option<T> {
        let drive = self.get(j).filter(|d| d.gap > T::zero())?;
        let open = *hidden.side.get(j)? == T::zero();
        open.then(|| hidden.twist[j].abs() - drive.half_gap())
    }

    /// Joint `j`'s rotor meets the flank it is at, in an arm with this inertia: the velocities and the twists' rates change at once.
    pub(crate) fn meet(
        &self,
        j: usize,
        inertia: &Inertia<T, N>,
        dq: &mut SVector<T, N>,
        hidden: &mut Hidden<T, N>,
    ) {
        if j >= N {
            return;
        }
        let Some(drive) = &self.of[j] else { return };
        let side = if hidden.twist[j] < T::zero() { -T::one() } else { T::one() };
        let rate = hidden.dtwist[j];
        (hidden.side[j], hidden.twist[j]) = (side, side * drive.half_gap());
        let mut together = *inertia;
        self.close(&mut together, hidden);
        let gained = drive.lever::<N>(j).map(|part| part * drive.inertia * rate);
        let change = SVector::from(solve_positive_definite(together, gained));
        *dq += change;
        for k in 0..N {
            let Some(other) = &self.of[k] else { continue };
            if hidden.side[k] == T::zero() {
                hidden.dtwist[k] -= SVector::from(other.lever::<N>(k)).dot(&change);
            }
        }
        hidden.dtwist[j] = T::zero();
    }
}

/// Adds the inertia of a rotor that turns by `lever` per unit of the joints.
#[inline]
fn load<T: Real, const N: usize>(matrix: &mut Inertia<T, N>, inertia: T, lever: &[T; N]) {
    for (row, a) in matrix.iter_mut().zip(lever) {
        for (entry, b) in row.iter_mut().zip(lever) {
            *entry += inertia * *a * *b;
        }
    }
}
