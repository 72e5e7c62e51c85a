//! Which network is joined: by options, then by the variables of ROS 2, else loopback alone.

use std::net::IpAddr;

/// Largest domain whose ports exist.
const LAST_DOMAIN: u16 = 232;

/// How far messages go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NetworkReach {
    /// This machine.
    Loopback,
    /// The network of one address, and this machine.
    Interface(IpAddr),
    /// All networks of this machine.
    All,
}

impl NetworkReach {
    /// In words; those for this machine are the network's own.
    pub(crate) fn words(self, loopback: &str) -> String {
        match self {
            Self::Loopback => loopback.to_owned(),
            Self::Interface(address) => format!("{address} and 127.0.0.1"),
            Self::All => "all interfaces".to_owned(),
        }
    }
}

/// A ROS 2 network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Ros2Network {
    pub(crate) domain: u16,
    pub(crate) reach: NetworkReach,
    /// What decided the reach.
    pub(crate) from: String,
    /// Variables that are set and have no effect here.
    pub(crate) warning: Option<String>,
}

impl Ros2Network {
    /// The network by options and by `variable`, which looks up the environment.
    ///
    /// # Errors
    /// Where a variable has a value that ROS 2 does not define.
    pub(crate) fn choose(
        domain: Option<u16>,
        reach: Option<NetworkReach>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<Self, String> {
        let variable = |name: &str| variable(name).filter(|value| !value.is_empty());
        let domain = match (domain, variable("ROS_DOMAIN_ID")) {
            (Some(domain), _) => domain,
            (None, Some(text)) => {
                text.parse().map_err(|_| format!("ROS_DOMAIN_ID is {text:?}, expected 0 to {LAST_DOMAIN}"))?
            }
            (None, None) => 0,
        };
        if domain > LAST_DOMAIN {
            return Err(format!("domain {domain}, expected 0 to {LAST_DOMAIN}"));
        }
        let (reach, from) = match reach {
            Some(reach) => (reach, "--network".to_owned()),
            None => from_environment(&variable)?,
        };
        let warning = variable("ROS_STATIC_PEERS").map(|peers| {
            format!("ROS_STATIC_PEERS is {peers:?} and has no effect: peers are found by multicast, or on this machine")
        });
        Ok(Self { domain, reach, from, warning })
    }
}

fn from_environment(variable: &impl Fn(&str) -> Option<String>) -> Result<(NetworkReach, String), String> {
    // Deprecated from Iron on, and where it is 1 it wins over what came after it.
    match variable("ROS_LOCALHOST_ONLY").as_deref() {
        Some("1") => return Ok((NetworkReach::Loopback, "ROS_LOCALHOST_ONLY".to_owned())),
        None | Some("0") => {}
        Some(other) => return Err(format!("ROS_LOCALHOST_ONLY is {other:?}, expected 0 or 1")),
    }
    const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";
    let Some(range) = variable(RANGE) else {
        return Ok((NetworkReach::Loopback, "the default; --network all opens it".to_owned()));
    };
    let reach = match range.as_str() {
        "SUBNET" | "SYSTEM_DEFAULT" => NetworkReach::All,
        "LOCALHOST" => NetworkReach::Loopback,
        "OFF" => return Err(format!("{RANGE} is OFF: no topic would be found")),
        _ => return Err(format!("{RANGE} is {range:?}, expected SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT")),
    };
    Ok((reach, format!("{RANGE}={range}")))
}

/// Parses `--network`.
///
/// # Errors
/// Says what is expected.
pub(crate) fn parse_reach(text: &str) -> Result<NetworkReach, String> {
    match text {
        "loopback" => Ok(NetworkReach::Loopback),
        "all" => Ok(NetworkReach::All),
        address => address
            .parse()
            .map(NetworkReach::Interface)
            .map_err(|_| "expected loopback, all, or the address of one interface".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network(variables: &[(&str, &str)]) -> Result<Ros2Network, String> {
        Ros2Network::choose(None, None, |name| {
            variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn the_variables_of_ros_decide_and_loopback_is_the_default() {
        let reach = |variables: &[(&str, &str)]| network(variables).unwrap().reach;
        let range = "ROS_AUTOMATIC_DISCOVERY_RANGE";
        assert_eq!((network(&[]).unwrap().domain, reach(&[])), (0, NetworkReach::Loopback));
        assert_eq!(reach(&[(range, "SUBNET")]), NetworkReach::All);
        assert_eq!(reach(&[(range, "LOCALHOST")]), NetworkReach::Loopback);
        assert_eq!(reach(&[("ROS_LOCALHOST_ONLY", "1"), (range, "SUBNET")]), NetworkReach::Loopback);
        assert_eq!(reach(&[("ROS_LOCALHOST_ONLY", "0"), (range, "SUBNET")]), NetworkReach::All);
        assert_eq!(network(&[("ROS_DOMAIN_ID", "42")]).unwrap().domain, 42);
        let given = Ros2Network::choose(Some(7), Some(NetworkReach::All), |_| Some("1".to_owned())).unwrap();
        assert_eq!((given.domain, given.reach), (7, NetworkReach::All));
        assert!(network(&[("ROS_STATIC_PEERS", "a;b")]).unwrap().warning.unwrap().contains("no effect"));
    }

    #[test]
    fn values_that_ros_does_not_define_are_refused() {
        for (variable, value, words) in [
            ("ROS_DOMAIN_ID", "x", "expected 0 to 232"),
            ("ROS_DOMAIN_ID", "233", "expected 0 to 232"),
            ("ROS_LOCALHOST_ONLY", "yes", "expected 0 or 1"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF", "no topic would be found"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ALL", "expected SUBNET"),
        ] {
            let error = network(&[(variable, value)]).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
        assert!(parse_reach("wlan0").is_err() && parse_reach("10.0.0.2").is_ok());
    }
}
