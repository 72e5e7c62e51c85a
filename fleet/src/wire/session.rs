//! A Zenoh session of an uplink or a base: what is set whatever the user's file says, and that nothing
//! speaks in the clear beyond this machine.

use crate::error::FleetError;
use std::path::Path;
use tessera_transport::{is_loopback, locators_in};
use zenoh::Config;

/// Sign of life after which a peer that is silent is gone, milliseconds.
const LEASE_MS: &str = "3000";
/// How long a blocked sender waits before it gives a link up, microseconds: a slow link is not a dead one.
const WAIT_BEFORE_CLOSE_US: &str = "60000000";
/// Largest message that is put together, bytes: far above every piece.
const MAX_MESSAGE_BYTES: &str = "16777216";

/// Which end.
#[derive(Clone, Debug)]
pub enum FleetEnd<'a> {
    /// The base listens.
    Base(Option<&'a str>),
    /// A robot connects.
    Robot(Option<&'a str>),
}

/// Where a base listens when nothing is said.
pub const DEFAULT_LISTEN: &str = "tcp/127.0.0.1:7447";

/// The configuration of an end; with a file, what is in it, and the locator over it.
///
/// # Errors
/// Where the file cannot be used, or plain tcp would leave this machine.
pub fn configuration(end: &FleetEnd<'_>, file: Option<&Path>) -> Result<Config, FleetError> {
    let mut config = match file {
        Some(path) => {
            Config::from_file(path).map_err(|e| FleetError::Arguments(format!("{}: {e}", path.display())))?
        }
        None => Config::default(),
    };
    let mut set = |key: &str, value: &str| {
        config.insert_json5(key, value).map_err(|e| FleetError::Network(format!("{key}: {e}")))
    };
    set("scouting/multicast/enabled", "false")?;
    set("scouting/gossip/enabled", "false")?;
    set("transport/link/tx/lease", LEASE_MS)?;
    set("transport/link/tx/queue/congestion_control/block/wait_before_close", WAIT_BEFORE_CLOSE_US)?;
    set("transport/link/rx/max_message_size", MAX_MESSAGE_BYTES)?;
    let list = |locator: &str| serde_json::to_string(&[locator]).unwrap_or_default();
    match end {
        FleetEnd::Base(locator) => {
            set("mode", "\"peer\"")?;
            if let Some(locator) = locator.or(file.is_none().then_some(DEFAULT_LISTEN)) {
                set("listen/endpoints", &list(locator))?;
            }
            set("connect/endpoints", "[]")?;
        }
        FleetEnd::Robot(locator) => {
            set("mode", "\"client\"")?;
            set("listen/endpoints", "[]")?;
            if let Some(locator) = locator {
                let separator = if locator.contains('#') { ';' } else { '#' };
                set("connect/endpoints", &list(&format!("{locator}{separator}so_sndbuf=65536")))?;
            }
            set("connect/timeout_ms", "-1")?;
            let retry = r#"{ period_init_ms: 200, period_max_ms: 1000, period_increase_factor: 2 }"#;
            set("connect/retry", retry)?;
        }
    }
    check_locators(&config, if matches!(end, FleetEnd::Base(_)) { "listen" } else { "connect" })?;
    Ok(config)
}

/// Refuses plain links that leave this machine.
fn check_locators(config: &Config, side: &str) -> Result<(), FleetError> {
    let locators = locators(config, side)?;
    if locators.is_empty() {
        return Err(FleetError::Arguments(format!(
            "no locator to {side}: give one such as {DEFAULT_LISTEN}"
        )));
    }
    for locator in locators {
        let is_safe = locator.starts_with("tls/") || (locator.starts_with("tcp/") && is_loopback(&locator));
        if !is_safe {
            return Err(FleetError::Arguments(format!(
                "{side} {locator}: expected tls/HOST:PORT, or tcp/ on this machine alone, such as {DEFAULT_LISTEN}; docs/fleet.md shows TLS"
            )));
        }
    }
    Ok(())
}

/// All locators of a side, also where they are given for each mode.
pub fn locators(config: &Config, side: &str) -> Result<Vec<String>, FleetError> {
    let text = config
        .get_json(&format!("{side}/endpoints"))
        .map_err(|e| FleetError::Network(format!("{side}/endpoints: {e}")))?;
    locators_in(&text).map_err(|e| FleetError::Network(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_links_stay_on_this_machine() {
        for good in ["tcp/127.0.0.1:7447", "tcp/[::1]:1", "tcp/localhost:7447", "tls/0.0.0.0:7447"] {
            assert!(configuration(&FleetEnd::Base(Some(good)), None).is_ok(), "{good}");
            assert!(configuration(&FleetEnd::Robot(Some(good)), None).is_ok(), "{good}");
        }
        for bad in ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/base.example:7447", "udp/127.0.0.1:7447"] {
            let message = configuration(&FleetEnd::Base(Some(bad)), None).unwrap_err().to_string();
            assert!(message.contains("expected tls/HOST:PORT"), "{message}");
            assert!(configuration(&FleetEnd::Robot(Some(bad)), None).is_err(), "{bad}");
        }
        let default = configuration(&FleetEnd::Base(None), None).unwrap();
        assert_eq!(locators(&default, "listen").unwrap(), [DEFAULT_LISTEN]);
    }

    #[test]
    fn a_file_keeps_its_locators_and_is_held_to_the_same() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("base.json5");
        std::fs::write(&path, r#"{ listen: { endpoints: ["tls/127.0.0.1:17447"] } }"#).unwrap();
        let config = configuration(&FleetEnd::Base(None), Some(&path)).unwrap();
        assert_eq!(locators(&config, "listen").unwrap(), ["tls/127.0.0.1:17447"]);
        std::fs::write(&path, r#"{ listen: { endpoints: ["tcp/0.0.0.0:17447"] } }"#).unwrap();
        assert!(configuration(&FleetEnd::Base(None), Some(&path)).is_err());
        std::fs::write(&path, r#"{ nonsense: 3 }"#).unwrap();
        assert!(
            configuration(&FleetEnd::Base(None), Some(&path)).unwrap_err().to_string().contains("base.json5")
        );
    }
}
