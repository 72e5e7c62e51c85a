//! The command and supervisor.
#![forbid(unsafe_code)]
