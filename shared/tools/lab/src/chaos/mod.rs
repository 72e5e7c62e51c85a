//! `tessera chaos`: faults on purpose, and the proof that they changed nothing.
//!
//! Faults come from outside, as a user's machine would bring them: signals, limits, damaged files.
//! Only `drop`, `corrupt` and exact plans reach into the stages, through their kill points.

mod camera;
mod campaign;
mod damage;
mod disturb;
mod journal;
mod journaled;
mod leftovers;
mod plan_file;
mod process;
mod recovery;
mod report;
mod schedule;
mod strike;
mod trial;
mod verdict;

pub use campaign::{Campaign, OnRun, attach, campaign};
pub use report::ChaosReport;
pub use schedule::{FaultKind, FaultTarget};
