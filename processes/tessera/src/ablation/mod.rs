//! The paper's Table I on any sequences, and the whole system beside its peers.

mod columns;
mod markdown;
mod measure;
mod peers;
mod plot;
mod table;

pub(crate) use columns::columns;
pub(crate) use markdown::markdown;
pub(crate) use measure::{Plan, ground_truth, measure};
pub(crate) use peers::Peers;
pub(crate) use plot::svg;
pub(crate) use table::Tables;
