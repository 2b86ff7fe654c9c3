//! What the core costs on the machine it runs on.

pub mod run;
