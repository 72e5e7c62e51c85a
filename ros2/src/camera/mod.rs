//! The camera's topics, and its images into the run.

mod first;
mod going;
mod gyro;
pub(crate) mod input;
mod pairing;
pub(crate) mod sender;
pub(crate) mod topics;
