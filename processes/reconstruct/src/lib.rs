//! The reconstruct stage.
#![forbid(unsafe_code)]
