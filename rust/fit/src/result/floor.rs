//! Noise floor of a gap: the error of a perfect model's predictions, which start from measured states and are compared with measured positions.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::weighting::Weighting;
use crate::log::track::InitialState;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::squares;
use crate::numeric::random::Random;
use crate::predict::window::{Dataset, InitialStateOffset, Window};
use armgap_core::arm::Arm;

/// Number of randomly displaced initial states per window from which the errors of a perfect model are estimated: six give the mean square of one
/// window to some 40 %, that of forty windows to 6 %.
const DISPLACED: usize = 6;

/// Cost per sample and joint up to which a window is consistent with its noise and its measured initial state: the noise is known to 3 %, and of some
/// hundred values the mean square scatters by 15 %.
const CONSISTENT: f64 = 1.5;

/// Least ratio of the squared errors of a window to what a fitted initial state leaves of them beyond noise, plus two standard deviations, for an
/// error of the initial state to explain the window. A missing torque that is constant over the window leaves 1/36 of the squared errors it makes
/// once the initial state is fitted, any other more; such a torque may make a quarter of the squared errors at most.
const TORQUE_SHARE: f64 = 4.0 * 36.0;

/// Share of the windows that errors of their initial states must explain for these windows to count as explained: where most are not explained, those
/// that seem to be are the ones in which the model errs least, and their errors are not errors of initial states. With 0.7 as many of 42 estimated
/// floors are right, with 0.9 one fewer.
const MAJORITY: f64 = 0.5;

/// Share of the squared errors of all windows, in units of the noise, in the windows that errors of their initial states explain, from which these
/// count as explained although they are few: there the largest errors are explained, not the smallest. With 0.5 as many estimated floors are right,
/// with 0.3 or 0.7 and no other rule than this share fewer or as many.
const MOST_OF_ERRORS: f64 = 0.7;

/// Mean square position error of a perfect model by joint, rad^2 or m^2: noise of the samples, and errors of the measured initial states carried
/// along the windows.
pub(crate) fn floor<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    data: &Dataset<N>,
    model: &Hypothesis<P>,
    predicted: &[f64],
    seed: u64,
) -> [f64; N] {
    let measured = data.measured();
    let missed = window_squares(data, &measured, predicted);
    let mut expected = carried(context, data, model, predicted, seed);
    for square in &mut expected {
        square.iter_mut().zip(context.noise).for_each(|(s, noise)| *s += noise.powi(2));
    }
    let weighting = Weighting::new(data, &context.arm, model, context.noise, data.zero_offsets(), predicted);
    let residual = weighting.residual(&measured, predicted);
    let costs = weighting.costs(data, &residual);
    let left = weighting.beside_free_states(data, &residual);
    let square: Vec<f64> = data.windows.iter().map(|w| squares(&[&residual[w.range()]])[0]).collect();
    let is_explained = |i: usize| explained(data.windows[i].rows() * N, square[i], costs[i], left[i]);
    let explained = trusted((0..data.windows.len()).map(is_explained).collect(), &square);
    std::array::from_fn(|j| {
        let of = |table: &[[f64; N]]| -> Vec<f64> { table.iter().map(|square| square[j]).collect() };
        perfect_error(&of(&missed), &of(&expected), &explained)
    })
}

/// Whether noise and a displaced initial state explain a model's error in a window of `values` values: the displacement is within the covariance of
/// the measured state (`cost`), or leaves so little of the squared errors (`left` of `square`, in units of the noise) that no torque can have made
/// them.
fn explained(values: usize, square: f64, cost: f64, left: f64) -> bool {
    let values = values as f64;
    let beyond_noise = left - values + 2.0 * (2.0 * values).sqrt();
    cost < CONSISTENT * values || TORQUE_SHARE * beyond_noise < square
}

/// The windows that are `explained` by errors of their initial states; none unless these are most of the windows, or hold most of the squared errors
/// (`square`, by window).
fn trusted(explained: Vec<bool>, square: &[f64]) -> Vec<bool> {
    let count = explained.iter().filter(|e| **e).count() as f64;
    let held: f64 = square.iter().zip(&explained).filter(|(_, e)| **e).map(|(square, _)| square).sum();
    let are_most = count >= MAJORITY * explained.len() as f64;
    if are_most || held >= MOST_OF_ERRORS * square.iter().sum::<f64>() {
        return explained;
    }
    vec![false; explained.len()]
}

/// Mean square error of a perfect model, from the mean square error of a model by window (`missed`) and the mean square error by window that noise
/// and the covariance of initial states predict (`expected`).
///
/// In a window `explained` by noise and its initial state a perfect model errs as the model does. In any other it errs by what is expected, times the
/// ratio of missed to expected in explained windows, and by no more than the model.
fn perfect_error(missed: &[f64], expected: &[f64], explained: &[bool]) -> f64 {
    let of_explained = |of: &[f64]| (0..of.len()).filter(|&i| explained[i]).map(|i| of[i]).sum::<f64>();
    // Without any explained window the ratio is not a number (0/0), and `max` then gives one.
    let beyond = (of_explained(missed) / of_explained(expected)).max(1.0);
    let square = |i: usize| if explained[i] { missed[i] } else { missed[i].min(beyond * expected[i]) };
    (0..missed.len()).map(square).sum::<f64>() / missed.len() as f64
}

/// Mean square change of the predictions when initial states are displaced at random within their covariance, by window and joint, rad^2 or m^2.
fn carried<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    data: &Dataset<N>,
    model: &Hypothesis<P>,
    predicted: &[f64],
    seed: u64,
) -> Vec<[f64; N]> {
    let mut random = Random(seed);
    let mut sum = vec![[0.0; N]; data.windows.len()];
    for _ in 0..DISPLACED {
        let offsets: Vec<InitialStateOffset<N>> =
            data.windows.iter().map(|w| displaced(&w.initial_state, &mut random)).collect();
        let there = data.predict(&context.arm, model, &offsets);
        for (total, square) in sum.iter_mut().zip(window_squares(data, predicted, &there)) {
            for j in 0..N {
                total[j] += square[j] / DISPLACED as f64;
            }
        }
    }
    sum
}

/// Random error of a measured initial state, drawn from its covariance and bias.
fn displaced<const N: usize>(state: &InitialState<N>, random: &mut Random) -> InitialStateOffset<N> {
    let mut offset = InitialStateOffset::none();
    for j in 0..N {
        let [vq, cov, vdq] = state.covariance[j];
        let [bias_q, bias_dq] = state.mean_square[j];
        let (a, b) = (random.normal(), random.normal());
        let given_q = (vdq - cov * cov / vq).max(0.0).sqrt();
        offset.q[j] = (bias_q * vq).sqrt() * a;
        offset.dq[j] = bias_dq.sqrt() * (cov / vq.sqrt() * a + given_q * b);
    }
    offset
}

/// Mean square difference of two position series by window and joint, rad^2 or m^2.
fn window_squares<const N: usize>(data: &Dataset<N>, one: &[f64], other: &[f64]) -> Vec<[f64; N]> {
    let of = |window: &Window<N>| -> [f64; N] {
        let mut sum = [0.0; N];
        for (a, b) in one[window.range()].chunks_exact(N).zip(other[window.range()].chunks_exact(N)) {
            for (total, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
                *total += (a - b).powi(2);
            }
        }
        sum.map(|x| x / window.rows() as f64)
    };
    data.windows.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_explained_by_a_start_within_its_covariance_or_one_that_leaves_next_to_nothing() {
        assert!(explained(100, 1e6, 120.0, 90.0), "within the covariance");
        assert!(!explained(100, 1e6, 1e5, 1e5), "neither");
        assert!(
            explained(100, 1e6, 4e5, 300.0),
            "no torque leaves so little, several times the noise though it is"
        );
        assert!(!explained(100, 1e4, 5e3, 300.0), "a torque may have left as much");
    }

    #[test]
    fn the_floor_of_a_right_model_is_what_it_misses_by() {
        let (missed, expected) = ([4.0, 9.0, 1.0, 100.0], [1.0, 3.0, 1.0, 2.0]);
        let floor = perfect_error(&missed, &expected, &[true, true, true, false]);
        // In explained windows the square error is 14/5 of what is expected, and so it would be in the fourth.
        assert!((floor - (14.0 + 2.0 * 2.8) / 4.0).abs() < 1e-12, "{floor}");
    }

    #[test]
    fn explained_windows_count_where_they_are_most_or_hold_most_of_the_error() {
        let few = vec![true, false, false, false];
        assert!(!trusted(few.clone(), &[4.0, 90.0, 1.0, 100.0])[0], "the ones with small errors");
        assert!(trusted(few, &[900.0, 90.0, 1.0, 100.0])[0], "the one with the large error");
        assert!(trusted(vec![true, true, false, false], &[1.0, 1.0, 90.0, 100.0])[0], "half of them");
    }

    #[test]
    fn where_no_window_is_explained_the_floor_is_what_initial_states_make() {
        let (missed, expected) = ([4.0, 90.0, 1.0, 100.0], [1.0, 3.0, 2.0, 2.0]);
        let floor = perfect_error(&missed, &expected, &[false; 4]);
        assert!((floor - (1.0 + 3.0 + 1.0 + 2.0) / 4.0).abs() < 1e-12, "{floor}");
    }
}
