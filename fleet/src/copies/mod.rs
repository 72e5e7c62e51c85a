//! Copies of robots' runs at the base, each byte of them checked before it is written down.

pub mod arrivals;
mod asked;
pub mod checked;
mod checked_record;
pub mod journal;
pub mod local;
pub mod replica;
pub mod store;
pub mod surfaces;
