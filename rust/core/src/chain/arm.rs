//! Implementation of [`Arm`] for a chain, with ten inertial parameters of each link, rotor inertias, viscous and Coulomb friction.
//!
//! `theta` has 13 entries per joint: the ten inertial parameters of each link, link by link ([`LinkInertia`]), then one rotor inertia per
//! joint (kg m^2 at the joint, on the diagonal of the inertia matrix), then viscous, then Coulomb coefficients. Names and units are those
//! of [`super::parameter`].

use super::inertia::{LINK_PARAMETERS, LinkInertia, point_mass};
use super::parameters::PARAMETERS_PER_JOINT;
use super::{Chain, vector};
use crate::arm::{Arm, EquationTerms, MomentumColumns, Parameter};
use crate::cpu::{Cpu, Portable};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::{SinCos, sines_cosines_of_many};
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

    /// [`Arm::momentum_columns`] with the joints in `W` lanes, at least `N`.
    #[inline(always)]
    fn momentum_columns_by<C: Cpu, const W: usize>(
        &self,
        q: &[T; N],
        dq: &[T; N],
        sink: &mut impl MomentumColumns<T, N>,
    ) {
        let sincos = sines_cosines_of_many::<C, T, N>(&self.angles_of(q));
        let mut units = [Lanes::<T, C, W>::of(T::zero()); N];
        for j in 0..N {
            if let Some(entry) = units[j].0.get_mut(j) {
                *entry = T::one();
            }
        }
        self.momentum_columns(&sincos, [q, dq], &units, |k, momentum, potential| {
            let (mut columns, mut others) =
                ([[T::zero(); N]; LINK_PARAMETERS], [[T::zero(); N]; LINK_PARAMETERS]);
            for c in 0..LINK_PARAMETERS {
                for i in 0..N.min(W) {
                    (columns[c][i], others[c][i]) = (momentum[c].0[i], potential[c].0[i]);
                }
            }
            sink.put(LINK_PARAMETERS * k, &columns, &others);
        });
        let (mut rotors, none) = ([[T::zero(); N]; N], [[T::zero(); N]; N]);
        for j in 0..N {
            rotors[j][j] = dq[j];
        }
        sink.put(first_rotor(N), &rotors, &none);
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
    const ROTORS_APART: bool = true;

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
        self.energy_regressor_on::<Portable>(q, dq)
    }

    #[inline(always)]
    fn energy_regressor_on<C: Cpu>(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, P> {
        check::<N, P>();
        let (q, dq) = (&q.data.0[0], &dq.data.0[0]);
        let sincos = sines_cosines_of_many::<C, T, N>(&self.angles_of(q));
        let mut energy = SVector::<T, P>::zeros();
        // One lane, whose products and sums are those of the processor `C`.
        let one = |x: T| Lanes::<T, C, 1>::of(x);
        let state = |j: usize| {
            let SinCos { sine, cosine } = sincos[j];
            (SinCos { sine: one(sine), cosine: one(cosine) }, one(q[j]), one(dq[j]))
        };
        self.link_energies(state, |k, row| {
            if let Some(entries) = energy.data.0[0].as_chunks_mut().0.get_mut(k) {
                *entries = row.map(|x| x.0[0]);
            }
        });
        for j in 0..N {
            if let Some(entry) = energy.data.0[0].get_mut(first_rotor(N) + j) {
                *entry = lit::<T>(0.5) * dq[j] * dq[j];
            }
        }
        energy
    }

    #[inline(always)]
    fn energy_regressors_on<C: Cpu>(&self, states: [[&SVector<T, N>; 2]; 2]) -> [SVector<T, P>; 2] {
        check::<N, P>();
        let [[qa, va], [qb, vb]] = states.map(|state| state.map(|x| &x.data.0[0]));
        let a = sines_cosines_of_many::<C, T, N>(&self.angles_of(qa));
        let b = sines_cosines_of_many::<C, T, N>(&self.angles_of(qb));
        let pair = |x: T, y: T| Lanes::<T, C, 2>::new([x, y]);
        let state = |j: usize| {
            let angle = SinCos { sine: pair(a[j].sine, b[j].sine), cosine: pair(a[j].cosine, b[j].cosine) };
            (angle, pair(qa[j], qb[j]), pair(va[j], vb[j]))
        };
        let mut energies = [SVector::<T, P>::zeros(); 2];
        self.link_energies(state, |k, row| {
            for l in 0..2 {
                if let Some(entries) = energies[l].data.0[0].as_chunks_mut().0.get_mut(k) {
                    *entries = row.map(|x| x.0[l]);
                }
            }
        });
        for (energy, dq) in energies.iter_mut().zip([va, vb]) {
            for j in 0..N {
                if let Some(entry) = energy.data.0[0].get_mut(first_rotor(N) + j) {
                    *entry = lit::<T>(0.5) * dq[j] * dq[j];
                }
            }
        }
        energies
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

    #[inline(always)]
    fn momentum_columns<C: Cpu>(
        &self,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
        sink: &mut impl MomentumColumns<T, N>,
    ) {
        check::<N, P>();
        if N <= 4 {
            self.momentum_columns_by::<C, 4>(&q.data.0[0], &dq.data.0[0], sink);
        } else if N <= 8 {
            self.momentum_columns_by::<C, 8>(&q.data.0[0], &dq.data.0[0], sink);
        } else {
            self.momentum_columns_by::<C, N>(&q.data.0[0], &dq.data.0[0], sink);
        }
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
