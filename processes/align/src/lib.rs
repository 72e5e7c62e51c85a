//! The align stage.
#![forbid(unsafe_code)]
