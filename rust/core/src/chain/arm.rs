//! Implementation of [`Arm`] for a chain, with ten inertial parameters of each link, rotor inertias, viscous and Coulomb friction.
//!
//! `theta` has 13 entries per joint: the ten inertial parameters of each link, link by link ([`LinkInertia`]), then one rotor inertia per
//! joint (kg m^2 at the joint, on the diagonal of the inertia matrix), then viscous, then Coulomb coefficients. Names and units are those
//! of [`super::parameter`].

use super::inertia::{LINK_PARAMETERS, LinkInertia, point_mass};
use super::parameters::PARAMETERS_PER_JOINT;
use super::{Chain, vector};
use crate::arm::{Arm, EquationTerms, Parameter};
use crate::cpu::{Cpu, Portable};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::SinCos;
use nalgebra::{SMatrix, SVector};

/// The ten inertial parameters of every link, from `theta`; `None` if `theta` is too short, which [`check`] rules out.
#[inline(always)]
fn links_of<V, const N: usize, const P: usize>(theta: &[V; P]) -> Option<&[LinkInertia<V>; N]> {
    theta.as_chunks().0.first_chunk()
}

/// Index in `theta` of the rotor inertia of the first joint, for a chain of `joints` joints.
const fn first_rotor(joints: usize) -> usize {
    LINK_PARAMETERS * joints
}

/// Compile-time check that `P` is 13 parameters for each of `N` joints.
#[inline(always)]
const fn check<const N: usize, const P: usize>() {
    const { assert!(P == PARAMETERS_PER_JOINT * N, "a chain has 13 parameters per joint") }
}

/// Writes `row`, over the ten parameters of link `k`, into row `i` of the regressor `matrix`.
#[inline(always)]
fn put<T: Real, const N: usize, const P: usize>(
    matrix: &mut SMatrix<T, N, P>,
    i: usize,
    k: usize,
    row: &LinkInertia<T>,
) {
    for (c, value) in row.iter().enumerate() {
        if let Some(entry) = matrix.get_mut((i, LINK_PARAMETERS * k + c)) {
            *entry = *value;
        }
    }
}

/// Writes `of[j]`, for every joint `j`, into the column of that joint's rotor inertia in the regressor `matrix`.
#[inline(always)]
fn put_rotors<T: Real, const N: usize, const P: usize>(matrix: &mut SMatrix<T, N, P>, of: &SVector<T, N>) {
    for j in 0..N {
        if let Some(entry) = matrix.get_mut((j, first_rotor(N) + j)) {
            *entry = of[j];
        }
    }
}

impl<T: Real, const N: usize> Chain<T, N> {
    /// [`Arm::equation_terms`] as a function that is not inlined: the integrator calls it in a dozen places.
    #[inline(never)]
    fn equation_terms_apart<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        constant_inertia: &[[V; N]; N],
        sincos: &[SinCos<V>; N],
        [q, dq]: [&[V; N]; 2],
    ) -> EquationTerms<V, N> {
        self.equation_terms_at(&self.poses_at(sincos, q), links, constant_inertia, dq)
    }

    /// `C(q, dq) dq`, N m (N): the bias without gravity.
    fn velocity_product<const P: usize>(
        &self,
        theta: &[T; P],
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
    ) -> SVector<T, N> {
        let weightless = Self { gravity: [T::zero(); 3], ..*self };
        links_of(theta).map_or_else(SVector::zeros, |links| {
            SVector::from(weightless.bias(links, &(*q).into(), &(*dq).into()))
        })
    }
}

impl<T: Real, const N: usize, const P: usize> Arm<T, N, P> for Chain<T, N> {
    const KIND: &'static str = "chain";
    /// Empty: names of a chain's parameters depend on the number of joints; see [`super::parameter`].
    const PARAMETERS: &'static [Parameter] = &[];
    /// False: the base of a chain is tilted by turning its gravity vector ([`Chain::with_gravity`]).
    const PLANAR: bool = false;

    fn inertia(&self, theta: &[T; P], q: &SVector<T, N>) -> SMatrix<T, N, N> {
        check::<N, P>();
        let Some(links) = links_of(theta) else { return SMatrix::zeros() };
        let (own, rotors) =
            (self.inertia_matrix(links, &(*q).into()), Arm::<T, N, P>::constant_inertia(self, theta));
        SMatrix::from_fn(|i, j| own[i][j] + rotors[i][j])
    }

    /// Coriolis matrix `C(q, dq)` of Christoffel symbols: column `j` is a quarter of `C(dq + e_j) (dq + e_j) - C(dq - e_j) (dq - e_j)`, `e_j` a unit
    /// vector.
    fn coriolis(&self, theta: &[T; P], q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, N> {
        let (mut matrix, quarter) = (SMatrix::<T, N, N>::zeros(), lit::<T>(0.25));
        for j in 0..N {
            let mut unit = SVector::zeros();
            unit[j] = T::one();
            let product = |x: SVector<T, N>| self.velocity_product(theta, q, &x);
            matrix.set_column(j, &((product(dq + unit) - product(dq - unit)) * quarter));
        }
        matrix
    }

    /// Gravity torque `g(q)`, N m (N); the tilt is ignored, as the base of a chain is tilted by its gravity vector.
    fn gravity(&self, theta: &[T; P], q: &SVector<T, N>, _tilt: T) -> SVector<T, N> {
        let still = [T::zero(); N];
        links_of(theta)
            .map_or_else(SVector::zeros, |links| SVector::from(self.bias(links, &(*q).into(), &still)))
    }

    #[inline(always)]
    fn angles<V: Number<Real = T>>(&self, q: &[V; N], _tilt: V) -> [V; N] {
        self.angles_of(q)
    }

    #[inline]
    fn constant_inertia(&self, theta: &[T; P]) -> [[T; N]; N] {
        let mut inertia = [[T::zero(); N]; N];
        for (j, rotor) in theta.iter().skip(first_rotor(N)).take(N).enumerate() {
            inertia[j][j] = *rotor;
        }
        inertia
    }

    #[inline(always)]
    fn equation_terms<V: Number<Real = T>>(
        &self,
        theta: &[V; P],
        constant_inertia: &[[V; N]; N],
        sincos: &[SinCos<V>; N],
        q: &[V; N],
        dq: &[V; N],
    ) -> EquationTerms<V, N> {
        check::<N, P>();
        match links_of(theta) {
            Some(links) if V::WIDTH == 1 => {
                self.equation_terms_apart(links, constant_inertia, sincos, [q, dq])
            }
            Some(links) => self.equation_terms_at(&self.poses_at(sincos, q), links, constant_inertia, dq),
            None => EquationTerms { inertia: *constant_inertia, bias: [vector::zero(); N] },
        }
    }

    fn energy_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, P> {
        let rows = self.links_energy_regressor(&(*q).into(), &(*dq).into());
        let rotors = dq.iter().map(|dq| lit::<T>(0.5) * *dq * *dq);
        let mut energy = SVector::<T, P>::zeros();
        for (entry, value) in energy.iter_mut().zip(rows.into_iter().flatten().chain(rotors)) {
            *entry = value;
        }
        energy
    }

    fn momentum_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, P> {
        self.momentum_and_potential::<Portable>(q, dq).0
    }

    fn potential_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, P> {
        self.momentum_and_potential::<Portable>(q, dq).1
    }

    fn momentum_and_potential<C: Cpu>(
        &self,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
    ) -> (SMatrix<T, N, P>, SMatrix<T, N, P>) {
        let (mut momentum, mut potential) = (SMatrix::zeros(), SMatrix::zeros());
        self.momentum_regressors(&(*q).into(), &(*dq).into(), |i, k, own, rest| {
            put(&mut momentum, i, k, &own);
            put(&mut potential, i, k, &rest);
        });
        put_rotors(&mut momentum, dq);
        (momentum, potential)
    }

    fn regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>, ddq: &SVector<T, N>) -> SMatrix<T, N, P> {
        let mut matrix = self.friction_regressor(dq);
        let motion = [&(*q).into(), &(*dq).into(), &(*ddq).into()];
        self.torque_regressor(motion, |i, k, row| put(&mut matrix, i, k, &row));
        put_rotors(&mut matrix, ddq);
        matrix
    }

    /// Change of `theta` by a point mass `mass`, kg, at `distance`, m, on the z axis of the last link's frame; for a point mass off the axis see
    /// [`point_mass`].
    fn payload(&self, _theta: &[T; P], mass: T, distance: T) -> [T; P] {
        let (mut delta, load) = ([T::zero(); P], point_mass(mass, [T::zero(), T::zero(), distance]));
        let last = delta.as_chunks_mut::<LINK_PARAMETERS>().0.get_mut(N.wrapping_sub(1));
        if let Some(last) = last {
            *last = load;
        }
        delta
    }
}
