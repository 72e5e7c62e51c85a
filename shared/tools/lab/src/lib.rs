//! The laboratory: experiments on a run and on the method that no robot needs on board.
//!
//! Faults on purpose ([`chaos`]), one stage alone on its recorded input ([`profile`]), what each
//! part of the method is worth ([`ablation`]), and what all processes did and when ([`trace`]).
#![forbid(unsafe_code)]

pub mod ablation;
pub mod chaos;
pub mod profile;
pub mod trace;
