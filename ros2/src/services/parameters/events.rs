//! `/parameter_events`: the parameters as they were declared, told once to those who listen. None changes while the
//! program runs, so that nothing else is told there.

use super::table::NodeParameter;
use super::wire::ParameterValue;
use crate::carrier::{Carrier, CarrierError, PARAMETER_EVENT, Publication, Quality};
use crate::error::Ros2Error;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};
use tessera_recording::ros::{Time, encode};

const TOPIC: &str = "/parameter_events";
/// As rclcpp has it.
const QUALITY: Quality = Quality { depth: 1000, ..Quality::DEFAULT };
/// Time between two looks for a reader. One that was seen knows this writer at the next look.
const LOOK: Duration = Duration::from_secs(1);

/// The topic, until its one message is sent.
pub(super) struct ParameterEvents {
    publication: Box<dyn Publication>,
    looked_at: Option<Instant>,
    is_seen: bool,
    is_told: bool,
}

/// `rcl_interfaces/msg/ParameterEvent`; a parameter is its name and its value.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ParameterEvent {
    pub(super) stamp: Time,
    /// With its namespace.
    pub(super) node: String,
    pub(super) new_parameters: Vec<(String, ParameterValue)>,
    pub(super) changed_parameters: Vec<(String, ParameterValue)>,
    pub(super) deleted_parameters: Vec<(String, ParameterValue)>,
}

impl ParameterEvents {
    /// Announces the topic.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(super) fn new(carrier: &mut dyn Carrier) -> Result<Self, CarrierError> {
        let publication = carrier.publish(TOPIC, PARAMETER_EVENT, QUALITY)?;
        Ok(Self { publication, looked_at: None, is_seen: false, is_told: false })
    }

    /// Sends the parameters of `node` once there is a reader, with the time of the node's clock.
    ///
    /// # Errors
    /// Where the message cannot be written as CDR, or the network refuses it.
    pub(super) fn step(
        &mut self,
        carrier: &dyn Carrier,
        node: &str,
        parameters: &[NodeParameter],
        now_nanos: i64,
    ) -> Result<(), Ros2Error> {
        if self.is_told || self.looked_at.is_some_and(|looked| looked.elapsed() < LOOK) {
            return Ok(());
        }
        self.looked_at = Some(Instant::now());
        let was_seen = std::mem::replace(&mut self.is_seen, carrier.read_topics().contains(TOPIC));
        if !(was_seen && self.is_seen) {
            return Ok(());
        }
        self.is_told = true;
        Ok(self.publication.send(&declared(node, parameters, now_nanos)?)?)
    }
}

/// The message, with its encapsulation.
pub(super) fn declared(
    node: &str,
    parameters: &[NodeParameter],
    now_nanos: i64,
) -> Result<Vec<u8>, Ros2Error> {
    let of = |parameter: &NodeParameter| (parameter.name.clone(), parameter.value());
    Ok(encode(&ParameterEvent {
        stamp: Time::from_nanos(now_nanos),
        node: node.to_owned(),
        new_parameters: parameters.iter().map(of).collect(),
        changed_parameters: Vec::new(),
        deleted_parameters: Vec::new(),
    })?)
}
