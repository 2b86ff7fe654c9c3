//! Terms that a serial arm's model may lack: the library's effects on single joints, and changes of the arm's links, base, transmissions and
//! controllers.

pub(in crate::serial) mod controller_term;
pub(in crate::serial) mod deflection;
pub(in crate::serial) mod row_term;
pub(in crate::serial) mod several_joints;
pub(in crate::serial) mod table;
pub(in crate::serial) mod transmission;

use crate::locate::variable_classes::CLASSES;
use crate::model::hypothesis::EffectInstance;
use crate::serial::term::controller_term::{ControllerTerm, Setting};
use crate::serial::term::row_term::{RowLaw, RowTerm};
use crate::serial::term::several_joints::SeveralJoints;
use crate::serial::term::table::Table;
use crate::serial::term::transmission::{Compliance, TransmissionLaw};
use armgap_core::chain::LINK_NAMES;
use armgap_core::effect::{JointPoint, Quantity, Scope, Trial};

/// A term that is added to the model of the nominal serial arm, with values of its parameters.
#[derive(Debug, Clone)]
pub struct Term {
    /// Kind of the term.
    pub kind: TermKind,
    /// Values of the term's parameters, SI.
    pub p: Vec<f64>,
    /// Effective number of the term's parameters; of a link's ten inertial parameters only what the logs determine better than the arm file counts.
    pub degrees: f64,
}

/// Kind of a term that a serial arm's model may lack.
#[derive(Debug, Clone)]
pub enum TermKind {
    /// An effect of the library on one joint; the instance holds an initial guess of the parameters.
    Law(EffectInstance),
    /// A point mass on the last link: parameters are the mass, kg, and the position in the link's frame, m.
    Payload,
    /// Tilt of the base about two axes of the base frame (0 for x, 1 for y, 2 for z), rad.
    BaseTilt([usize; 2]),
    /// Difference of a link's mass, first moments and inertia from the nominal values; the number is the link's 0-based index.
    NominalLink(usize),
    /// Joint elasticity or backlash of a transmission; parameters are the compliance, rad/(N m) (m/N), and the retardation time, s, or the gap,
    /// rad (m).
    Transmission(TransmissionLaw),
    /// A setting of a joint's position controller that differs from the arm file.
    Controller(ControllerTerm),
    /// One law that acts on several joints, as one term.
    Joints(SeveralJoints),
    /// A term that acts along the sum or the difference of two adjacent joints' positions.
    Row(RowTerm),
    /// A torque without a name as a table over one variable of the motion; never a cause.
    Table(Box<Table>),
}

/// Name, unit, bounds and neutral value of one parameter of a term.
#[derive(Debug, Clone, Copy)]
pub struct TermParameter {
    /// Name of the parameter in results.
    pub name: &'static str,
    /// SI unit of the parameter.
    pub unit: &'static str,
    /// Lower and upper bound of the parameter, SI.
    pub bounds: [f64; 2],
    /// Value of the parameter at which the term has no effect, SI.
    pub neutral: f64,
    /// Name and unit of the parameter's inverse (stiffness of a compliance), where results state the inverse; `None` where they state the parameter
    /// itself.
    pub inverse: Option<(&'static str, &'static str)>,
}

/// Torque of one class of a table.
const CLASS: (&str, &str) = ("torque", "N m");
const LOAD: [(&str, &str); 4] = [("mass", "kg"), ("com_x", "m"), ("com_y", "m"), ("com_z", "m")];
const TURN: [(&str, &str); 3] = [("x", "rad"), ("y", "rad"), ("z", "rad")];

impl Term {
    /// A term of the equation of motion from an effect of the catalogue, with the parameters of `effect`.
    pub fn of_law(effect: EffectInstance) -> Self {
        let p = effect.p[..effect.len()].to_vec();
        Self { kind: TermKind::Law(effect), degrees: p.len() as f64, p }
    }

    /// A term of a given kind with all of its parameters zero.
    pub fn neutral(kind: TermKind) -> Self {
        let count = match kind {
            TermKind::Law(effect) => effect.len(),
            TermKind::Payload => LOAD.len(),
            TermKind::BaseTilt(axes) => axes.len(),
            TermKind::NominalLink(_) => LINK_NAMES.len(),
            TermKind::Transmission(law) => law.parameters(true).len(),
            TermKind::Controller(_) => 1,
            TermKind::Joints(ref of) => of.members.iter().map(|m| m.p.len()).sum(),
            TermKind::Row(row) => row.len(),
            TermKind::Table(_) => CLASSES,
        };
        Self { kind, p: vec![0.0; count], degrees: count as f64 }
    }

    /// Name of the term in results, such as `base_tilt`.
    pub fn name(&self) -> &'static str {
        match self.kind {
            TermKind::Law(effect) => effect.law.spec().name,
            TermKind::Payload => "payload",
            TermKind::BaseTilt(_) => "base_tilt",
            TermKind::NominalLink(_) => "nominal_link",
            TermKind::Transmission(law) => law.name(),
            TermKind::Controller(of) => of.setting.name(),
            TermKind::Joints(ref of) => of.members[0].name(),
            TermKind::Row(row) => row.name(),
            TermKind::Table(_) => "unnamed",
        }
    }

    /// Title of the term in reports, such as `base not level`.
    pub fn title(&self) -> &'static str {
        match self.kind {
            TermKind::Law(effect) => effect.law.spec().title,
            TermKind::Payload => "payload on the last link",
            TermKind::BaseTilt(_) => "base not level",
            TermKind::NominalLink(_) => "wrong nominal link",
            TermKind::Transmission(law) => law.title(),
            TermKind::Controller(of) => of.setting.title(),
            TermKind::Joints(ref of) => of.members[0].title(),
            TermKind::Row(row) => row.title(),
            TermKind::Table(_) => "torque without a name",
        }
    }

    /// 1-based joint of the term; of a link, the joint that moves the link; `None` for a term on several joints or the whole arm.
    pub fn joint(&self) -> Option<usize> {
        match self.kind {
            TermKind::Law(effect) => effect.joint_number(),
            TermKind::NominalLink(link) => Some(link + 1),
            TermKind::Transmission(law) => Some(law.joint + 1),
            TermKind::Controller(of) => Some(of.joint + 1),
            TermKind::Table(ref table) => Some(table.joint + 1),
            TermKind::Payload | TermKind::BaseTilt(_) | TermKind::Joints(_) | TermKind::Row(_) => None,
        }
    }

    /// Joints (from 0) whose motors have positions of their own by the term, as behind elastic shafts or backlash.
    pub fn own_motors(&self) -> Vec<usize> {
        match &self.kind {
            TermKind::Transmission(law) => vec![law.joint],
            TermKind::Joints(of) => of.members.iter().flat_map(Self::own_motors).collect(),
            _ => Vec::new(),
        }
    }

    /// Whether the term is backlash of a joint whose encoder measures the link.
    pub fn is_backlash_of_link_encoder(&self) -> bool {
        let TermKind::Transmission(law) = self.kind else { return false };
        law.compliance == Compliance::Backlash && !law.encoder_at_motor
    }

    /// Factors (1 and 1, or 1 and -1) of two adjacent joints' positions in the sum or difference that the term acts along; `None` for terms of other
    /// kinds.
    pub fn row(&self) -> Option<[i32; 2]> {
        if let TermKind::Row(row) = self.kind { Some(row.row()) } else { None }
    }

    /// 1-based joints that the term acts on; empty for a payload or a tilt of the base.
    pub fn joints(&self) -> Vec<usize> {
        match &self.kind {
            TermKind::Joints(of) => of.members.iter().filter_map(Self::joint).collect(),
            TermKind::Row(row) => vec![row.first + 1, row.first + 2],
            _ => self.joint().into_iter().collect(),
        }
    }

    /// Whether two terms have the same name and the same joints, or a joint in common, whatever their values.
    pub fn same_place(&self, other: &Self) -> bool {
        let (own, others) = (self.joints(), other.joints());
        let overlap = self.row().is_none() && own.iter().any(|j| others.contains(j));
        self.name() == other.name() && self.row() == other.row() && (own == others || overlap)
    }

    /// Whether the term can explain all that `other` explains, whatever the motion: a changed last link explains what a payload does, and a payload
    /// what a heavier last link does. `links` is the number of links of the arm.
    pub fn includes(&self, other: &Self, links: usize) -> bool {
        match (&self.kind, &other.kind) {
            (TermKind::NominalLink(link), TermKind::Payload) => *link + 1 == links,
            (TermKind::Payload, TermKind::NominalLink(link)) => *link + 1 == links && other.p[0] > 0.0,
            _ => false,
        }
    }

    /// Names, units and bounds of the term's parameters; `rotary` is whether its joint is rotary.
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
                .enumerate()
                .map(|(i, p)| TermParameter {
                    name: p.name,
                    unit: p.quantity.unit(rotary),
                    bounds: effect.bounds(i),
                    neutral: p.neutral,
                    inverse: None,
                })
                .collect(),
            TermKind::Payload => {
                let mut all: Vec<TermParameter> = LOAD.iter().map(free).collect();
                all[0].bounds[0] = 0.0;
                all
            }
            TermKind::BaseTilt(axes) => axes.iter().map(|axis| free(&TURN[*axis])).collect(),
            TermKind::NominalLink(_) => LINK_NAMES.iter().map(free).collect(),
            TermKind::Transmission(law) => law.parameters(rotary),
            TermKind::Controller(of) => vec![of.setting.parameter(rotary)],
            TermKind::Joints(ref of) => {
                let different = if of.common { 1 } else { of.members.len() };
                of.members[..different].iter().flat_map(|m| m.parameters(rotary)).collect()
            }
            TermKind::Row(row) => row.parameters(rotary),
            TermKind::Table(_) => [CLASS; CLASSES].iter().map(free).collect(),
        }
    }

    /// Number of leading parameters in which the term's torque is linear, or nearly so ([`Self::unit`]), and with which it vanishes when all of them
    /// are at their neutral values; 0 where the torque is linear in no parameter.
    pub fn amplitudes(&self) -> usize {
        match self.kind {
            TermKind::Law(effect) => {
                let spec = effect.law.spec();
                let is_linear = !spec.hooks.command
                    && spec.parameters.first().is_some_and(|p| p.quantity != Quantity::Reach);
                match spec.trial {
                    Trial::Amplitudes(count) if is_linear => count,
                    _ => 0,
                }
            }
            TermKind::Payload | TermKind::Transmission(_) | TermKind::Controller(_) => 0,
            TermKind::BaseTilt(axes) => axes.len(),
            TermKind::NominalLink(_) => LINK_NAMES.len(),
            TermKind::Joints(ref of) => of.members[0].amplitudes(),
            TermKind::Row(RowTerm { law: RowLaw::Transmission(_), .. }) => 3,
            TermKind::Row(_) => 1,
            TermKind::Table(_) => CLASSES,
        }
    }

    /// Value of an amplitude at which the torque per unit of this amplitude is computed: one, or the initial guess of an effect on measured
    /// positions, whose torque is linear for small displacements only.
    pub fn unit(&self) -> f64 {
        match self.kind {
            TermKind::Law(effect) if effect.law.spec().hooks.measured => {
                effect.p.iter().map(|p| p.abs()).fold(0.0, f64::max)
            }
            _ => 1.0,
        }
    }

    /// Whether the model search tries the term on each joint separately.
    pub fn is_of_a_joint(&self) -> bool {
        match self.kind {
            TermKind::Law(effect) => effect.law.spec().scope == Scope::Joint,
            TermKind::Transmission(_) | TermKind::Controller(_) => true,
            TermKind::Payload
            | TermKind::BaseTilt(_)
            | TermKind::NominalLink(_)
            | TermKind::Joints(_)
            | TermKind::Row(_)
            | TermKind::Table(_) => false,
        }
    }

    /// Whether the term changes the torque that a command gives at the joint: by a change of the command, or by a torque that depends on the command.
    pub fn changes_command(&self) -> bool {
        if let TermKind::Joints(of) = &self.kind {
            return of.members[0].changes_command();
        }
        if let TermKind::Table(table) = &self.kind {
            return table.changes_command();
        }
        let TermKind::Law(effect) = self.kind else { return self.share_of_command().is_some() };
        effect.law.spec().hooks.command || depends(&effect, |x, value| x.tau = value)
    }

    /// Factor by which a changed proportional gain multiplies the controller's torque; `None` for other terms (a derivative gain acts like viscous
    /// friction).
    pub fn share_of_command(&self) -> Option<f64> {
        matches!(self.kind, TermKind::Controller(of) if of.setting == Setting::Gain).then(|| self.p[0])
    }

    /// Whether friction with the term still dissipates in both directions at rest, where the joints have the Coulomb friction `coulomb`, N m or N, up to
    /// a tenth of it: friction that drives a joint is a torque.
    pub fn dissipates(&self, coulomb: &[f64]) -> bool {
        let rubs = |effect: &EffectInstance| effect.law.spec().hooks.coulomb;
        self.members().iter().filter_map(Term::effect).filter(rubs).all(|effect| {
            let level = coulomb[effect.joint];
            let at = |direction: f64| JointPoint {
                t: 0.0,
                q: 0.0,
                dq: 0.0,
                friction: level,
                other: direction,
                ..POINT
            };
            let added = |direction: f64| effect.law.coulomb(&effect.p, &at(direction), direction);
            added(1.0).min(added(-1.0)) >= -(1.0 + UNCERTAIN_FRICTION) * level
        })
    }

    /// Whether the term is a factor on the torque command.
    pub fn is_gain(&self) -> bool {
        if let TermKind::Joints(of) = &self.kind {
            return of.members[0].is_gain();
        }
        let TermKind::Law(effect) = self.kind else { return false };
        let spec = effect.law.spec();
        spec.hooks.command && spec.parameters.iter().all(|p| p.quantity == Quantity::Ratio)
    }

    /// Whether the term is a delay or lag of the command or the reference: all of its parameters are times.
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

    /// The term with its parameters' values replaced by `p`, SI.
    pub fn with(&self, p: Vec<f64>) -> Self {
        Self { kind: self.kind.clone(), p, degrees: self.degrees }
    }

    /// The library's effect with the term's values; `None` for a term that is no effect of the library on one joint.
    pub fn effect(&self) -> Option<EffectInstance> {
        let TermKind::Law(mut effect) = self.kind else { return None };
        for (slot, value) in effect.p.iter_mut().zip(&self.p) {
            *slot = *value;
        }
        Some(effect)
    }
}

/// State of a joint at which laws are compared.
const POINT: JointPoint<f64> =
    JointPoint { t: 1.0, q: 0.1, dq: 1.0, tau: 0.5, load: 0.5, friction: 1.0, other: 1.0, memory: 0.0 };

/// Share of a joint's Coulomb friction by which a term's may exceed it, as both are estimates.
const UNCERTAIN_FRICTION: f64 = 0.1;

/// Whether an effect's torque depends on the quantity of the joint's state (position, velocity, torque) that `set` assigns.
fn depends(effect: &EffectInstance, set: impl Fn(&mut JointPoint<f64>, f64)) -> bool {
    let torque = |value: f64| {
        let mut x = POINT;
        set(&mut x, value);
        effect.law.force(&effect.p, &x) - effect.law.coulomb(&effect.p, &x, 1.0)
    };
    torque(1.0) != torque(2.0)
}

/// Change of the last link's ten inertial parameters by a point mass `p = (mass, x, y, z)`, kg and m in the link's frame: mass, first moments,
/// inertia about the link's origin (xx, xy, yy, xz, yz, zz).
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

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    #[test]
    fn friction_with_a_term_dissipates_or_drives() {
        let dissipates = |name: &str, p: [f64; 3]| {
            Term::of_law(EffectInstance::new(find(name).unwrap(), 0, p)).dissipates(&[1.0])
        };
        assert!(dissipates("coulomb_asymmetry", [0.9, 0.0, 0.0]));
        assert!(!dissipates("coulomb_asymmetry", [-1.5, 0.0, 0.0]));
        assert!(dissipates("stribeck", [3.0, 0.1, 0.0]) && !dissipates("stribeck", [-3.0, 0.1, 0.0]));
        assert!(dissipates("torque_offset", [-9.0, 0.0, 0.0]), "a torque is no friction");
    }
}
