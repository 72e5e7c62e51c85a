//! The optimise stage.
#![forbid(unsafe_code)]
