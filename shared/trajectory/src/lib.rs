//! TUM trajectory files, association by time, and the errors ATE and RPE.
#![forbid(unsafe_code)]
