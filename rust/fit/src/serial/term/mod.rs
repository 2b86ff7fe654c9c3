//! Terms that a serial arm's model may lack: the library's laws joint by joint, and what changes the arm itself.

pub(in crate::serial) mod controller_term;
pub(in crate::serial) mod row_term;
pub(in crate::serial) mod several_joints;
pub(in crate::serial) mod transmission;

use crate::model::hypothesis::EffectInstance;
use crate::serial::term::controller_term::{ControllerTerm, Setting};
use crate::serial::term::row_term::{RowLaw, RowTerm};
use crate::serial::term::several_joints::SeveralJoints;
use crate::serial::term::transmission::TransmissionLaw;
use armgap_core::chain::LINK_NAMES;
use armgap_core::effect::{JointPoint, Quantity, Scope, Trial};

/// A term with values for its parameters.
#[derive(Debug, Clone)]
pub struct Term {
    /// What it is.
    pub kind: TermKind,
    /// Values, SI.
    pub p: Vec<f64>,
    /// Effective number of parameters: of a link's ten those that the logs know better than the arm file does.
    pub degrees: f64,
}

/// What a term is.
#[derive(Debug, Clone)]
pub enum TermKind {
    /// A law of the library on one joint; the values of the instance are an initial guess.
    Law(EffectInstance),
    /// A load on the last link: mass and centre of mass in the link's frame, a point mass.
    Payload,
    /// The base turned about the two horizontal axes of its frame.
    BaseTilt,
    /// One link's mass, first moments and inertia differ from the nominal ones.
    NominalLink(usize),
    /// A shaft that twists, or backlash: its compliance or its gap.
    Transmission(TransmissionLaw),
    /// A setting of a position controller.
    Controller(ControllerTerm),
    /// The same law on several joints.
    Joints(SeveralJoints),
    /// A term on a sum or a difference of two joints' motion.
    Row(RowTerm),
}

/// Name and unit of one parameter.
#[derive(Debug, Clone, Copy)]
pub struct TermParameter {
    /// Name in results.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Bounds.
    pub bounds: [f64; 2],
    /// Value at which it does nothing.
    pub neutral: f64,
    /// Name and unit of its inverse, where results state that.
    pub inverse: Option<(&'static str, &'static str)>,
}

const LOAD: [(&str, &str); 4] = [("mass", "kg"), ("com_x", "m"), ("com_y", "m"), ("com_z", "m")];
const TURN: [(&str, &str); 2] = [("x", "rad"), ("y", "rad")];

impl Term {
    /// A law at its initial guess.
    pub fn of_law(effect: EffectInstance) -> Self {
        let p = effect.p[..effect.len()].to_vec();
        Self { kind: TermKind::Law(effect), degrees: p.len() as f64, p }
    }

    /// Neither load, nor tilt, nor change.
    pub fn neutral(kind: TermKind) -> Self {
        let count = match kind {
            TermKind::Law(effect) => effect.len(),
            TermKind::Payload => LOAD.len(),
            TermKind::BaseTilt => TURN.len(),
            TermKind::NominalLink(_) => LINK_NAMES.len(),
            TermKind::Transmission(_) | TermKind::Controller(_) => 1,
            TermKind::Joints(ref of) => of.members.iter().map(|m| m.p.len()).sum(),
            TermKind::Row(row) => row.len(),
        };
        Self { kind, p: vec![0.0; count], degrees: count as f64 }
    }

    /// Name in results.
    pub fn name(&self) -> &'static str {
        match self.kind {
            TermKind::Law(effect) => effect.law.spec().name,
            TermKind::Payload => "payload",
            TermKind::BaseTilt => "base_tilt",
            TermKind::NominalLink(_) => "nominal_link",
            TermKind::Transmission(law) => law.name(),
            TermKind::Controller(of) => of.setting.name(),
            TermKind::Joints(ref of) => of.members[0].name(),
            TermKind::Row(row) => row.name(),
        }
    }

    /// Name for people.
    pub fn title(&self) -> &'static str {
        match self.kind {
            TermKind::Law(effect) => effect.law.spec().title,
            TermKind::Payload => "payload on the last link",
            TermKind::BaseTilt => "base not level",
            TermKind::NominalLink(_) => "wrong nominal link",
            TermKind::Transmission(law) => law.title(),
            TermKind::Controller(of) => of.setting.title(),
            TermKind::Joints(ref of) => of.members[0].title(),
            TermKind::Row(row) => row.title(),
        }
    }

    /// 1-based joint; of a link, the joint that moves it; none for what belongs to the whole arm.
    pub fn joint(&self) -> Option<usize> {
        match self.kind {
            TermKind::Law(effect) => effect.joint_number(),
            TermKind::NominalLink(link) => Some(link + 1),
            TermKind::Transmission(law) => Some(law.joint + 1),
            TermKind::Controller(of) => Some(of.joint + 1),
            TermKind::Payload | TermKind::BaseTilt | TermKind::Joints(_) | TermKind::Row(_) => None,
        }
    }

    /// Factors of two joints, of a term on a row over them.
    pub fn row(&self) -> Option<[i32; 2]> {
        if let TermKind::Row(row) = self.kind { Some(row.row()) } else { None }
    }

    /// 1-based joints that it is on; none of what belongs to the whole arm.
    pub fn joints(&self) -> Vec<usize> {
        match &self.kind {
            TermKind::Joints(of) => of.members.iter().filter_map(Self::joint).collect(),
            TermKind::Row(row) => vec![row.first + 1, row.first + 2],
            _ => self.joint().into_iter().collect(),
        }
    }

    /// Whether both are the same term, whatever their values; on several joints, whether they have one in common.
    pub fn same_place(&self, other: &Self) -> bool {
        let (own, others) = (self.joints(), other.joints());
        let overlap = self.row().is_none() && own.iter().any(|j| others.contains(j));
        self.name() == other.name() && self.row() == other.row() && (own == others || overlap)
    }

    /// Whether it can be all that another term is, whatever the motion: a load on the last of so many links is a change of that link, and a heavier
    /// last link is a load on it.
    pub fn includes(&self, other: &Self, links: usize) -> bool {
        match (&self.kind, &other.kind) {
            (TermKind::NominalLink(link), TermKind::Payload) => *link + 1 == links,
            (TermKind::Payload, TermKind::NominalLink(link)) => *link + 1 == links && other.p[0] > 0.0,
            _ => false,
        }
    }

    /// Its parameters; `rotary` tells of its joint.
    pub fn parameters(&self, rotary: bool) -> Vec<TermParameter> {
        let free = |(name, unit): &(&'static str, &'static str)| TermParameter {
            name,
            unit,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            neutral: 0.0,
            inverse: None,
        };
        match self.kind {
            TermKind::Law(effect) => effect
                .law
                .spec()
                .parameters
                .iter()
                .map(|p| TermParameter {
                    name: p.name,
                    unit: p.quantity.unit(rotary),
                    bounds: [p.lower, p.upper],
                    neutral: p.neutral,
                    inverse: None,
                })
                .collect(),
            TermKind::Payload => {
                let mut all: Vec<TermParameter> = LOAD.iter().map(free).collect();
                all[0].bounds[0] = 0.0;
                all
            }
            TermKind::BaseTilt => TURN.iter().map(free).collect(),
            TermKind::NominalLink(_) => LINK_NAMES.iter().map(free).collect(),
            TermKind::Transmission(law) => vec![law.parameter(rotary)],
            TermKind::Controller(of) => vec![of.setting.parameter(rotary)],
            TermKind::Joints(ref of) => {
                let different = if of.common { 1 } else { of.members.len() };
                of.members[..different].iter().flat_map(|m| m.parameters(rotary)).collect()
            }
            TermKind::Row(row) => row.parameters(rotary),
        }
    }

    /// Number of its first parameters in which its torque is linear and that switch it off; none where the torque is not linear in any.
    pub fn amplitudes(&self) -> usize {
        match self.kind {
            TermKind::Law(effect) => {
                let spec = effect.law.spec();
                let is_linear = !spec.hooks.command
                    && !spec.hooks.measured
                    && spec.parameters.first().is_some_and(|p| p.quantity != Quantity::Reach);
                match spec.trial {
                    Trial::Amplitudes(count) if is_linear => count,
                    _ => 0,
                }
            }
            TermKind::Payload | TermKind::Controller(_) => 0,
            TermKind::BaseTilt => TURN.len(),
            TermKind::NominalLink(_) => LINK_NAMES.len(),
            TermKind::Joints(ref of) => of.members[0].amplitudes(),
            TermKind::Row(RowTerm { law: RowLaw::Transmission(_), .. }) => 3,
            TermKind::Transmission(_) | TermKind::Row(_) => 1,
        }
    }

    /// Whether it is sought on every joint by itself.
    pub fn is_of_a_joint(&self) -> bool {
        match self.kind {
            TermKind::Law(effect) => effect.law.spec().scope == Scope::Joint,
            TermKind::Transmission(_) | TermKind::Controller(_) => true,
            TermKind::Payload
            | TermKind::BaseTilt
            | TermKind::NominalLink(_)
            | TermKind::Joints(_)
            | TermKind::Row(_) => false,
        }
    }

    /// Whether it changes the torque that a command becomes at the joint: of the command itself, or by a torque that depends on it.
    pub fn changes_command(&self) -> bool {
        if let TermKind::Joints(of) = &self.kind {
            return of.members[0].changes_command();
        }
        let TermKind::Law(effect) = self.kind else { return self.share_of_command().is_some() };
        effect.law.spec().hooks.command || depends(&effect, |x, value| x.tau = value)
    }

    /// Factor that a controller's proportional gain puts on its torque; its derivative part is as good as viscous friction, which no factor tells of.
    pub fn share_of_command(&self) -> Option<f64> {
        matches!(self.kind, TermKind::Controller(of) if of.setting == Setting::Gain).then(|| self.p[0])
    }

    /// Whether it is a factor on the command.
    pub fn is_gain(&self) -> bool {
        if let TermKind::Joints(of) = &self.kind {
            return of.members[0].is_gain();
        }
        let TermKind::Law(effect) = self.kind else { return false };
        let spec = effect.law.spec();
        spec.hooks.command && spec.parameters.iter().all(|p| p.quantity == Quantity::Ratio)
    }

    /// Whether it delays the command: a time is all that it has.
    pub fn is_delay(&self) -> bool {
        if let TermKind::Joints(of) = &self.kind {
            return of.members[0].is_delay();
        }
        let TermKind::Law(effect) = self.kind else {
            return matches!(self.kind, TermKind::Controller(of) if of.setting == Setting::ReferenceDelay);
        };
        let spec = effect.law.spec();
        spec.hooks.command && spec.parameters.iter().all(|p| p.quantity == Quantity::Time)
    }

    /// This term with other values.
    pub fn with(&self, p: Vec<f64>) -> Self {
        Self { kind: self.kind.clone(), p, degrees: self.degrees }
    }

    /// The library's effect with these values; none for what is no law.
    pub fn effect(&self) -> Option<EffectInstance> {
        let TermKind::Law(mut effect) = self.kind else { return None };
        for (slot, value) in effect.p.iter_mut().zip(&self.p) {
            *slot = *value;
        }
        Some(effect)
    }
}

/// Whether a law's torque depends on what `set` changes of the joint's state.
pub fn depends(effect: &EffectInstance, set: impl Fn(&mut JointPoint<f64>, f64)) -> bool {
    let torque = |value: f64| {
        let mut x = JointPoint {
            t: 1.0,
            q: 0.1,
            dq: 1.0,
            tau: 0.5,
            load: 0.5,
            friction: 1.0,
            other: 1.0,
            memory: 0.0,
        };
        set(&mut x, value);
        effect.law.force(&effect.p, &x) - effect.law.coulomb(&effect.p, &x, 1.0)
    };
    torque(1.0) != torque(2.0)
}

/// Change of the last link's ten numbers under a point mass at `p = (mass, x, y, z)`: mass, first moments, inertia about the link's origin
/// (xx, xy, yy, xz, yz, zz).
pub fn of_load(p: &[f64]) -> [f64; 10] {
    let [m, x, y, z] = [p[0], p[1], p[2], p[3]];
    [
        m,
        m * x,
        m * y,
        m * z,
        m * (y * y + z * z),
        -m * x * y,
        m * (x * x + z * z),
        -m * x * z,
        -m * y * z,
        m * (x * x + y * y),
    ]
}
