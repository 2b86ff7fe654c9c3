//! Names and units of a chain's parameters, which depend on the number of joints and their kinds.

use super::JointKind;
use super::inertia::LINK_PARAMETERS;
use core::fmt::{Display, Formatter, Result};

/// Parameters per joint: ten of its link, the rotor's inertia, viscous and Coulomb friction.
pub const PARAMETERS_PER_JOINT: usize = LINK_PARAMETERS + 3;

/// Name and unit of a link's ten numbers.
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

/// Rotor inertia, viscous and Coulomb friction: name, unit at a revolute joint, unit at a prismatic one.
const JOINT: [(&str, &str, &str); PARAMETERS_PER_JOINT - LINK_PARAMETERS] =
    [("rotor", "kg m^2", "kg"), ("viscous", "N m s/rad", "N s/m"), ("coulomb", "N m", "N")];

/// Name and unit of one parameter; shown as its name, for example `ixx2`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChainParameter {
    /// Name without the number, for example `ixx`.
    pub stem: &'static str,
    /// Number of the joint or link, from 1.
    pub number: usize,
    /// SI unit.
    pub unit: &'static str,
}

impl Display for ChainParameter {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{}{}", self.stem, self.number)
    }
}

/// The parameter at this index of `theta` for joints of these kinds; `None` beyond the last, 13 per joint: ten of each link, link by
/// link, then rotor inertias, then viscous, then Coulomb coefficients.
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
