//! The robot's end: a run directory that answers for its bytes.

pub mod inbox;
pub mod served;
pub mod uplink;
