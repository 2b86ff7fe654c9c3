//! The online estimator for C and C++.
//!
//! This crate only converts: pointers are checked for null and alignment, lengths against the arm's, and all computation is that of
//! [`armgap_core::online`]. `include/armgap.h` is made from the files of this crate; a test compares it with them.
#![cfg_attr(not(feature = "std"), no_std)]
// Units in brackets are for the header, which is made from these comments.
#![allow(non_camel_case_types, rustdoc::broken_intra_doc_links)]

mod chain;
mod chain_single;
mod chain_slot;
mod double;
mod settings;
mod simulate;
mod single;
mod slot;

pub use chain::*;
pub use chain_single::*;
pub use double::*;
pub use settings::*;
pub use simulate::*;
pub use single::*;

#[cfg(feature = "freestanding")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
