//! Weighting of residuals, with each window's initial state projected out.
//!
//! The initial state of a window is measured, with noise. Its error is a nuisance with a prior; to first order it is projected out: with
//! `X` the sensitivity of the window's prediction to its initial state and `L L'` the precision of the measured initial state,
//!
//! ```text
//! cost(r) = min over d of |W^(1/2) (r - X d)|^2 + |L' (c + d)|^2 = |a|^2 - |Q' a|^2,     a = [W^(1/2) r; -L' c],
//! ```
//!
//! where `Q` is an orthonormal basis of `[W^(1/2) X; L']` and `c` the offset of the initial state that the prediction already has (variable
//! projection, Golub and Pereyra 1973).

use crate::likelihood::encoder_zero::EncoderZeros;
use crate::log::track::InitialState;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::{cross, lower_rows, squares};
use crate::predict::log_inputs::LogInputs;
use crate::predict::window::{Dataset, InitialStateOffset};
use armgap_core::arm::Arm;
use nalgebra::{DMatrix, DVector, SVector};
use rayon::prelude::*;

/// Factor on the standard deviations of a measured initial state.
const INITIAL_STATE_INFLATION: f64 = 2.0;

/// Largest factor on the standard deviation of a measured initial state. The standard deviation is raised to the offset of the initial state that the
/// fit required, because a local cubic errs by more than its covariance says where the acceleration jumps.
const LARGEST_INFLATION: f64 = 20.0;

/// Parameter of the robust weight `(1 + TAIL) / (TAIL + c)` of a window, with `c` the window's cost relative to the median cost: about one half where
/// `c` is of the size of `TAIL`.
const TAIL: f64 = 3.0;

/// Displacement of an initial position, rad or m, or velocity, rad/s or m/s, for derivatives by forward differences.
const INITIAL_STATE_STEP: f64 = 1e-6;

/// Projection of one window's residual that removes, to first order, what errors of the initial state contribute.
#[derive(Debug, Clone)]
struct Projection {
    /// Rows of the orthonormal basis `Q` that belong to samples.
    samples: DMatrix<f64>,
    /// Rows of the orthonormal basis `Q` that belong to the prior of the initial state.
    prior: DMatrix<f64>,
    /// Residual of the initial state's prior, `-L' c`, with `c` the present offset and `L L'` the precision of the measured state.
    prior_residual: DVector<f64>,
    /// Matrix `R^-1` of the `Q R` factorisation: correction of the initial state from coordinates in the basis `Q`.
    back: DMatrix<f64>,
}

impl Projection {
    /// Columns of the sample rows of the orthonormal basis `Q`.
    fn basis(&self) -> Vec<&[f64]> {
        self.samples.as_slice().chunks_exact(self.samples.nrows()).collect()
    }

    /// Contribution of the initial state's prior to the residual's coordinates in the basis `Q`.
    fn prior_coordinates(&self) -> DVector<f64> {
        self.prior.tr_mul(&self.prior_residual)
    }

    /// Cost of a window's whitened residual after projection of its initial state.
    fn cost(&self, residual: &[f64]) -> f64 {
        let along = cross(&[residual], &self.basis());
        let coordinates =
            along.iter().zip(&self.prior_coordinates()).map(|(x, p)| (x + p).powi(2)).sum::<f64>();
        (squares(&[residual])[0] + self.prior_residual.norm_squared() - coordinates).max(0.0)
    }

    /// Inner products of all columns and last the residual in one window, with its initial state projected out, and the coordinates of each in the
    /// basis `Q`; those of the first columns are taken over from `known`.
    fn gram(&self, known: Option<&WindowGram>, columns: &[&[f64]], residual: &[f64]) -> WindowGram {
        let all: Vec<&[f64]> = columns.iter().copied().chain([residual]).collect();
        let (size, basis) = (all.len(), self.basis());
        let count = known.map_or(0, |known| known.count);
        let old = known.map_or(&[][..], |known| &known.products);
        let mut coordinates = Vec::with_capacity(size * basis.len());
        coordinates.extend(known.iter().flat_map(|known| &known.coordinates).take(count * basis.len()));
        coordinates.extend(cross(&all[count..], &basis));
        let at = |c: usize| c * basis.len()..(c + 1) * basis.len();
        for (coordinate, prior) in coordinates[at(size - 1)].iter_mut().zip(&self.prior_coordinates()) {
            *coordinate += prior;
        }
        let mut products = vec![0.0; size * size];
        for i in 0..count {
            products[i * size..i * size + count].copy_from_slice(&old[i * (count + 1)..][..count]);
        }
        let along = |a: usize, b: usize| -> f64 {
            coordinates[at(a)].iter().zip(&coordinates[at(b)]).map(|(a, b)| a * b).sum()
        };
        let mut rows = lower_rows(&all, count).into_iter();
        for i in count..size {
            for (c, product) in rows.by_ref().take(i + 1).enumerate() {
                let product = product - along(i, c);
                products[i * size + c] = product;
                products[c * size + i] = product;
            }
        }
        products[size * size - 1] += self.prior_residual.norm_squared();
        WindowGram { count: size - 1, products, coordinates }
    }

    /// Inner products in one window, with its initial state projected out: of each of the first `lead` columns, and last the residual, with all
    /// columns and last the residual, row by row; then the squared lengths of the columns after the first `lead`.
    fn products(&self, lead: usize, columns: &[&[f64]], residual: &[f64]) -> Vec<f64> {
        let all: Vec<&[f64]> = columns.iter().copied().chain([residual]).collect();
        let (k, basis) = (columns.len(), self.basis());
        let mut coordinates = cross(&all, &basis);
        let at = |c: usize| c * basis.len()..(c + 1) * basis.len();
        for (coordinate, prior_coordinates) in coordinates[at(k)].iter_mut().zip(&self.prior_coordinates()) {
            *coordinate += prior_coordinates;
        }
        let leading: Vec<&[f64]> = columns[..lead].iter().copied().chain([residual]).collect();
        let mut products = cross(&leading, &all);
        products.extend(squares(&columns[lead..]));
        let along = |a: usize, b: usize| -> f64 {
            coordinates[at(a)].iter().zip(&coordinates[at(b)]).map(|(a, b)| a * b).sum()
        };
        let (rows, rest) = products.split_at_mut((lead + 1) * (k + 1));
        for (i, row) in rows.chunks_exact_mut(k + 1).enumerate() {
            for (c, product) in row.iter_mut().enumerate() {
                *product -= along(if i < lead { i } else { k }, c);
            }
        }
        for (c, square) in rest.iter_mut().enumerate() {
            *square -= along(lead + c, lead + c);
        }
        rows[lead * (k + 1) + k] += self.prior_residual.norm_squared();
        products
    }
}

/// Weighting of a dataset's residuals: scales, robust weights and projections of initial states.
#[derive(Debug, Clone)]
pub struct Weighting<const N: usize> {
    /// Standard deviation of each joint's residual, rad or m, by which residuals are divided.
    pub scale: [f64; N],
    /// Offset of each window's initial state from the measured state; predictions are made from the displaced state.
    pub offsets: Vec<InitialStateOffset<N>>,
    /// Encoder zeros of the recordings with which the predictions are made.
    pub zeros: EncoderZeros<N>,
    /// Robust weight of each window: one where the window's cost is the median cost, towards zero far beyond, at most 4/3.
    pub robust_weight: Vec<f64>,
    /// Median cost of a window under the hypothesis for which the weighting was made.
    pub typical: f64,
    projections: Vec<Projection>,
}

/// Inner products of `count` columns, and last the residual, in one window with its initial state projected out.
#[derive(Debug, Clone, Default)]
struct WindowGram {
    /// Number of columns, without the residual.
    count: usize,
    /// Matrix of inner products, row by row.
    products: Vec<f64>,
    /// Coordinates of every column and last of the residual in the window's basis `Q`, one after another.
    coordinates: Vec<f64>,
}

/// Inner products of whitened Jacobian columns, and last the whitened residual, with initial states projected out and windows weighted robustly.
#[derive(Debug, Clone, Default)]
pub struct Gram {
    /// Matrix of inner products, summed over windows.
    pub total: DMatrix<f64>,
    /// Inner products of every column with the residual, per window.
    pub scores: Vec<DVector<f64>>,
    /// Inner products of all columns per window, without robust weights; empty if not all were computed.
    windows: Vec<WindowGram>,
    robust_weight: Vec<f64>,
}

impl Gram {
    /// Sums of the inner products of `k` columns and, last, the residual, given per window.
    #[cfg(test)]
    pub fn of(products: Vec<Vec<f64>>, k: usize) -> Self {
        let windows = products.iter().map(|p| DMatrix::from_row_slice(k + 1, k + 1, p));
        let total = windows.fold(DMatrix::zeros(k + 1, k + 1), |sum, window| sum + window);
        let scores = products.iter().map(|p| DVector::from_column_slice(&p[k * (k + 1)..])).collect();
        let robust_weight = vec![1.0; products.len()];
        let window = |products| WindowGram { count: k, products, coordinates: Vec::new() };
        Self { total, scores, windows: products.into_iter().map(window).collect(), robust_weight }
    }

    /// Inner products in one window of the columns with indices `of`, column `of[a]` multiplied by `unit[a]`, times the window's robust weight;
    /// requires the products of all columns.
    pub fn within(&self, window: usize, of: &[usize], unit: &[f64]) -> DMatrix<f64> {
        let columns = self.total.nrows();
        let (products, robust_weight) = (&self.windows[window].products, self.robust_weight[window]);
        let entry =
            |a: usize, b: usize| products[of[a] * columns + of[b]] * unit[a] * unit[b] * robust_weight;
        DMatrix::from_fn(of.len(), of.len(), entry)
    }
}

impl<const N: usize> Weighting<N> {
    /// Weighting of residuals with initial states projected out to first order around the predictions `predicted` of a hypothesis, from initial
    /// states displaced by `offsets`; `scale` is the standard deviation of each joint's residual, rad or m.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        data: &Dataset<N>,
        arm: &A,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        offsets: Vec<InitialStateOffset<N>>,
        predicted: &[f64],
    ) -> Self {
        let inputs = data.log_inputs(arm, hypothesis);
        let sensitivities =
            initial_state_sensitivities(data, arm, hypothesis, &offsets, predicted, inputs.as_ref());
        Self::from_sensitivities(data, &sensitivities, scale, offsets)
    }

    /// Weighting, with all robust weights one, from the derivatives `sensitivities` of the predictions by initial positions and velocities.
    pub fn from_sensitivities(
        data: &Dataset<N>,
        sensitivities: &[Vec<f64>],
        scale: [f64; N],
        offsets: Vec<InitialStateOffset<N>>,
    ) -> Self {
        let project = |(index, shift): (usize, &InitialStateOffset<N>)| {
            let window = &data.windows[index];
            let columns: Vec<&[f64]> = sensitivities.iter().map(|c| &c[window.range()]).collect();
            projection(&columns, &scale, &window.initial_state, shift)
        };
        let projections = offsets.par_iter().enumerate().map(project).collect();
        let robust_weight = vec![1.0; offsets.len()];
        Self { scale, offsets, zeros: EncoderZeros::none(), robust_weight, typical: 1.0, projections }
    }

    /// Whitened derivatives of the predicted encoder positions by the encoder zeros, from the derivatives `sensitivities` by initial positions and
    /// velocities: a zero displaces the initial position by its negative, and then all predicted encoder positions by itself.
    pub fn zero_columns(&self, sensitivities: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let column = |j: usize| {
            let mut column: Vec<f64> = sensitivities[j].iter().map(|s| -s).collect();
            column.iter_mut().skip(j).step_by(N).for_each(|value| *value += 1.0);
            self.whiten(&mut column);
            column
        };
        (0..N).map(column).collect()
    }

    /// The weighting with the encoder zeros `zeros`, with which its predictions were made.
    pub fn with_zeros(self, zeros: EncoderZeros<N>) -> Self {
        Self { zeros, ..self }
    }

    /// The weighting with robust weights of the windows, from their costs for the whitened residual `residual`.
    pub fn robust(mut self, data: &Dataset<N>, residual: &[f64]) -> Self {
        let costs = self.costs(data, residual);
        self.typical = crate::log::track::median(costs.clone()).max(f64::MIN_POSITIVE);
        self.robust_weight = costs.iter().map(|cost| (1.0 + TAIL) / (TAIL + cost / self.typical)).collect();
        self
    }

    /// Student-t cost of a window with the cost `cost` without robust weight: negative log-likelihood of a multivariate Student variable, linear for
    /// typical windows and logarithmic far beyond.
    pub fn student_t_cost(&self, cost: f64) -> f64 {
        self.typical * (1.0 + TAIL) * (cost / (TAIL * self.typical)).ln_1p()
    }

    /// Sum of the windows' costs, each times its robust weight.
    pub fn total(&self, costs: &[f64]) -> f64 {
        costs.iter().zip(&self.robust_weight).map(|(cost, robust_weight)| cost * robust_weight).sum()
    }

    /// Whitened residual, measured minus predicted positions in units of the joints' scales, by window, sample and joint.
    pub fn residual(&self, measured: &[f64], predicted: &[f64]) -> Vec<f64> {
        let mut residual: Vec<f64> = measured.iter().zip(predicted).map(|(y, p)| y - p).collect();
        self.whiten(&mut residual);
        residual
    }

    /// Divides the entries of a column (by window, sample and joint) by the joints' scales.
    pub fn whiten(&self, column: &mut [f64]) {
        for row in column.chunks_exact_mut(N) {
            for (value, scale) in row.iter_mut().zip(self.scale) {
                *value /= scale;
            }
        }
    }

    /// Inner products of whitened `columns` and, last, a whitened `residual`, with initial states projected out.
    pub fn gram(&self, data: &Dataset<N>, columns: &[&[f64]], residual: &[f64]) -> Gram {
        self.gram_beyond(&Gram::default(), data, columns, residual)
    }

    /// Inner products of whitened `columns` and, last, a whitened `residual`, with initial states projected out; those of the first columns are taken
    /// over from `known`, where they were computed under this weighting.
    pub fn gram_beyond(&self, known: &Gram, data: &Dataset<N>, columns: &[&[f64]], residual: &[f64]) -> Gram {
        let k = columns.len();
        let one = |(index, projection): (usize, &Projection)| {
            let range = data.windows[index].range();
            let part: Vec<&[f64]> = columns.iter().map(|c| &c[range.clone()]).collect();
            projection.gram(known.windows.get(index), &part, &residual[range])
        };
        let windows: Vec<WindowGram> = self.projections.par_iter().enumerate().map(one).collect();
        let mut total = DMatrix::zeros(k + 1, k + 1);
        let mut scores = Vec::with_capacity(windows.len());
        for (window, robust_weight) in windows.iter().zip(&self.robust_weight) {
            for (sum, product) in total.iter_mut().zip(&window.products) {
                *sum += product * robust_weight;
            }
            scores.push(DVector::from_column_slice(&window.products[k * (k + 1)..]) * *robust_weight);
        }
        Gram { total, scores, windows, robust_weight: self.robust_weight.clone() }
    }

    /// Inner products of whitened `columns` and, last, a whitened `residual`; products of two different columns after the first `lead` stay zero.
    pub fn gram_with(&self, lead: usize, data: &Dataset<N>, columns: &[&[f64]], residual: &[f64]) -> Gram {
        let k = columns.len();
        let one = |(window, projection): (&crate::predict::window::Window<N>, &Projection)| {
            let part: Vec<&[f64]> = columns.iter().map(|c| &c[window.range()]).collect();
            projection.products(lead, &part, &residual[window.range()])
        };
        let windows: Vec<Vec<f64>> = data.windows.par_iter().zip(&self.projections).map(one).collect();
        let mut total = DMatrix::zeros(k + 1, k + 1);
        let mut scores = Vec::with_capacity(windows.len());
        for (products, robust_weight) in windows.iter().zip(&self.robust_weight) {
            let (rows, squares) = products.split_at((lead + 1) * (k + 1));
            for (i, row) in rows.chunks_exact(k + 1).enumerate() {
                for (c, product) in row.iter().enumerate() {
                    total[(c, if i < lead { i } else { k })] += product * robust_weight;
                }
            }
            for (c, square) in squares.iter().enumerate() {
                total[(lead + c, lead + c)] += square * robust_weight;
            }
            scores.push(DVector::from_column_slice(&rows[lead * (k + 1)..]) * *robust_weight);
        }
        for i in (0..lead).chain([k]) {
            for c in 0..=k {
                total[(i, c)] = total[(c, i)];
            }
        }
        Gram { total, scores, windows: Vec::new(), robust_weight: self.robust_weight.clone() }
    }

    /// Cost of every window for a whitened residual, without robust weights.
    pub fn costs(&self, data: &Dataset<N>, residual: &[f64]) -> Vec<f64> {
        let windows = data.windows.iter().zip(&self.projections);
        windows.map(|(window, projection)| projection.cost(&residual[window.range()])).collect()
    }

    /// Squared residual of every window that remains after a fit of its initial state without prior.
    pub fn beside_free_states(&self, data: &Dataset<N>, residual: &[f64]) -> Vec<f64> {
        let windows = data.windows.iter().zip(&self.projections);
        windows
            .map(|(window, projection)| {
                let r = DVector::from_column_slice(&residual[window.range()]);
                let basis = projection.samples.clone().qr().q();
                (r.norm_squared() - basis.tr_mul(&r).norm_squared()).max(0.0)
            })
            .collect()
    }

    /// Whitened residual that remains after the fit of the initial states, by window, sample and joint.
    pub fn remainder(&self, data: &Dataset<N>, residual: &[f64]) -> Vec<f64> {
        let mut left = residual.to_vec();
        for (window, projection) in data.windows.iter().zip(&self.projections) {
            let r = DVector::from_column_slice(&residual[window.range()]);
            let coordinates =
                projection.samples.tr_mul(&r) + projection.prior.tr_mul(&projection.prior_residual);
            let fitted = &projection.samples * coordinates;
            for (value, part) in left[window.range()].iter_mut().zip(fitted.iter()) {
                *value -= part;
            }
        }
        left
    }

    /// Offsets of all initial states, from the measured states, that minimise the cost of a whitened residual.
    pub fn refit_initial_states(&self, data: &Dataset<N>, residual: &[f64]) -> Vec<InitialStateOffset<N>> {
        let windows = data.windows.iter().zip(&self.projections).zip(&self.offsets);
        windows
            .map(|((window, projection), shift)| {
                let r = DVector::from_column_slice(&residual[window.range()]);
                let coordinates =
                    projection.samples.tr_mul(&r) + projection.prior.tr_mul(&projection.prior_residual);
                let change = &projection.back * coordinates;
                InitialStateOffset {
                    q: shift.q + SVector::from_fn(|j, _| change[j]),
                    dq: shift.dq + SVector::from_fn(|j, _| change[N + j]),
                    zero: shift.zero,
                }
            })
            .collect()
    }
}

/// Derivatives of all predictions by initial positions and velocities, around the initial states displaced by `offsets`; `inputs` are those of the
/// logs under the hypothesis.
pub fn initial_state_sensitivities<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    data: &Dataset<N>,
    arm: &A,
    hypothesis: &Hypothesis<P>,
    offsets: &[InitialStateOffset<N>],
    predicted: &[f64],
    inputs: Option<&LogInputs<N>>,
) -> Vec<Vec<f64>> {
    (0..2 * N)
        .into_par_iter()
        .map(|i| {
            let displaced: Vec<InitialStateOffset<N>> = offsets
                .iter()
                .map(|shift| {
                    let mut moved = *shift;
                    if i < N {
                        moved.q[i] += INITIAL_STATE_STEP;
                    } else {
                        moved.dq[i - N] += INITIAL_STATE_STEP;
                    }
                    moved
                })
                .collect();
            let (moved, _) = data.predict_beside(arm, hypothesis, &displaced, inputs);
            moved
                .iter()
                .zip(predicted)
                .map(|(a, b)| ((a - b) / INITIAL_STATE_STEP).clamp(-1e4, 1e4))
                .collect()
        })
        .collect()
}

/// Projection of one window's residual, from its sensitivities `columns` to the initial state, the joints' scales and the covariance of the measured
/// state.
fn projection<const N: usize>(
    columns: &[&[f64]],
    scale: &[f64; N],
    start: &InitialState<N>,
    shift: &InitialStateOffset<N>,
) -> Projection {
    let rows = columns[0].len();
    let mut stacked = DMatrix::zeros(rows + 2 * N, 2 * N);
    for (c, column) in columns.iter().enumerate() {
        for (r, value) in column.iter().enumerate() {
            stacked[(r, c)] = value / scale[r % N];
        }
    }
    let root = initial_state_precision_root(start, shift);
    stacked.view_mut((rows, 0), (2 * N, 2 * N)).copy_from(&root);
    let displacement = DVector::from_fn(2 * N, |i, _| if i < N { shift.q[i] } else { shift.dq[i - N] });
    let prior_residual = -(&root * displacement);
    let qr = stacked.qr();
    let q = qr.q();
    let back = qr.r().try_inverse().unwrap_or_else(|| DMatrix::zeros(2 * N, 2 * N));
    Projection {
        samples: q.rows(0, rows).into_owned(),
        prior: q.rows(rows, 2 * N).into_owned(),
        prior_residual,
        back,
    }
}

/// Matrix `L'`, with `L L'` the precision of a measured initial state; positions first, then velocities.
fn initial_state_precision_root<const N: usize>(
    start: &InitialState<N>,
    shift: &InitialStateOffset<N>,
) -> DMatrix<f64> {
    let mut root = DMatrix::zeros(2 * N, 2 * N);
    for (j, &[vq, cov, vdq]) in start.covariance.iter().enumerate() {
        let needed = (shift.dq[j].powi(2) / vdq).min(LARGEST_INFLATION.powi(2));
        let inflation = INITIAL_STATE_INFLATION.powi(2) + needed;
        let (vq, cov, vdq) = (vq * inflation, cov * inflation, vdq * inflation);
        // Cholesky of the inverse of [[vq, cov], [cov, vdq]].
        let given_q = (vdq - cov * cov / vq).max(1e-300);
        root[(j, j)] = 1.0 / vq.sqrt();
        root[(N + j, j)] = -cov / vq / given_q.sqrt();
        root[(N + j, N + j)] = 1.0 / given_q.sqrt();
    }
    root
}
