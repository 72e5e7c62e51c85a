//! Many robots, one map, over Zenoh.
//!
//! On each robot an uplink follows a run directory and answers for its bytes; a base copies the run
//! directories of all robots and makes one map of them. The base asks, by offset: what it has on disk is
//! where it goes on, whatever dies in between. A run that leaves its optimisations to the base gets the
//! base's answers from its uplink; of other runs the uplink reads alone.
#![forbid(unsafe_code)]

pub mod answer;
mod answering;
pub mod arguments;
pub mod arrivals;
mod asked;
pub mod base;
pub mod carrier;
pub mod chaos;
pub mod checked;
mod checked_record;
mod disk;
pub mod error;
mod feature_wire;
pub mod inbox;
mod joint_surfaces;
pub mod journal_copy;
pub mod local;
pub mod looking;
pub mod map;
mod mapper;
pub mod network;
mod past;
mod picture;
pub mod piece;
mod received;
pub mod replica;
pub mod report;
mod scene;
pub mod served;
pub mod session;
mod shared;
mod shown;
pub mod status;
pub mod store_copy;
pub mod summary;
pub mod surface_copy;
pub mod surface_wire;
pub mod traffic;
pub mod uplink;
mod visit;
pub mod wire;
