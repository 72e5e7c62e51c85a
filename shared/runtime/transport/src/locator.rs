//! Locators of networks, such as `tcp/127.0.0.1:7447`: the programs of fleets and of ROS 2 keep to this machine
//! by them.

use serde_json::Value;
use std::net::IpAddr;

/// All locators of a configuration's value: a list, or lists for each mode.
///
/// # Errors
/// Where the text is no JSON.
pub fn locators_in(json: &str) -> serde_json::Result<Vec<String>> {
    fn collect(value: &Value, found: &mut Vec<String>) {
        match value {
            Value::String(text) => found.push(text.clone()),
            Value::Array(items) => items.iter().for_each(|item| collect(item, found)),
            Value::Object(items) => items.values().for_each(|item| collect(item, found)),
            Value::Null | Value::Bool(_) | Value::Number(_) => {}
        }
    }
    let mut found = Vec::new();
    collect(&serde_json::from_str(json)?, &mut found);
    Ok(found)
}

/// Whether a locator names this machine and none other.
pub fn is_loopback(locator: &str) -> bool {
    let address = locator.split_once('/').map_or(locator, |(_, address)| address);
    let address = address.split(['#', '?']).next().unwrap_or_default();
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    host == "localhost" || host.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}
