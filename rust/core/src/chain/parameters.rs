//! Names and units of a chain's parameters, which depend on the number and the kinds of its joints.

use super::JointKind;
use super::inertia::LINK_PARAMETERS;
use core::fmt::{Display, Formatter, Result};

/// Parameters per joint of a chain: ten inertial ones of the link, rotor inertia, viscous and Coulomb friction.
pub const PARAMETERS_PER_JOINT: usize = LINK_PARAMETERS + 3;

/// Names and SI units of a link's ten inertial parameters.
pub const LINK_NAMES: [(&str, &str); LINK_PARAMETERS] = [
    ("mass", "kg"),
    ("mx", "kg m"),
    ("my", "kg m"),
    ("mz", "kg m"),
    ("ixx", "kg m^2"),
    ("ixy", "kg m^2"),
    ("iyy", "kg m^2"),
    ("ixz", "kg m^2"),
    ("iyz", "kg m^2"),
    ("izz", "kg m^2"),
];

/// Rotor inertia, viscous and Coulomb friction of a joint: name, unit at a revolute joint, unit at a prismatic joint.
const JOINT: [(&str, &str, &str); PARAMETERS_PER_JOINT - LINK_PARAMETERS] =
    [("rotor", "kg m^2", "kg"), ("viscous", "N m s/rad", "N s/m"), ("coulomb", "N m", "N")];

/// Name and unit of one parameter of a chain; displayed as stem and number, for example `ixx2`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChainParameter {
    /// Name of the parameter without the number of its joint or link, for example `ixx`.
    pub stem: &'static str,
    /// Number of the parameter's joint or link, from 1.
    pub number: usize,
    /// SI unit of the parameter, for example `kg m^2`.
    pub unit: &'static str,
}

impl Display for ChainParameter {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}{}", self.stem, self.number)
    }
}

/// Parameter at `index` of `theta` of a chain with joints of these kinds: ten per link, link by link, then rotor inertias, then viscous, then
/// Coulomb coefficients; `None` beyond the last.
pub fn parameter(kinds: &[JointKind], index: usize) -> Option<ChainParameter> {
    let inertial = LINK_PARAMETERS * kinds.len();
    if index < inertial {
        let (stem, unit) = *LINK_NAMES.get(index % LINK_PARAMETERS)?;
        return Some(ChainParameter { stem, number: index / LINK_PARAMETERS + 1, unit });
    }
    let j = (index - inertial).checked_rem(kinds.len())?;
    let (stem, turns, slides) = *JOINT.get((index - inertial).checked_div(kinds.len())?)?;
    let unit = if *kinds.get(j)? == JointKind::Revolute { turns } else { slides };
    Some(ChainParameter { stem, number: j + 1, unit })
}
