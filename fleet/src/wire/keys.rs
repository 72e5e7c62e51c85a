//! Where robots are found in a Zenoh network.

/// Where a robot answers.
pub fn run_key(robot: &str) -> String {
    format!("fleet/{robot}/run")
}

/// The token by which a robot is known to be there.
pub fn alive_key(robot: &str) -> String {
    format!("fleet/{robot}/alive")
}
