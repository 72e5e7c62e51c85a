//! What travels between the processes: plain data with a versioned name.
#![forbid(unsafe_code)]
