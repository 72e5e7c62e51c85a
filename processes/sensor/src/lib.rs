//! The sensor stage.
#![forbid(unsafe_code)]
