//! The configuration of a session: as rmw_zenoh has it by default, or from the files and variables that
//! rmw_zenoh reads; and never beyond this machine unless the network was opened.

use crate::error::Ros2Error;
use crate::network::reach::{NetworkReach, Ros2Network};
use std::net::IpAddr;
use tessera_transport::{is_loopback, locators_in};
use zenoh::Config;

/// Variable with the path of a session's configuration, and the one with single keys over it.
const FILE: &str = "ZENOH_SESSION_CONFIG_URI";
const OVERRIDE: &str = "ZENOH_CONFIG_OVERRIDE";
/// Where rmw_zenoh's router is.
const ROUTER: &str = "tcp/127.0.0.1:7447";
const CONNECT: &str = "connect/endpoints";
const LISTEN: &str = "listen/endpoints";

/// A configuration, and what it says, for people.
pub(super) struct Configuration {
    pub(super) config: Config,
    /// Endpoints that are connected to.
    pub(super) routers: String,
    /// What decided that.
    pub(super) from: String,
}

/// The configuration for a network; `variable` looks up the environment.
///
/// # Errors
/// Where a file or variable cannot be used, or would leave this machine and the network was not opened.
pub(super) fn configuration(
    network: &Ros2Network,
    variable: impl Fn(&str) -> Option<String>,
) -> Result<Configuration, Ros2Error> {
    let variable = |name: &str| variable(name).filter(|value| !value.is_empty());
    let mut from = "rmw_zenoh's default".to_owned();
    let mut config = match variable(FILE) {
        Some(path) => {
            from = format!("{FILE} {path}");
            Config::from_file(&path)
                .map_err(|error| Ros2Error::Arguments(format!("{FILE}: {path}: {error}")))?
        }
        None => default()?,
    };
    if let Some(keys) = variable(OVERRIDE) {
        from = if variable(FILE).is_some() { format!("{from} and {OVERRIDE}") } else { OVERRIDE.to_owned() };
        for pair in keys.split(';').filter(|pair| !pair.trim().is_empty()) {
            let (key, value) = pair.split_once('=').ok_or_else(|| {
                Ros2Error::Arguments(format!("{OVERRIDE}: {pair:?}, expected KEY=VALUE;KEY=VALUE"))
            })?;
            set(&mut config, OVERRIDE, (key.trim(), value.trim()))?;
        }
    }
    match network.reach {
        NetworkReach::Loopback => keep_to_loopback(&mut config, &from)?,
        NetworkReach::Interface(address) => listen(&mut config, &[address, IpAddr::from([127, 0, 0, 1])])?,
        NetworkReach::All if variable(FILE).is_some() => {}
        NetworkReach::All => listen(&mut config, &[IpAddr::from([0; 16])])?,
    }
    for (key, value) in [
        // What is kept for late readers is kept by time.
        ("timestamping/enabled", "true"),
        // The router may come later, go, and come back.
        ("connect/timeout_ms", "-1"),
        ("connect/exit_on_failure", "false"),
        ("connect/retry", "{ period_init_ms: 200, period_max_ms: 1000, period_increase_factor: 2 }"),
    ] {
        set(&mut config, key, (key, value))?;
    }
    let routers = endpoints(&config)?.join(", ");
    Ok(Configuration { config, routers, from })
}

/// As rmw_zenoh's own file has it: a peer that learns of others from the router of this machine.
fn default() -> Result<Config, Ros2Error> {
    let mut config = Config::default();
    let router = format!("[{ROUTER:?}]");
    for (key, value) in [("mode", "\"peer\""), (CONNECT, &router), ("scouting/multicast/enabled", "false")] {
        set(&mut config, key, (key, value))?;
    }
    Ok(config)
}

fn set(config: &mut Config, from: &str, (key, value): (&str, &str)) -> Result<(), Ros2Error> {
    let set = config.insert_json5(key, value);
    set.map_err(|error| Ros2Error::Arguments(format!("{from}: {key}={value}: {error}")))
}

fn listen(config: &mut Config, addresses: &[IpAddr]) -> Result<(), Ros2Error> {
    let locator = |address: &IpAddr| match address {
        IpAddr::V4(address) => format!("\"tcp/{address}:0\""),
        IpAddr::V6(address) => format!("\"tcp/[{address}]:0\""),
    };
    let all: Vec<String> = addresses.iter().map(locator).collect();
    set(config, "--network", (LISTEN, &format!("[{}]", all.join(","))))
}

fn keep_to_loopback(config: &mut Config, from: &str) -> Result<(), Ros2Error> {
    for endpoint in endpoints(config)? {
        if !is_loopback(&endpoint) {
            return Err(Ros2Error::Arguments(format!(
                "{from} connects to {endpoint}, and messages are to stay on this machine: --network all opens it"
            )));
        }
    }
    listen(config, &[IpAddr::from([127, 0, 0, 1])])?;
    set(config, "--network", ("scouting/multicast/enabled", "false"))
}

/// All endpoints that are connected to, also where they are given for each mode.
fn endpoints(config: &Config) -> Result<Vec<String>, Ros2Error> {
    let wrong = |error: String| Ros2Error::Arguments(format!("{CONNECT}: {error}"));
    let json = config.get_json(CONNECT).map_err(|error| wrong(error.to_string()))?;
    locators_in(&json).map_err(|error| wrong(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(reach: NetworkReach, variables: &[(&str, &str)]) -> Result<Configuration, String> {
        let network = Ros2Network { domain: 0, reach, from: String::new(), warning: None };
        let variable =
            |name: &str| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        configuration(&network, variable).map_err(|error| error.to_string())
    }

    fn listens(configuration: &Configuration) -> String {
        configuration.config.get_json(LISTEN).unwrap()
    }

    #[test]
    fn loopback_alone_is_the_default() {
        let found = of(NetworkReach::Loopback, &[]).unwrap();
        assert_eq!(found.routers, ROUTER);
        assert_eq!(listens(&found), "[\"tcp/127.0.0.1:0\"]");
        assert_eq!(found.config.get_json("scouting/multicast/enabled").unwrap(), "false");
        assert!(listens(&of(NetworkReach::All, &[]).unwrap()).contains("tcp/[::]:0"));
        let one = of(NetworkReach::Interface(IpAddr::from([10, 0, 0, 2])), &[]).unwrap();
        assert_eq!(listens(&one), "[\"tcp/10.0.0.2:0\",\"tcp/127.0.0.1:0\"]");
    }

    #[test]
    fn variables_of_rmw_zenoh_are_read_and_cannot_leave_this_machine_unasked() {
        let local = [(OVERRIDE, "connect/endpoints=[\"tcp/localhost:9\"];mode=\"client\"")];
        let found = of(NetworkReach::Loopback, &local).unwrap();
        assert_eq!((found.routers.as_str(), found.from.as_str()), ("tcp/localhost:9", OVERRIDE));
        let far = [(OVERRIDE, "connect/endpoints={ peer: [\"tcp/10.0.0.2:7447#iface=eth0\"] }")];
        let words = of(NetworkReach::Loopback, &far).err().unwrap();
        assert!(
            words.contains("connects to tcp/10.0.0.2:7447") && words.contains("--network all"),
            "{words}"
        );
        assert!(of(NetworkReach::All, &far).is_ok());
        for (value, words) in [("mode", "expected KEY=VALUE"), ("no/such=1", "no/such")] {
            let error = of(NetworkReach::All, &[(OVERRIDE, value)]).err().unwrap();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_file_is_read_and_one_that_cannot_be_has_its_words() {
        let file = tempfile::Builder::new().suffix(".json5").tempfile().unwrap();
        std::fs::write(file.path(), "{ mode: 'peer', connect: { endpoints: ['tcp/[::1]:8'] } }").unwrap();
        let path = file.path().to_str().unwrap();
        let found = of(NetworkReach::Loopback, &[(FILE, path)]).unwrap();
        assert!(found.routers == "tcp/[::1]:8" && found.from.contains(path), "{}", found.from);
        assert_eq!(listens(&found), "[\"tcp/127.0.0.1:0\"]");
        let words = of(NetworkReach::Loopback, &[(FILE, "/no/such.json5")]).err().unwrap();
        assert!(words.contains("/no/such.json5"), "{words}");
    }
}
