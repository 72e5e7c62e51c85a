//! What a run leaves for its user: pure functions of the run directory.
