//! The paper's Table I on any sequences, and the whole system beside its peers.

mod columns;
mod markdown;
mod measure;
mod parts;
mod peers;
mod table;

pub use columns::columns;
pub use markdown::markdown;
pub use measure::{AblationPlan, ground_truth, measure};
pub use parts::Part;
pub use peers::Peers;
pub use table::Tables;
