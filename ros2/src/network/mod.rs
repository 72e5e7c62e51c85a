//! The network's side: what carries messages, which network is joined, and what it says of time.

mod dds;
pub(crate) mod open;
pub(crate) mod reach;
pub(crate) mod remap;
pub(crate) mod ros_time;
#[cfg(feature = "zenoh")]
mod zenoh;
