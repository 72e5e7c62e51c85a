//! Choice of what carries messages: by option, then by the variable of ROS 2, else DDS.

use crate::carrier::{Carrier, NodeName};
use crate::error::Ros2Error;
use crate::network::dds::Dds;
use crate::network::reach::Ros2Network;
use crate::report::Report;
use std::sync::atomic::AtomicBool;

/// Variable of ROS 2 that names its middleware, and the one that is Zenoh.
const VARIABLE: &str = "RMW_IMPLEMENTATION";
const RMW_ZENOH: &str = "rmw_zenoh_cpp";

/// What can carry messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum CarrierKind {
    /// As rmw_cyclonedds and rmw_fastrtps.
    Dds,
    /// As rmw_zenoh.
    Zenoh,
}

impl CarrierKind {
    fn choose(given: Option<Self>, variable: Option<&str>) -> Self {
        given.unwrap_or(match variable {
            Some(RMW_ZENOH) => Self::Zenoh,
            _ => Self::Dds,
        })
    }
}

/// What stands by while a network is joined that is not there yet.
#[cfg_attr(not(feature = "zenoh"), expect(dead_code, reason = "DDS waits for none"))]
pub(crate) struct Waiting<'a> {
    pub(crate) is_stopped: &'a AtomicBool,
    pub(crate) report: &'a Report,
}

/// Joins a network as a node of that name.
///
/// # Errors
/// Where it cannot be joined, or the program was built without what it needs.
pub(crate) fn open(
    given: Option<CarrierKind>,
    network: &Ros2Network,
    name: NodeName,
    #[cfg_attr(not(feature = "zenoh"), expect(unused_variables, reason = "DDS waits for none"))]
    waiting: &Waiting<'_>,
) -> Result<Box<dyn Carrier>, Ros2Error> {
    match CarrierKind::choose(given, std::env::var(VARIABLE).ok().as_deref()) {
        CarrierKind::Dds => Ok(Box::new(Dds::open(network, name)?)),
        #[cfg(feature = "zenoh")]
        CarrierKind::Zenoh => Ok(Box::new(crate::network::zenoh::Zenoh::open(network, name, waiting)?)),
        #[cfg(not(feature = "zenoh"))]
        CarrierKind::Zenoh => {
            let from =
                given.map_or(format!("{VARIABLE} is {RMW_ZENOH}"), |_| "--carrier is zenoh".to_owned());
            Err(Ros2Error::Arguments(format!(
                "{from}, and this program was built without it: cargo build --release --manifest-path ros2/Cargo.toml --features zenoh; --carrier dds joins DDS"
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_wins_over_the_variable_and_dds_is_the_default() {
        let choose = CarrierKind::choose;
        assert_eq!(choose(None, None), CarrierKind::Dds);
        assert_eq!(choose(None, Some("rmw_fastrtps_cpp")), CarrierKind::Dds);
        assert_eq!(choose(None, Some("rmw_zenoh_cpp")), CarrierKind::Zenoh);
        assert_eq!(choose(Some(CarrierKind::Dds), Some("rmw_zenoh_cpp")), CarrierKind::Dds);
        assert_eq!(choose(Some(CarrierKind::Zenoh), None), CarrierKind::Zenoh);
    }
}
