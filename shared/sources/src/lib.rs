//! Where frames come from: folders in the TUM layout and simulated rooms.
#![forbid(unsafe_code)]
