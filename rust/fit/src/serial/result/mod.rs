//! Result of a diagnosis of a serial arm as data, from the result of the model search.

pub(in crate::serial) mod cause_report;
pub(in crate::serial) mod controller_report;
pub(in crate::serial) mod notes;

use crate::locate::regimes::Location;
use crate::log::input::Options;
use crate::log::track::median;
use crate::numeric::products::rms;
use crate::numeric::random::Random;
use crate::predict::window::Dataset;
use crate::progress::{Phase, ProgressReporter};
use crate::result::gap::{HORIZONS, closed, free_run_series, limited, whole, window_series};
use crate::result::report::{
    ArmSummary, AtHorizon, Candidate, Cause, Diagnosis, FreeRun, FreeRunSeries, Gap, LogSummary, Named,
    Noise, OptionSummary, Parameters, TrainingErrors, Value,
};
use crate::result::training_gap::remark;
use crate::result::verdict::{Evidence, is_improved, stands_out};
use crate::serial::constants::{CONSEQUENTIAL_SERIAL_ERROR, ONLY_THERE};
use crate::serial::controller::PositionController;
use crate::serial::controller::closed_loop::ClosedLoop;
use crate::serial::predict::{Model, floor};
use crate::serial::pushes::Event;
use crate::serial::result::cause_report::{cause, pushes_of, ruled_out};
use crate::serial::result::controller_report::with_settings;
use crate::serial::result::notes::{notes, regularised, sanity, sanity_note};
use crate::serial::search::fitting::Fitted;
use crate::serial::search::{self, Found};
use crate::serial::term::Term;
use crate::serial::{SerialArm, Set};
use armgap_core::chain::Chain;

/// Reason why an elastic joint or backlash is not named where predictions have to confirm it.
const PREDICTS_NO_BETTER: &str = "the arm with it predicts the holdout no better than without it";

/// Reason why causes are not named beside which the arm predicts the holdout worse than the re-estimated arm.
const PREDICTS_WORSE: &str =
    "the arm with what was found predicts the holdout worse than the re-estimated arm does without it";

/// Note on predictions that are worse with the causes found than without, where causes have states that no log holds.
const HIDDEN_STATES: &str = "with the causes predictions miss more than without them: they start from deflections of the \
     elastic joint or backlash that are estimated, not measured, and may be wrong. The causes rest on the torques";

/// Number of bootstrap resamples of the holdout's windows for the confidence interval of the closed share.
const CLOSED_SHARE_RESAMPLES: usize = 500;

/// The three models that a report compares (arm file, re-estimated, with the named causes), and their predictions on the holdout.
struct Compared<const N: usize, const P: usize> {
    models: [Model<N, P>; 3],
    predicted: [Vec<f64>; 3],
    measured: Vec<f64>,
    floor: Vec<f64>,
}

/// Diagnosis of a serial arm as data, from the result `found` of the model search; `events` are the pushes in the logs, of which those of the holdout
/// count on from the training logs.
pub(crate) fn assemble<const N: usize, const P: usize>(
    description: &SerialArm,
    arm: &Chain<f64, N>,
    training: &Set<N, P>,
    holdout: &Set<N, P>,
    found: &Found,
    (options, widths, events): (&Options, &[f64], &[Event]),
    progress: &ProgressReporter,
) -> Diagnosis {
    progress.begin(Phase::Result, 6);
    let rotary = description.rotary();
    let commanded = holdout.equation.commanded.as_ref().map(|commanded| &commanded.controller);
    let mut models = models(description, arm, holdout, found);
    let noise: [f64; N] =
        std::array::from_fn(|j| median(training.data.tracks.iter().map(|t| t.noise[j]).collect()));
    let data = &holdout.data;
    let mut predicted = [0, 1, 2].map(|i| {
        progress.unit();
        predictions(&models, i, data)
    });
    let measured = data.measured();
    let floor: Vec<f64> = floor(data, &noise).iter().map(|v| v.sqrt()).collect();
    let missed = |i: usize| rms::<N>(&measured, &limited(&measured, &predicted[i]));
    // The way back, from these errors to those of the re-estimated arm, closes a part of the gap; the re-estimated arm itself may have none.
    let is_worse = |errors: &[f64]| {
        let refit = missed(1);
        closed(errors, &refit, &floor) > 0.0 && is_improved(errors, &refit, &floor)
    };
    let (worse, refit_missed) = (is_worse(&missed(2)), missed(1));
    // Deflections of elastic joints and backlash are not measured, so that predictions say little about these causes; they still judge the others.
    let (hidden, others): (Vec<Term>, Vec<Term>) =
        found.reported.terms.iter().cloned().partition(|term| !term.own_motors().is_empty());
    let beside = model_of(arm, holdout, &found.reported.estimate.theta, &others);
    let predicted_beside = if hidden.is_empty() { predicted[2].clone() } else { beside.predict(data) };
    let missed_beside = rms::<N>(&measured, &limited(&measured, &predicted_beside));
    let contradicted = worse && (hidden.is_empty() || !others.is_empty() && is_worse(&missed_beside));
    // Torques of position controllers contain the encoders' noise, which a shaft may seem to filter; there predictions have to confirm it.
    let unconfirmed = commanded.is_some()
        && !hidden.is_empty()
        && !is_improved(if others.is_empty() { &refit_missed } else { &missed_beside }, &missed(2), &floor);
    let (mut named, candidates) = causes(found, [contradicted, unconfirmed], &rotary, commanded);
    named.extend(pushes(events, [training, holdout], &rotary));
    let none_stays = contradicted || unconfirmed && others.is_empty();
    let reported = if none_stays { &found.refit_feasible } else { &found.reported };
    if none_stays {
        models[2] = models[1].clone();
        predicted[2] = models[2].predict(data);
    } else if unconfirmed {
        (models[2], predicted[2]) = (beside, predicted_beside);
    }
    let compared = Compared { models, predicted, measured, floor };
    let mut gap = gap(&compared, data, &rotary, options);
    let [_, refit, with_causes] = self::models(description, arm, training, found);
    let on_training = if none_stays { refit } else { with_causes };
    gap.training = (named.is_empty()
        && !stands_out(&gap.after, &gap.floor, &gap.motion, CONSEQUENTIAL_SERIAL_ERROR))
    .then(|| training_gap(&training.data, &on_training, &gap))
    .flatten();
    let evidence = Evidence {
        named: !named.is_empty(),
        open: false,
        in_training: gap.training.is_some(),
        before: &gap.before,
        refit: &gap.refit,
        after: &gap.after,
        floor: &gap.floor,
        motion: &gap.motion,
        consequence: CONSEQUENTIAL_SERIAL_ERROR,
    };
    let (verdict, remains) = (evidence.verdict(), evidence.remains());
    let parameters = |theta: &[f64], sigma: &[f64]| values(description, theta, sigma);
    let pushed = (commanded.is_none() && options.max_causes > 0).then(|| pushed_joints(events));
    let sanity = sanity(description, &reported.estimate.theta, &found.sigma[1]);
    let (free_run_series, free_run) = free_runs(&compared, data);
    let mut notes = notes(found, training, holdout, &rotary);
    notes.extend(regularised(widths));
    notes.extend(sanity_note(&sanity));
    notes.extend((worse && !contradicted && !unconfirmed).then(|| HIDDEN_STATES.to_owned()));
    notes.extend(gap.training.as_ref().map(|errors| remark(errors, &rotary)));
    Diagnosis {
        schema: "armgap.diagnosis/1",
        verdict,
        places: places(found, holdout),
        energy: Vec::new(),
        causes: named,
        candidates,
        ruled_out: ruled_out(found, &unexplained(&found.model, holdout), &rotary, pushed.as_deref()),
        parameters: Parameters {
            nominal: parameters(&description.theta, &description.sigma),
            refit: parameters(&found.refit.estimate.theta, &found.sigma[0]),
            with_causes: parameters(&reported.estimate.theta, &found.sigma[1]),
        },
        sanity,
        arm: summary(description),
        training: logs(&training.data),
        holdout: logs(data),
        ranking: Vec::new(),
        stages: Vec::new(),
        regimes: Vec::new(),
        unnamed: if remains { found.unnamed.clone() } else { Vec::new() },
        series: window_series(data, &compared.measured, compared.predicted.each_ref().map(Vec::as_slice)),
        free_run_series,
        noise: Noise {
            position_sigma: noise.to_vec(),
            encoder_step: training.data.tracks.first().map_or_else(Vec::new, |t| t.step.to_vec()),
        },
        options: options_summary(options, widths),
        version: env!("CARGO_PKG_VERSION"),
        seconds: 0.0,
        notes,
        gap: Gap { free_run, ..gap },
    }
}

/// Options of a diagnosis as results state them; `widths` by joint of regularised Coulomb friction, rad/s or m/s.
fn options_summary(options: &Options, widths: &[f64]) -> OptionSummary {
    OptionSummary {
        horizon_s: options.horizon,
        max_causes: options.max_causes,
        seed: options.seed,
        friction_smoothing: widths.iter().copied().fold(0.0, f64::max),
        friction_widths: widths.to_vec(),
    }
}

/// Terms of the final model as named causes, and as candidates with the reasons why they are not named; `contradicted` is whether predictions speak
/// against them, `unconfirmed` whether they do not speak for elastic joints and backlash where they have to.
fn causes(
    found: &Found,
    [contradicted, unconfirmed]: [bool; 2],
    rotary: &[bool],
    commanded: Option<&PositionController>,
) -> (Vec<Cause>, Vec<Candidate>) {
    let why_not = |n: &search::Named| {
        let against = if contradicted {
            Some(PREDICTS_WORSE)
        } else if unconfirmed && !n.term.own_motors().is_empty() {
            Some(PREDICTS_NO_BETTER)
        } else {
            None
        };
        n.unfit.clone().or_else(|| against.map(str::to_owned))
    };
    let (mut named, mut candidates) = (Vec::new(), Vec::new());
    for n in &found.named {
        let cause = cause(n, rotary, commanded);
        match why_not(n) {
            Some(why) => candidates.push(Candidate { cause, why }),
            None => named.push(cause),
        }
    }
    (named, candidates)
}

/// The three models that a report compares: with the arm file's parameters, with parameters re-estimated, and with the named terms; behind the
/// position controllers of the holdout, if there are any.
fn models<const N: usize, const P: usize>(
    description: &SerialArm,
    arm: &Chain<f64, N>,
    holdout: &Set<N, P>,
    found: &Found,
) -> [Model<N, P>; 3] {
    let of = |theta: &[f64], terms: &[Term]| model_of(arm, holdout, theta, terms);
    let mut nominal = description.theta.clone();
    nominal.resize(holdout.equation.rows.parameters, 0.0);
    let (refit, reported) = (&found.refit_feasible.estimate.theta, &found.reported);
    [of(&nominal, &[]), of(refit, &[]), of(&reported.estimate.theta, &reported.terms)]
}

/// A model of the arm with parameters `theta`, SI, and `terms`, behind the position controllers of the logs of `set`, if there are any.
fn model_of<const N: usize, const P: usize>(
    arm: &Chain<f64, N>,
    set: &Set<N, P>,
    theta: &[f64],
    terms: &[Term],
) -> Model<N, P> {
    let equation = &set.equation;
    let closed_loop = equation.commanded.as_ref().map(|commanded| ClosedLoop {
        joints: with_settings(commanded.controller.with_differences(&theta[P..]), terms),
        held_before: equation.held_before(theta, terms),
    });
    Model::new(arm, std::array::from_fn(|i| theta[i]), terms).behind(closed_loop)
}

/// Pushes of all events as causes, in logs of which those of the holdout count on from the training logs.
fn pushes<const N: usize, const P: usize>(
    events: &[Event],
    sets: [&Set<N, P>; 2],
    rotary: &[bool],
) -> Vec<Cause> {
    let tracks: Vec<_> = sets.into_iter().flat_map(|set| &set.data.tracks).collect();
    events.iter().flat_map(|event| pushes_of(event, &tracks[event.log].name, rotary)).collect()
}

/// Joints, from 1, that events act on.
fn pushed_joints(events: &[Event]) -> Vec<usize> {
    events.iter().flat_map(|event| event.heights.iter().map(|height| height.0 + 1)).collect()
}

/// Predictions of the model with index `i` of those that a report compares: only the one with the named causes knows of pushes.
fn predictions<const N: usize, const P: usize>(
    models: &[Model<N, P>; 3],
    i: usize,
    data: &Dataset<N>,
) -> Vec<f64> {
    if i == 2 { models[i].predict(data) } else { models[i].predict(&data.without_pushes()) }
}

/// Share of each joint, 0 to 1, in the squared torque that the re-estimated arm leaves unexplained on the holdout above the position noise, largest
/// first; each joint's unexplained squared torque is first divided by the joint's whole squared torque. A joint without torque has no share.
fn places<const N: usize, const P: usize>(found: &Found, holdout: &Set<N, P>) -> Vec<Location> {
    let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let rows = &holdout.equation.rows.joints;
    let none = vec![None; N];
    let residual = holdout.equation.rows.residual(&found.refit.estimate.theta, &none);
    let left: Vec<f64> = (0..N)
        .map(|j| {
            let whole = square(&rows[j].y);
            if whole == 0.0 {
                return 0.0;
            }
            ((square(&residual[j]) - square(&rows[j].floor)) / whole).max(0.0)
        })
        .collect();
    let total: f64 = left.iter().sum();
    let mut places: Vec<Location> = (0..N)
        .filter(|j| total > 0.0 && left[*j] > 0.0)
        .map(|j| Location {
            joint: j + 1,
            share: left[j] / total,
            regime: "everywhere".to_owned(),
            detail: format!("{:.1} % of the joint's torque unexplained", 100.0 * left[j].sqrt()),
            range: None,
        })
        .collect();
    places.sort_by(|a, b| b.share.total_cmp(&a.share));
    places
}

fn gap<const N: usize, const P: usize>(
    compared: &Compared<N, P>,
    data: &Dataset<N>,
    rotary: &[bool],
    options: &Options,
) -> Gap {
    let missed =
        |i: usize| rms::<N>(&compared.measured, &limited(&compared.measured, &compared.predicted[i]));
    let [before, refit, after] = [0, 1, 2].map(missed);
    let floor = compared.floor.clone();
    let motion = rms::<N>(&compared.measured, &still(data));
    let remains = stands_out(&after, &floor, &motion, CONSEQUENTIAL_SERIAL_ERROR);
    Gap {
        horizon_s: options.horizon,
        unit: if rotary.first() == Some(&true) { "rad" } else { "m" },
        closed: closed(&before, &after, &floor),
        closed_ci: closed_interval(compared, data, options.seed),
        unexplained: if remains { (1.0 - closed(&refit, &after, &floor)).clamp(0.0, 1.0) } else { 0.0 },
        motion,
        horizons: HORIZONS.iter().filter_map(|h| at_horizon(compared, data, *h)).collect(),
        free_run: FreeRun { before: Vec::new(), after: Vec::new() },
        second_halves: None,
        training: None,
        before,
        refit,
        after,
        floor,
    }
}

/// Errors of a model on the training logs; `None` where they are within noise, of no consequence in relation to the motion, or no larger in relation to it
/// than on the holdout, whose errors `gap` holds.
fn training_gap<const N: usize, const P: usize>(
    data: &Dataset<N>,
    model: &Model<N, P>,
    gap: &Gap,
) -> Option<TrainingErrors> {
    let measured = data.measured();
    let after = rms::<N>(&measured, &limited(&measured, &model.predict(data)));
    let noise = std::array::from_fn(|j| median(data.tracks.iter().map(|t| t.noise[j]).collect()));
    let floor: Vec<f64> = floor(data, &noise).iter().map(|v| v.sqrt()).collect();
    let motion = rms::<N>(&measured, &still(data));
    let of_holdout = |j: usize| ONLY_THERE * gap.after[j] * motion[j] / gap.motion[j];
    let only_there: Vec<f64> =
        (0..N).map(|j| if after[j] > of_holdout(j) { after[j] } else { 0.0 }).collect();
    stands_out(&only_there, &floor, &motion, CONSEQUENTIAL_SERIAL_ERROR)
        .then_some(TrainingErrors { after, floor })
}

/// Positions of the windows' first samples, rad or m, in place of predictions, sample by sample and joint by joint.
fn still<const N: usize>(data: &Dataset<N>) -> Vec<f64> {
    data.windows.iter().flat_map(|w| w.initial_state.q.as_slice().repeat(w.rows())).collect()
}

fn at_horizon<const N: usize, const P: usize>(
    compared: &Compared<N, P>,
    data: &Dataset<N>,
    horizon: f64,
) -> Option<AtHorizon> {
    let data = Dataset::new(data.tracks.clone(), horizon);
    if data.windows.len() < 2 * data.tracks.len() {
        return None;
    }
    let measured = data.measured();
    let missed =
        |i: usize| rms::<N>(&measured, &limited(&measured, &predictions(&compared.models, i, &data)));
    let noise = data.tracks.first().map_or([0.0; N], |t| t.noise);
    Some(AtHorizon {
        horizon_s: horizon,
        before: missed(0),
        refit: missed(1),
        after: missed(2),
        floor: floor(&data, &noise).iter().map(|v| v.sqrt()).collect(),
    })
}

/// 95 % confidence interval of the closed share of the gap, from resampled holdout windows.
fn closed_interval<const N: usize, const P: usize>(
    compared: &Compared<N, P>,
    data: &Dataset<N>,
    seed: u64,
) -> [f64; 2] {
    let table = |predicted: &[f64]| -> Vec<[f64; N]> {
        let predicted = limited(&compared.measured, predicted);
        let of = |w: &crate::predict::window::Window<N>| {
            let (a, b) = (&compared.measured[w.range()], &predicted[w.range()]);
            std::array::from_fn(|j| a.iter().zip(b).skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum())
        };
        data.windows.iter().map(of).collect()
    };
    let (before, after) = (table(&compared.predicted[0]), table(&compared.predicted[2]));
    let mut random = Random(seed);
    let mut shares: Vec<f64> = (0..CLOSED_SHARE_RESAMPLES)
        .map(|_| {
            let draw: Vec<usize> = data.windows.iter().map(|_| random.below(data.windows.len())).collect();
            let rows: usize = draw.iter().map(|w| data.windows[*w].rows()).sum();
            let pooled = |table: &[[f64; N]]| -> Vec<f64> {
                (0..N)
                    .map(|j| (draw.iter().map(|&w| table[w][j]).sum::<f64>() / rows.max(1) as f64).sqrt())
                    .collect()
            };
            closed(&pooled(&before), &pooled(&after), &compared.floor)
        })
        .collect();
    shares.sort_by(f64::total_cmp);
    [shares[CLOSED_SHARE_RESAMPLES / 40], shares[CLOSED_SHARE_RESAMPLES - 1 - CLOSED_SHARE_RESAMPLES / 40]]
}

fn free_runs<const N: usize, const P: usize>(
    compared: &Compared<N, P>,
    data: &Dataset<N>,
) -> (Vec<FreeRunSeries>, FreeRun) {
    let data = whole(data);
    let measured = data.measured();
    let [before, after] = [0, 2].map(|i| limited(&measured, &predictions(&compared.models, i, &data)));
    let run = FreeRun { before: rms::<N>(&measured, &before), after: rms::<N>(&measured, &after) };
    (free_run_series(&data, &measured, [&before, &after]), run)
}

/// RMS of the torque that a model leaves unexplained on the holdout, relative to the joint's RMS torque, by joint; `None` for a joint without torque.
pub(in crate::serial) fn unexplained<const N: usize, const P: usize>(
    set: &Fitted,
    holdout: &Set<N, P>,
) -> Vec<Option<f64>> {
    let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let rows = &holdout.equation.rows;
    let theta = std::array::from_fn(|i| set.estimate.theta[i]);
    let signals: Vec<_> = set.terms.iter().map(|t| holdout.equation.signal(t, &theta)).collect();
    let beside =
        if signals.is_empty() { vec![None; N] } else { crate::serial::weak_form::rows::sum(rows, &signals) };
    let residual = rows.residual(&set.estimate.theta, &beside);
    let share = |j: usize| {
        let y = square(&rows.joints[j].y);
        (y > 0.0).then(|| (square(&residual[j]) / y).sqrt())
    };
    (0..N).map(share).collect()
}

fn values(description: &SerialArm, theta: &[f64], sigma: &[f64]) -> Named<Value> {
    let names = description.chain.parameters().into_iter();
    names
        .zip(theta.iter().zip(sigma))
        .map(|((name, unit), (value, sigma))| (name, Value { value: *value, sigma: *sigma, unit }))
        .collect()
}

fn summary(description: &SerialArm) -> ArmSummary {
    let (parameter_names, parameter_units) = description.chain.parameters().into_iter().unzip();
    ArmSummary {
        kind: "serial",
        n_joints: description.chain.joints.len(),
        parameter_names,
        parameter_units,
        joint_unit: description.rotary().iter().map(|turns| if *turns { "rad" } else { "m" }).collect(),
    }
}

fn logs<const N: usize>(data: &Dataset<N>) -> Vec<LogSummary> {
    let of = |(i, track): (usize, &crate::log::track::Track<N>)| LogSummary {
        name: track.name.clone(),
        samples: track.len(),
        duration_s: track.t[track.len() - 1] - track.t[0],
        windows: data.windows.iter().filter(|w| w.track == i).count(),
        encoder_zero: None,
    };
    data.tracks.iter().enumerate().map(of).collect()
}
