//! Causes in the form of the diagnosis result, and the status of every effect that was looked for and is not named.

use crate::model::hypothesis::EffectInstance;
use crate::result::report::{
    Bound, Cause, CauseValue, EquivalentSummary, Named, RuledOut, SeveralJoints, SidesSummary, Status, Value,
    Values,
};
use crate::search::rivals::equivalent::on_same_joints;
use crate::serial::constants::{CONSEQUENCE, NOTICED, ROUNDED_BY_LOW_PASS};
use crate::serial::controller::PositionController;
use crate::serial::pushes::Event;
use crate::serial::result::controller_report::behind_controller;
use crate::serial::search::{Found, Tested};
use crate::serial::term::transmission::TransmissionLaw;
use crate::serial::term::{Term, TermKind, TermParameter};
use armgap_core::effect::{Effect, EffectParameter, Scope, Trial, catalogue};

/// One-sided 95 % quantile of the standard normal distribution, for upper confidence limits of the sizes of effects.
const NORMAL_95_ONE_SIDED: f64 = 1.645;

/// Standard deviation of an effect's estimated torque (RMS), relative to the joint's RMS torque, above which the logs do not excite the effect.
const NOT_EXCITED: f64 = 0.2;

/// RMS of the torque that a model leaves unexplained, relative to the joint's RMS torque, above which joint elasticity and backlash are undecided:
/// they are tested at some stiffnesses and gaps alone, and what they do at others may be something else.
const HIDES: f64 = 0.01;

const NOT_TESTED: &str = "not tested on serial arms from such logs";

const NO_PUSH: &str = "no push stands out of what the model lacks in any of these logs";

/// Reason why an effect of [`ROUNDED_BY_LOW_PASS`] is neither named nor absent.
const ROUNDED: &str = "not told from low-passed positions, whose friction is rounded at reversals";

const LOOK_ALIKE: &str = "explains the torque along these logs as well";

fn rotary_of(term: &Term, rotary: &[bool]) -> bool {
    term.joints().first().is_none_or(|j| rotary[j - 1])
}

/// Joints of a term that acts on several joints, or along the sum or difference of two joints' positions; empty for other terms.
fn several(term: &Term) -> SeveralJoints {
    let joints = term.joints();
    SeveralJoints { joints: (joints.len() > 1).then_some(joints), row: term.row() }
}

/// Values of a term's parameters with standard deviations and units: one number each, or one per joint for a law on several joints.
fn cause_values(term: &Term, sigma: &[f64], rotary: &[bool]) -> Named<CauseValue> {
    if !term.is_on_several_joints() {
        let one = |(name, value)| (name, CauseValue::One(value));
        return named_values(term, sigma, rotary).into_iter().map(one).collect();
    }
    let members = term.members();
    let count = members[0].p.len();
    let of = |(i, member): (usize, &Term)| {
        let first = if term.has_common_value() { 0 } else { i * count };
        named_values(member, sigma.get(first..first + count).unwrap_or(&[]), rotary)
    };
    let by_joint: Vec<Named<Value>> = members.iter().enumerate().map(of).collect();
    let each = |(name, first): (&String, &Value)| {
        let values = || by_joint.iter().filter_map(|values| values.get(name));
        let value = values().map(|v| v.value).collect();
        let sigma = values().map(|v| v.sigma).collect();
        (name.clone(), CauseValue::Each(Values { value, sigma, unit: first.unit }))
    };
    by_joint[0].iter().map(each).collect()
}

fn named_values(term: &Term, sigma: &[f64], rotary: &[bool]) -> Named<Value> {
    let parameters = term.parameters(rotary_of(term, rotary));
    let value = |(i, p): (usize, &TermParameter)| {
        let sigma = sigma.get(i).copied().filter(|s| s.is_finite()).unwrap_or(0.0);
        match p.inverse {
            Some((name, unit)) if term.p[i] != 0.0 => {
                (name.to_owned(), Value { value: 1.0 / term.p[i], sigma: sigma / term.p[i].powi(2), unit })
            }
            _ => (p.name.to_owned(), Value { value: term.p[i], sigma, unit: p.unit }),
        }
    };
    let finite: Vec<f64> = sigma.iter().map(|s| if s.is_finite() { *s } else { 0.0 }).collect();
    let mut values: Named<Value> = parameters.iter().enumerate().map(value).collect();
    if let TermKind::Transmission(_) = term.kind
        && let Some([damping, sigma]) = TransmissionLaw::damping(&term.p, &finite)
    {
        let unit = if rotary_of(term, rotary) { "N m s/rad" } else { "N s/m" };
        values.remove("retardation_time");
        values.insert("damping".to_owned(), Value { value: damping, sigma, unit });
    }
    values
}

pub(in crate::serial) fn cause(
    named: &crate::serial::search::Named,
    rotary: &[bool],
    controller: Option<&PositionController>,
) -> Cause {
    let term = &named.term;
    let alike = |t: &Term| {
        let same = on_same_joints(term.name(), t.name()).filter(|_| several(t) == several(term));
        let same = same.filter(|_| t.joint() == term.joint());
        EquivalentSummary {
            effect: t.name(),
            joint: t.joint(),
            on: several(t),
            why: same.unwrap_or(LOOK_ALIKE).to_owned(),
            motion_separates: same.is_none(),
        }
    };
    let mut cause = Cause {
        effect: term.name(),
        title: term.title(),
        joint: term.joint(),
        on: several(term),
        probability: named.probability,
        parameters: cause_values(term, &named.sigma, rotary),
        closed: named.evidence.share.clamp(0.0, 1.0),
        equivalents: named.alike.iter().map(alike).collect(),
        evidence: None,
        sides: match &term.kind {
            TermKind::Transmission(law) => Some(SidesSummary::of(law.sides())),
            _ => None,
        },
        log: None,
        shape: match &term.kind {
            TermKind::Law(effect) => effect.law.form(),
            _ => None,
        },
    };
    let behind = controller.map(|controller| behind_controller(&cause, controller));
    cause.equivalents.extend(behind.into_iter().flatten());
    cause
}

/// Pushes of one event in the log of a given name, one cause for each joint that the event acts on.
pub(in crate::serial) fn pushes_of(event: &Event, log: &str, rotary: &[bool]) -> Vec<Cause> {
    let of_joint = |(push, sigma): (EffectInstance, [f64; 3])| {
        let spec = push.law.spec();
        let value = |((parameter, value), sigma): ((&EffectParameter, f64), f64)| {
            let unit = parameter.quantity.unit(rotary[push.joint]);
            (parameter.name.to_owned(), CauseValue::One(Value { value, sigma, unit }))
        };
        Cause {
            effect: spec.name,
            title: spec.title,
            joint: push.joint_number(),
            on: SeveralJoints::default(),
            probability: event.probability,
            parameters: spec.parameters.iter().zip(push.p).zip(sigma).map(value).collect(),
            closed: event.share,
            equivalents: Vec::new(),
            evidence: None,
            sides: None,
            log: Some(log.to_owned()),
            shape: push.law.form(),
        }
    };
    event.pushes().into_iter().map(of_joint).collect()
}

/// Status of every effect, joint by joint, that is not among the causes that were found, undecided for effects that are not tested; `unexplained` is
/// the RMS torque that the final model leaves unexplained, relative to the RMS torque, by joint; `pushed` are the joints (from 1) on which pushes were
/// found, `None` where none were looked for.
pub(in crate::serial) fn ruled_out(
    found: &Found,
    unexplained: &[Option<f64>],
    rotary: &[bool],
    pushed: Option<&[usize]>,
) -> Vec<RuledOut> {
    let named = |t: &Tested| found.named.iter().any(|n| n.term.same_place(&t.term));
    let mut all: Vec<RuledOut> =
        found.tested.iter().filter(|t| !named(t)).map(|t| status(found, unexplained, t, rotary)).collect();
    let is_tested = |name: &str, j: usize| {
        let tested = found.tested.iter().map(|t| &t.term).chain(found.named.iter().map(|n| &n.term));
        tested.into_iter().any(|t| t.name() == name && t.row().is_none() && t.joints().contains(&(j + 1)))
    };
    let why = |law: &'static dyn Effect<f64>| {
        let spec = law.spec();
        match spec.trial {
            _ if spec.scope != Scope::Joint => None,
            Trial::Disturbance if pushed.is_some() => Some((Status::Absent, NO_PUSH)),
            Trial::Disturbance => Some((Status::Undecided, NOT_TESTED)),
            _ => ROUNDED_BY_LOW_PASS.contains(&spec.name).then_some((Status::Undecided, ROUNDED)),
        }
    };
    for (law, (status, why)) in catalogue::<f64>().iter().filter_map(|law| Some((law, why(*law)?))) {
        let named =
            |j: usize| law.spec().trial == Trial::Disturbance && pushed.is_some_and(|p| p.contains(&(j + 1)));
        let open = (0..rotary.len()).filter(|j| !is_tested(law.spec().name, *j) && !named(*j));
        all.extend(open.map(|j| RuledOut {
            effect: law.spec().name,
            joint: Some(j + 1),
            on: SeveralJoints::default(),
            status,
            bound: None,
            why: Some(why.to_owned()),
        }));
    }
    all
}

/// Joints of a term as text that follows the term's name, such as ` of joint 2`.
fn place_of(term: &Term) -> String {
    let joints: Vec<String> = term.joints().iter().map(usize::to_string).collect();
    match joints.as_slice() {
        [] => String::new(),
        [joint] => format!(" of joint {joint}"),
        several => format!(" of joints {}", several.join(", ")),
    }
}

fn status(found: &Found, unexplained: &[Option<f64>], tested: &Tested, rotary: &[bool]) -> RuledOut {
    let term = &tested.term;
    let (effect, joint) = (term.name(), term.joint());
    let entry = |status, bound, why| RuledOut { effect, joint, on: several(term), status, bound, why };
    let alike = found.named.iter().find(|n| n.alike.iter().any(|a| a.same_place(term)));
    if let Some(cause) = alike {
        let place = place_of(&cause.term);
        let why = format!("looks like {}{place} in these logs", cause.term.name());
        return entry(Status::Undecided, None, Some(why));
    }
    let [size, sigma] = tested.size;
    let known = sigma * tested.consequence;
    if !known.is_finite() || known > NOT_EXCITED || tested.consequence == 0.0 {
        return entry(Status::NotExcited, None, Some("these logs do not pin its size down".to_owned()));
    }
    let statistic = (size / sigma.max(f64::MIN_POSITIVE)).powi(2);
    let largest = size.abs() + NORMAL_95_ONE_SIDED * sigma;
    if statistic > NOTICED && largest * tested.consequence > 10.0 * CONSEQUENCE {
        let why = "explains a part of what remains, and too little of it to be named".to_owned();
        return entry(Status::Undecided, None, Some(why));
    }
    if let TermKind::Transmission(law) = term.kind
        && let Some(left) = unexplained[law.joint].filter(|left| *left > HIDES)
    {
        let why = format!(
            "tested at some stiffnesses and gaps alone, and {:.1} % of the joint's torque is unexplained",
            100.0 * left
        );
        return entry(Status::Undecided, None, Some(why));
    }
    let parameters = term.parameters(rotary_of(term, rotary));
    let bound = (term.amplitudes() > 0 && !matches!(term.kind, TermKind::NominalLink(_)))
        .then(|| {
            let p = parameters.first()?;
            // Several amplitudes of one unit are those of one wave: the bound is on its amplitude.
            let of_wave = parameters.iter().take(term.amplitudes()).take_while(|other| other.unit == p.unit);
            let apart = |(p, value): (&TermParameter, &f64)| (value - p.neutral).powi(2);
            let size = of_wave.zip(&term.p).map(apart).sum::<f64>().sqrt();
            let value = (largest * size).abs();
            value.is_finite().then_some(Bound { parameter: p.name, value, unit: p.unit, level: 0.95 })
        })
        .flatten();
    entry(Status::Absent, bound, None)
}
