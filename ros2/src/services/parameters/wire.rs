//! Services of `rcl_interfaces/srv` and their content.

use crate::carrier::{RosType, Service};
use serde::{Deserialize, Serialize};
use tessera_recording::ros::decode_whole;

macro_rules! services {
    ($($constant:ident, $name:literal, $read:ident, $hash:literal;)*) => {
        $(pub(super) const $constant: Service = Service {
            kind: RosType { name: concat!("rcl_interfaces/srv/", $name), hash: concat!("RIHS01_", $hash) },
            request: RosType { name: concat!("rcl_interfaces/srv/", $name, "_Request"), hash: "" },
            response: RosType { name: concat!("rcl_interfaces/srv/", $name, "_Response"), hash: "" },
            is_request: |message| $read(message).is_some(),
        };)*
    };
}

services! {
    LIST, "ListParameters", prefixes, "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d";
    GET, "GetParameters", names, "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc";
    TYPES, "GetParameterTypes", names, "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca";
    DESCRIBE, "DescribeParameters", names, "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff";
    SET, "SetParameters", to_set, "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0";
    SET_ATOMICALLY, "SetParametersAtomically", to_set, "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd";
}

/// `rcl_interfaces/msg/ParameterType`.
const BOOL: u8 = 1;
const DOUBLE: u8 = 3;
const STRING: u8 = 4;

/// `rcl_interfaces/msg/ParameterValue`; the default is one that is not set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct ParameterValue {
    /// `type` in the message.
    pub(super) kind: u8,
    bool_value: bool,
    integer_value: i64,
    double_value: f64,
    string_value: String,
    byte_array_value: Vec<u8>,
    bool_array_value: Vec<bool>,
    integer_array_value: Vec<i64>,
    double_array_value: Vec<f64>,
    string_array_value: Vec<String>,
}

impl ParameterValue {
    pub(super) fn flag(bool_value: bool) -> Self {
        Self { kind: BOOL, bool_value, ..Self::default() }
    }

    pub(super) fn number(double_value: f64) -> Self {
        Self { kind: DOUBLE, double_value, ..Self::default() }
    }

    pub(super) fn text(string_value: String) -> Self {
        Self { kind: STRING, string_value, ..Self::default() }
    }
}

/// `rcl_interfaces/msg/ParameterDescriptor`, without ranges.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct ParameterDescriptor {
    name: String,
    /// `type` in the message.
    kind: u8,
    pub(super) description: String,
    additional_constraints: String,
    pub(super) read_only: bool,
    dynamic_typing: bool,
    floating_point_range: Vec<f64>,
    integer_range: Vec<i64>,
}

impl ParameterDescriptor {
    /// Of a parameter that is read when the program starts.
    pub(super) fn of(name: &str, kind: u8, description: String) -> Self {
        let additional_constraints = "read when the program starts".to_owned();
        Self { kind, description, additional_constraints, read_only: true, ..Self::unknown(name) }
    }

    /// What a name is given that no parameter has.
    pub(super) fn unknown(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }
}

/// `rcl_interfaces/msg/ListParametersResult`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(Deserialize))]
pub(super) struct Listed {
    pub(super) names: Vec<String>,
    pub(super) prefixes: Vec<String>,
}

/// `rcl_interfaces/msg/SetParametersResult`.
#[derive(Debug, Serialize)]
pub(super) struct SetResult {
    pub(super) successful: bool,
    pub(super) reason: String,
}

/// The names of a request for values, types or descriptions; `None` where it is no such request.
pub(super) fn names(request: &[u8]) -> Option<Vec<String>> {
    decode_whole("names of parameters", request).ok()
}

/// The prefixes of a request for names, however deep.
pub(super) fn prefixes(request: &[u8]) -> Option<Vec<String>> {
    decode_whole("prefixes of parameters", request).ok().map(|(prefixes, _depth): (_, u64)| prefixes)
}

/// The names of parameters that are to be set, without their values: none is.
pub(super) fn to_set(request: &[u8]) -> Option<Vec<String>> {
    let all: Vec<(String, ParameterValue)> = decode_whole("parameters to set", request).ok()?;
    Some(all.into_iter().map(|(name, _)| name).collect())
}
