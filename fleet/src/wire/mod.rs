//! What travels between a base and its robots, and by which way.

pub mod carrier;
mod features;
pub mod keys;
pub mod piece;
pub mod request;
pub mod session;
pub mod surfaces;
