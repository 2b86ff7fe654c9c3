//! armgap-core: dynamics, simulation and online estimation of robot arms, for controllers to embed.
//!
//! Arm dynamics, a dry-friction integrator, the discrete filters and the recursive least squares of Reyes and
//! Kelly (1997), *Experimental evaluation of identification schemes on a direct drive robot*, Robotica 15,
//! 563-571. No standard library, no allocation, no panic; `f64` and `f32`.
#![no_std]
// With the standard library, the processor's own instructions need unsafe code (`cpu`): the call into code compiled for them, and vector instructions
// by name.
#![cfg_attr(not(feature = "std"), forbid(unsafe_code))]

#[cfg(feature = "std")]
extern crate std;

// The README's example is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}

pub mod arm;
pub mod chain;
pub mod cpu;
pub mod drivetrain;
pub mod effect;
pub mod filter;
pub mod fixed_mode;
pub mod hyperbolic;
pub mod identify;
pub mod integrate;
pub mod kinematics;
pub mod lanes;
pub mod linear;
pub mod monitor;
pub mod number;
pub mod online;
pub mod plant;
pub mod real;
pub mod regression;
pub mod rls;
pub mod rollout;
pub mod transmission;
pub mod trig;
