//! From an attribution to the diagnosis as data.

use crate::arm::ArmDescription;
use crate::attribute::Contender;
use crate::decide::{Attribution, CONSEQUENCE, Random};
use crate::diagnose::Options;
use crate::event::{Event, without_pushes};
use crate::locate::{Lacks, lacking_torque, places, regimes};
use crate::metric::Metric;
use crate::model::{Hypothesis, Placed};
use crate::report::{
    ArmSummary, Bound, Cause, Diagnosis, EquivalentSummary, FreeRun, FreeRunSeries, Gap, LogSummary, Named,
    Noise, OptionSummary, Parameters, Ranked, RuledOut, Series, StageSummary, Value,
};
use crate::screen::{Scored, screen};
use crate::solve::Fit;
use crate::study::{Sample, Study};
use crate::window::{Dataset, Shift, Window};
use armgap_core::arm::Arm;
use armgap_core::effect::{Scope, Spec, Trial, catalogue};

/// Points of a drawn curve at most.
const DRAWN: usize = 2500;

/// Holdout logs that are drawn.
const DRAWN_LOGS: usize = 3;

/// Resamples of the holdout windows for the interval of the closed share.
const RESAMPLES: usize = 500;

/// An effect whose size this log pins down to no better than this part of a typical size has not been excited.
const PINNED: f64 = 0.5;

/// Two-sided 95 % of the normal distribution.
const NORMAL_95: f64 = 1.96;

/// Free-run errors are cut here, rad or m: beyond, only "it diverged" is meant.
const FREE_RUN_LIMIT: f64 = 100.0;

/// A window's variance from its measured start counts up to this many times the typical one.
const WORST_START: f64 = 10.0;

/// The three hypotheses a report compares.
struct Compared<const P: usize> {
    before: Hypothesis<P>,
    refit: Hypothesis<P>,
    after: Hypothesis<P>,
}

/// The diagnosis of a study.
pub fn compose<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    (attribution, events): &(Attribution<N, P>, Vec<Event>),
    description: &ArmDescription,
    options: &Options,
) -> Diagnosis {
    let compared = Compared {
        before: Hypothesis::rigid(study.prior.theta),
        refit: attribution.refit.hypothesis.clone(),
        after: attribution.model.hypothesis.clone(),
    };
    let errors = Errors::new(study, &compared);
    let gap = gap(study, &compared, &errors, description, options);
    let rotary = description.kind.rotary();
    let last = &attribution.stages[attribution.stages.len() - 1];
    let lacks = lacks(study, &compared, &last.weights.holdout);
    let regimes = regimes(&lacks, rotary);
    let verdict = if events.is_empty() { verdict(attribution, &gap) } else { "effect" };
    let gap_of =
        if attribution.causes.is_empty() && verdict == "parameters" { &lacks.before } else { &lacks.refit };
    Diagnosis {
        schema: "armgap.diagnosis/1",
        verdict,
        places: places(gap_of, &regimes, &study.scales.torque),
        gap,
        causes: attribution
            .causes
            .iter()
            .map(|c| cause(c, N, rotary))
            .chain(events.iter().map(|e| push(study, e, rotary)))
            .collect(),
        ruled_out: ruled_out(study, attribution, rotary)
            .into_iter()
            .filter(|r| {
                !events.iter().any(|e| r.effect == "external_pulse" && r.joint == e.push.joint_number())
            })
            .collect(),
        parameters: Parameters {
            nominal: nominal(study, description),
            refit: values(&attribution.refit, description),
            with_causes: values(&attribution.model, description),
        },
        arm: arm_summary(description),
        training: logs(&study.training),
        holdout: logs(&study.holdout),
        ranking: ranking(study, attribution, rotary),
        stages: stages(study, attribution),
        regimes,
        series: errors.series(study),
        free_run_series: free_run_series(study, &compared),
        noise: noise(study),
        options: OptionSummary {
            horizon_s: options.horizon,
            max_causes: options.max_causes,
            seed: options.seed,
            friction_smoothing: attribution.model.hypothesis.smoothing,
        },
        version: env!("CARGO_PKG_VERSION"),
        seconds: 0.0,
        notes: notes(attribution),
    }
}

/// Predictions on the holdout from measured starts, and their squared errors.
struct Errors<const N: usize> {
    before: Vec<f64>,
    refit: Vec<f64>,
    after: Vec<f64>,
    /// Mean variance that measured starts and the measurement itself put into the errors, per joint.
    floor: [f64; N],
}

impl<const N: usize> Errors<N> {
    fn new<A: Arm<f64, N, P>, const P: usize>(study: &Study<A, N, P>, compared: &Compared<P>) -> Self {
        let data = &study.holdout.data;
        let starts = data.measured_starts();
        let bare = without_pushes(&study.holdout).data;
        Self {
            before: bare.predict(&study.arm, &compared.before, &starts),
            refit: bare.predict(&study.arm, &compared.refit, &starts),
            after: data.predict(&study.arm, &compared.after, &starts),
            floor: floor(study, &compared.after),
        }
    }

    /// Measured and predicted positions for drawing.
    fn series<A: Arm<f64, N, P>, const P: usize>(&self, study: &Study<A, N, P>) -> Vec<Series> {
        let data = &study.holdout.data;
        let mut all = Vec::new();
        for (index, track) in data.tracks.iter().enumerate().take(DRAWN_LOGS) {
            let stride = track.len().div_ceil(DRAWN);
            for j in 0..N {
                let mut s = Series {
                    log: track.name.clone(),
                    joint: j + 1,
                    t: Vec::new(),
                    measured: Vec::new(),
                    before: Vec::new(),
                    refit: Vec::new(),
                    after: Vec::new(),
                    window_start: Vec::new(),
                };
                for window in data.windows.iter().filter(|w| w.track == index) {
                    s.window_start.push(s.t.len());
                    for i in (0..window.rows()).step_by(stride) {
                        let at = (window.offset + i) * N + j;
                        s.t.push(track.t[window.first + 1 + i]);
                        s.measured.push(study.holdout.measured[at]);
                        s.before.push(self.before[at]);
                        s.refit.push(self.refit[at]);
                        s.after.push(self.after[at]);
                    }
                }
                all.push(s);
            }
        }
        all
    }
}

/// Variance of a perfect model's errors: noise of the sample itself, and of the measured start carried along the window.
fn floor<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    model: &Hypothesis<P>,
) -> [f64; N] {
    let data = &study.holdout.data;
    let columns = crate::metric::start_sensitivities(data, &study.arm, model, &data.measured_starts());
    let carried = |window: &Window<N>| -> [f64; N] {
        let mut sum = [0.0; N];
        for row in window.range().step_by(N) {
            for (j, total) in sum.iter_mut().enumerate() {
                for (k, [vq, cov, vdq]) in window.start.covariance.iter().enumerate() {
                    let (a, b) = (columns[k][row + j], columns[N + k][row + j]);
                    *total += a * a * vq + 2.0 * a * b * cov + b * b * vdq;
                }
            }
        }
        sum.map(|x| x / window.rows() as f64)
    };
    let windows: Vec<[f64; N]> = data.windows.iter().map(carried).collect();
    std::array::from_fn(|j| {
        // A window whose start decides whether a joint sticks has no meaningful derivative; it counts as a bad one, not as infinite.
        let typical = crate::track::median(windows.iter().map(|w| w[j]).collect());
        let mean =
            windows.iter().map(|w| w[j].min(WORST_START * typical)).sum::<f64>() / windows.len() as f64;
        study.noise[j].powi(2) + mean
    })
}

fn rms<const N: usize>(measured: &[f64], predicted: &[f64]) -> Vec<f64> {
    let rows = (measured.len() / N).max(1) as f64;
    let squares = |j: usize| -> f64 {
        measured.iter().zip(predicted).skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum()
    };
    (0..N).map(|j| (squares(j) / rows).sqrt()).collect()
}

fn gap<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    compared: &Compared<P>,
    errors: &Errors<N>,
    description: &ArmDescription,
    options: &Options,
) -> Gap {
    let measured = &study.holdout.measured;
    let floor: Vec<f64> = errors.floor.iter().map(|v| v.sqrt()).collect();
    let before = rms::<N>(measured, &errors.before);
    let after = rms::<N>(measured, &errors.after);
    Gap {
        horizon_s: options.horizon,
        unit: if description.kind.rotary() { "rad" } else { "m" },
        closed: closed(&before, &after, &floor),
        closed_ci: closed_interval(study, errors, &floor, options.seed),
        refit: rms::<N>(measured, &errors.refit),
        free_run: FreeRun {
            before: free_run_rms(study, &without_pushes(&study.holdout).data, &compared.before),
            after: free_run_rms(study, &study.holdout.data, &compared.after),
        },
        before,
        after,
        floor,
    }
}

/// Share of the gap above the floor that is closed, over all joints.
fn closed(before: &[f64], after: &[f64], floor: &[f64]) -> f64 {
    let above =
        |x: &[f64]| x.iter().zip(floor).map(|(x, f)| ((x - f) / before_scale(before)).max(0.0)).sum::<f64>();
    let (b, a) = (above(before), above(after));
    if b > 0.0 { 1.0 - a / b } else { 0.0 }
}

fn before_scale(before: &[f64]) -> f64 {
    before.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
}

/// 95 % interval of the closed share from resampled holdout windows.
fn closed_interval<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    errors: &Errors<N>,
    floor: &[f64],
    seed: u64,
) -> [f64; 2] {
    let data = &study.holdout.data;
    let squares = |predicted: &[f64], w: &Window<N>, j: usize| -> f64 {
        let pairs = study.holdout.measured[w.range()].iter().zip(&predicted[w.range()]);
        pairs.skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum()
    };
    let table = |predicted: &[f64]| -> Vec<[f64; N]> {
        data.windows.iter().map(|w| std::array::from_fn(|j| squares(predicted, w, j))).collect()
    };
    let (before, after) = (table(&errors.before), table(&errors.after));
    let mut random = Random(seed);
    let count = data.windows.len();
    let mut shares: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let draw: Vec<usize> = (0..count).map(|_| random.below(count)).collect();
            let rows: usize = draw.iter().map(|&w| data.windows[w].rows()).sum();
            let pooled = |table: &[[f64; N]]| -> Vec<f64> {
                (0..N)
                    .map(|j| (draw.iter().map(|&w| table[w][j]).sum::<f64>() / rows.max(1) as f64).sqrt())
                    .collect()
            };
            closed(&pooled(&before), &pooled(&after), floor)
        })
        .collect();
    shares.sort_by(f64::total_cmp);
    [shares[RESAMPLES / 40], shares[RESAMPLES - 1 - RESAMPLES / 40]]
}

/// The holdout as one window per log.
fn whole<const N: usize>(data: &Dataset<N>) -> Dataset<N> {
    let (mut windows, mut rows) = (Vec::new(), 0);
    for (index, track) in data.tracks.iter().enumerate() {
        let last = track.len() - 1;
        windows.push(Window { track: index, first: 0, last, offset: rows, start: track.start(0) });
        rows += last;
    }
    Dataset { tracks: data.tracks.clone(), windows, rows }
}

fn free_run_rms<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    data: &Dataset<N>,
    model: &Hypothesis<P>,
) -> Vec<f64> {
    let data = whole(data);
    let predicted =
        limited(&data, &data.predict(&study.arm, model, &vec![Shift::none(); data.windows.len()]));
    rms::<N>(&data.measured(), &predicted)
}

/// Predictions kept within reach of the measurement, so that a diverged run stays a number.
fn limited<const N: usize>(data: &Dataset<N>, predicted: &[f64]) -> Vec<f64> {
    let measured = data.measured();
    predicted.iter().zip(&measured).map(|(p, m)| m + (p - m).clamp(-FREE_RUN_LIMIT, FREE_RUN_LIMIT)).collect()
}

fn free_run_series<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    compared: &Compared<P>,
) -> Vec<FreeRunSeries> {
    let data = whole(&study.holdout.data);
    let starts = vec![Shift::none(); data.windows.len()];
    let run = |data: &Dataset<N>, h: &Hypothesis<P>| limited(data, &data.predict(&study.arm, h, &starts));
    let bare = whole(&without_pushes(&study.holdout).data);
    let (before, after, measured) =
        (run(&bare, &compared.before), run(&data, &compared.after), data.measured());
    let mut all = Vec::new();
    for window in data.windows.iter().take(DRAWN_LOGS) {
        let track = &data.tracks[window.track];
        let rows: Vec<usize> = (0..window.rows()).step_by(window.rows().div_ceil(DRAWN)).collect();
        for j in 0..N {
            let pick = |x: &[f64]| rows.iter().map(|i| x[(window.offset + i) * N + j]).collect();
            all.push(FreeRunSeries {
                log: track.name.clone(),
                joint: j + 1,
                t: rows.iter().map(|i| track.t[i + 1]).collect(),
                measured: pick(&measured),
                before: pick(&before),
                after: pick(&after),
            });
        }
    }
    all
}

fn lacks<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    compared: &Compared<P>,
    weights: &Metric<N>,
) -> Lacks<N> {
    let data = &study.holdout.data;
    let of = |h: &Hypothesis<P>| lacking_torque(&study.arm, data, &weights.starts, h);
    Lacks { before: of(&compared.before), refit: of(&compared.refit), after: of(&compared.after) }
}

/// What the figures amount to.
fn verdict<const N: usize, const P: usize>(attribution: &Attribution<N, P>, gap: &Gap) -> &'static str {
    if !attribution.causes.is_empty() {
        return "effect";
    }
    let stage = &attribution.stages[attribution.stages.len() - 1];
    if stage.excess() > UNEXPLAINED && stage.relative_error() > CONSEQUENCE {
        return "unexplained";
    }
    let steps = gap.before.iter().zip(&gap.refit).zip(&gap.floor);
    let improved = steps
        .into_iter()
        .any(|((before, refit), floor)| before - refit > 0.2 * before && *before > 2.0 * floor);
    if improved { "parameters" } else { "none" }
}

/// Cost above the floor, as a factor, beyond which a gap without a cause is called unexplained.
const UNEXPLAINED: f64 = 4.0;

fn cause(cause: &crate::decide::Cause, joints: usize, rotary: bool) -> Cause {
    let spec = cause.effect.law.spec();
    let equivalents = crate::equivalent::all(&cause.effect, &cause.look_alikes, joints);
    Cause {
        effect: spec.name,
        title: spec.title,
        joint: cause.effect.joint_number(),
        probability: cause.probability,
        parameters: effect_values(&cause.effect, &cause.sigma, rotary),
        closed: cause.share,
        equivalents: equivalents
            .into_iter()
            .map(|e| EquivalentSummary { effect: e.effect, joint: e.joint, why: e.why })
            .collect(),
        log: None,
    }
}

/// A push as a cause.
fn push<A, const N: usize, const P: usize>(study: &Study<A, N, P>, event: &Event, rotary: bool) -> Cause {
    let spec = event.push.law.spec();
    let sample = if event.holdout { &study.holdout } else { &study.training };
    Cause {
        effect: spec.name,
        title: spec.title,
        joint: event.push.joint_number(),
        probability: event.probability,
        parameters: effect_values(&event.push, &event.sigma, rotary),
        closed: event.share.clamp(0.0, 1.0),
        equivalents: Vec::new(),
        log: Some(sample.data.tracks[event.track].name.clone()),
    }
}

fn effect_values(effect: &Placed, sigma: &[f64], rotary: bool) -> Named<Value> {
    let parameters = effect.law.spec().parameters.iter().enumerate();
    parameters
        .map(|(i, p)| {
            let sigma = sigma.get(i).copied().unwrap_or(0.0);
            (p.name.to_owned(), Value { value: effect.p[i], sigma, unit: p.quantity.unit(rotary) })
        })
        .collect()
}

/// Status of every candidate that is no cause, from its first-order test around the final model.
fn ruled_out<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    attribution: &Attribution<N, P>,
    rotary: bool,
) -> Vec<RuledOut> {
    let stage = &attribution.stages[attribution.stages.len() - 1];
    let model = &attribution.model.hypothesis;
    let open = study.open_candidates(model);
    let scored = screen(&study.problem(&stage.weights.training), model, &open);
    let mut list: Vec<(Placed, RuledOut)> = Vec::new();
    for test in &scored {
        let entry = status(study, test, rotary);
        match list.iter_mut().find(|(place, _)| place.same_place(&test.effect)) {
            // The weakest statement over an effect's shapes holds for the effect.
            Some((_, known)) if weaker(&entry, known) => *known = entry,
            Some(_) => {}
            None => list.push((test.effect, entry)),
        }
    }
    let mut entries: Vec<RuledOut> = list.into_iter().map(|(_, entry)| entry).collect();
    entries.extend(never_fitted::<N>());
    entries
}

/// Status of the effects that no test of candidates looks for.
fn never_fitted<const N: usize>() -> Vec<RuledOut> {
    let laws = catalogue::<f64>().iter().map(|law| law.spec());
    let unsearched = laws.filter(|spec| spec.starts.is_empty() && spec.least_joints <= N);
    let entry = |spec: &Spec, joint: Option<usize>| {
        let (status, why) = if spec.trial == Trial::Event {
            ("absent", "no impulse stands alone in any of these logs")
        } else {
            ("undecided", "another effect and other parameters of the arm give the same motion, always")
        };
        RuledOut { effect: spec.name, joint, status, bound: None, why: Some(why.to_owned()) }
    };
    let places = |spec: &Spec| -> Vec<Option<usize>> {
        if spec.scope == Scope::Joint { (1..=N).map(Some).collect() } else { vec![None] }
    };
    unsearched.flat_map(|spec| places(spec).into_iter().map(move |joint| entry(spec, joint))).collect()
}

fn weaker(a: &RuledOut, b: &RuledOut) -> bool {
    let rank = |s: &str| ["absent", "undecided", "not excited"].iter().position(|x| *x == s).unwrap_or(0);
    let size = |r: &RuledOut| r.bound.as_ref().map_or(f64::INFINITY, |b| b.value);
    (rank(a.status), size(a)) > (rank(b.status), size(b))
}

fn status<A, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    test: &Scored,
    rotary: bool,
) -> RuledOut {
    let spec = test.effect.law.spec();
    let parameter = &spec.parameters[0];
    let typical = study.scales.size(parameter.quantity, test.effect.joint);
    let sigma = test.sigma.max(test.information_sigma);
    let (effect, joint) = (spec.name, test.effect.joint_number());
    if spec.trial == Trial::Whole {
        return threshold_status(test);
    }
    let pinned = sigma < PINNED * typical;
    if !pinned {
        let why = format!("these logs do not pin it down; it needs {}", spec.excited_by);
        return RuledOut { effect, joint, status: "not excited", bound: None, why: Some(why) };
    }
    let value = test.estimate.abs() + NORMAL_95 * sigma;
    let bound =
        Bound { parameter: parameter.name, value, unit: parameter.quantity.unit(rotary), level: 0.95 };
    let traced = test.estimate.abs() > 3.0 * sigma;
    RuledOut {
        effect,
        joint,
        status: if traced { "undecided" } else { "absent" },
        bound: Some(bound),
        why: traced.then(|| {
            "it leaves a trace in the training logs, but does not reduce the gap on the holdout".to_owned()
        }),
    }
}

/// Status of an effect that begins beyond a threshold: excited if any trial threshold was passed.
fn threshold_status(test: &Scored) -> RuledOut {
    let spec = test.effect.law.spec();
    let (effect, joint) = (spec.name, test.effect.joint_number());
    let reached = test.distinct > 0.0 && test.information_sigma < 0.5;
    let why = if reached {
        "at trial values it would leave a trace that these logs do not show".to_owned()
    } else {
        format!("these logs never reach it; it needs {}", spec.excited_by)
    };
    let status = if reached { "absent" } else { "not excited" };
    RuledOut { effect, joint, status, bound: None, why: Some(why) }
}

fn ranking<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    attribution: &Attribution<N, P>,
    rotary: bool,
) -> Vec<Ranked> {
    let stage = &attribution.stages[0];
    let data = &study.holdout.data;
    let starts = data.measured_starts();
    let ranked = |c: &Contender<P>, closed: f64| {
        let effect = c.effect?;
        let n = c.fit.hypothesis.values().len();
        let sigma: Vec<f64> = (n - effect.len()..n).map(|i| c.fit.sigma(i)).collect();
        let predicted = data.predict(&study.arm, &c.fit.hypothesis, &starts);
        Some(Ranked {
            effect: effect.law.spec().name,
            title: effect.law.spec().title,
            joint: effect.joint_number(),
            closed,
            trust: c.fit.prior_cost,
            rms: rms::<N>(&study.holdout.measured, &predicted),
            parameters: effect_values(&effect, &sigma, rotary),
        })
    };
    let final_of = |c: &Contender<P>| stage.contenders.iter().any(|f| same_effect(f, c));
    let finalists = stage.contenders.iter().map(|c| (c, stage.share(c)));
    let others = stage.field.iter().filter(|(c, _)| !final_of(c)).map(|(c, share)| (c, *share));
    finalists.chain(others).filter_map(|(c, share)| ranked(c, share)).collect()
}

fn same_effect<const P: usize>(a: &Contender<P>, b: &Contender<P>) -> bool {
    matches!((a.effect, b.effect), (Some(a), Some(b)) if a.same_place(&b))
}

fn stages<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    attribution: &Attribution<N, P>,
) -> Vec<StageSummary> {
    let data = &study.holdout.data;
    let starts = data.measured_starts();
    let added = |i: usize| {
        let next = attribution.stages.get(i + 1)?;
        let effect =
            next.base.fit.hypothesis.effects.get(attribution.stages[i].base.fit.hypothesis.effects.len())?;
        Some(EquivalentSummary {
            effect: effect.law.spec().name,
            joint: effect.joint_number(),
            why: String::new(),
        })
    };
    let summary = |(i, stage): (usize, &crate::attribute::Stage<N, P>)| StageSummary {
        added: added(i),
        rms: rms::<N>(&study.holdout.measured, &data.predict(&study.arm, &stage.settled.hypothesis, &starts)),
        excess: stage.excess(),
        relative_error: stage.relative_error(),
        trust: stage.base.fit.prior_cost,
    };
    attribution.stages.iter().enumerate().map(summary).collect()
}

fn nominal<A, const N: usize, const P: usize>(
    study: &Study<A, N, P>,
    description: &ArmDescription,
) -> Named<Value> {
    let names = description.kind.parameters().iter().enumerate();
    names
        .map(|(i, p)| {
            (
                p.name.to_owned(),
                Value { value: study.prior.theta[i], sigma: study.prior.sigma[i], unit: p.unit },
            )
        })
        .collect()
}

fn values<const P: usize>(fit: &Fit<P>, description: &ArmDescription) -> Named<Value> {
    let names = description.kind.parameters().iter().enumerate();
    names
        .map(|(i, p)| {
            (p.name.to_owned(), Value { value: fit.hypothesis.theta[i], sigma: fit.sigma(i), unit: p.unit })
        })
        .collect()
}

fn arm_summary(description: &ArmDescription) -> ArmSummary {
    let kind = description.kind;
    ArmSummary {
        kind: kind.name(),
        n_joints: kind.joints(),
        parameter_names: kind.parameters().iter().map(|p| p.name).collect(),
        parameter_units: kind.parameters().iter().map(|p| p.unit).collect(),
        joint_unit: vec![if kind.rotary() { "rad" } else { "m" }; kind.joints()],
    }
}

fn logs<const N: usize>(sample: &Sample<N>) -> Vec<LogSummary> {
    let windows = |i: usize| sample.data.windows.iter().filter(|w| w.track == i).count();
    let tracks = sample.data.tracks.iter().enumerate();
    tracks
        .map(|(i, track)| LogSummary {
            name: track.name.clone(),
            samples: track.len(),
            duration_s: track.t[track.len() - 1] - track.t[0],
            windows: windows(i),
        })
        .collect()
}

fn noise<A, const N: usize, const P: usize>(study: &Study<A, N, P>) -> Noise {
    let step = study.training.data.tracks.first().map_or([0.0; N], |t| t.step);
    Noise { position_sigma: study.noise.to_vec(), encoder_step: step.to_vec() }
}

fn notes<const N: usize, const P: usize>(attribution: &Attribution<N, P>) -> Vec<String> {
    let mut notes = Vec::new();
    let smoothing = attribution.model.hypothesis.smoothing;
    if smoothing > 0.0 {
        notes.push(format!(
            "the logs fit friction smoothed over {smoothing:.3} rad/s better than dry friction"
        ));
    }
    let last = &attribution.stages[attribution.stages.len() - 1];
    if !attribution.causes.is_empty() && last.excess() > UNEXPLAINED && last.relative_error() > CONSEQUENCE {
        notes.push("a gap remains that no further effect in the library explains".to_owned());
    }
    notes
}
