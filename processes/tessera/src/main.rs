//! The `tessera` executable: the command, the supervisor and, on request, any one stage.
#![forbid(unsafe_code)]

fn main() {}
