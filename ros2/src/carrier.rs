//! What carries messages of ROS 2: topics with types and qualities of service, messages as bytes of
//! CDR behind their encapsulation of four bytes.

use std::collections::BTreeSet;
use std::time::Duration;

/// A type of ROS 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RosType {
    /// As `sensor_msgs/msg/Image`.
    pub(crate) name: &'static str,
    /// Its hash from Iron on, REP 2011.
    pub(crate) hash: &'static str,
}

macro_rules! types {
    ($($constant:ident, $name:literal, $hash:literal;)*) => {
        $(pub(crate) const $constant: RosType = RosType { name: $name, hash: concat!("RIHS01_", $hash) };)*
        /// All types that are read or written here.
        #[cfg(test)]
        pub(crate) const TYPES: &[RosType] = &[$($constant),*];
    };
}

types! {
    IMAGE, "sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47";
    CAMERA_INFO, "sensor_msgs/msg/CameraInfo", "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275";
    COMPRESSED, "sensor_msgs/msg/CompressedImage", "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a";
    ODOMETRY, "nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0";
    PATH, "nav_msgs/msg/Path", "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b";
    TRANSFORMS, "tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
    CLOUD, "sensor_msgs/msg/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5";
    GRID, "nav_msgs/msg/OccupancyGrid", "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7";
    GRID_UPDATE, "map_msgs/msg/OccupancyGridUpdate", "c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8";
    CLOCK, "rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564";
    IMU, "sensor_msgs/msg/Imu", "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b";
    INITIAL_POSE, "geometry_msgs/msg/PoseWithCovarianceStamped", "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
    PARAMETER_EVENT, "rcl_interfaces/msg/ParameterEvent", "043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204";
    DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e";
}

impl RosType {
    /// As DDS has it, and rmw_zenoh too: `sensor_msgs::msg::dds_::Image_`.
    pub(crate) fn in_dds(&self) -> String {
        let (package, rest) = self.name.split_once('/').unwrap_or(("", self.name));
        let (kind, name) = rest.split_once('/').unwrap_or(("msg", rest));
        format!("{package}::{kind}::dds_::{name}_")
    }
}

/// The name of a type as ROS has it, from that in DDS; as it is where it is not of ROS.
pub(crate) fn from_dds(name: &str) -> String {
    match name.split_once("::dds_::").and_then(|(front, name)| Some((front, name.strip_suffix('_')?))) {
        Some((front, name)) => format!("{}/{name}", front.replace("::", "/")),
        None => name.to_owned(),
    }
}

/// A service: what is asked and what is answered, each without a hash of its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Service {
    /// The service itself.
    pub(crate) kind: RosType,
    pub(crate) request: RosType,
    pub(crate) response: RosType,
    /// Whether a message with its encapsulation is a request of that type, by its length and content.
    pub(crate) is_request: fn(&[u8]) -> bool,
}

/// `std_srvs/srv/Trigger`.
pub(crate) const TRIGGER: Service = Service {
    kind: RosType {
        name: "std_srvs/srv/Trigger",
        hash: "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    },
    request: RosType { name: "std_srvs/srv/Trigger_Request", hash: "" },
    response: RosType { name: "std_srvs/srv/Trigger_Response", hash: "" },
    // A request without content is one byte, filled up to four.
    is_request: |message| message.len() <= ENCAPSULATION + 4,
};

/// Quality of service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Quality {
    /// What is lost is sent again.
    pub(crate) is_reliable: bool,
    /// Late readers get what was sent before: transient local.
    pub(crate) is_kept: bool,
    /// Messages that are kept.
    pub(crate) depth: u16,
}

impl Quality {
    /// Sensor data of ROS.
    pub(crate) const SENSOR: Self = Self { is_reliable: false, is_kept: false, depth: 5 };
    /// The default of ROS.
    pub(crate) const DEFAULT: Self = Self { is_reliable: true, is_kept: false, depth: 10 };
    /// `/tf`.
    pub(crate) const TRANSFORMS: Self = Self { is_reliable: true, is_kept: false, depth: 100 };
    /// What late readers are to have too, as `/map`.
    pub(crate) const LATCHED: Self = Self { is_reliable: true, is_kept: true, depth: 1 };
    /// `/tf_static` as it is read.
    pub(crate) const STATIC: Self = Self { is_reliable: true, is_kept: true, depth: 100 };

    /// Why a reader that requests this gets nothing from a writer that offers `offered`.
    pub(crate) fn mismatch(&self, offered: &Self) -> Option<&'static str> {
        if self.is_reliable && !offered.is_reliable {
            return Some("the writer is best effort, the reader wants reliable");
        }
        (self.is_kept && !offered.is_kept)
            .then_some("the writer is volatile, the reader wants transient local")
    }
}

/// A node's name.
#[derive(Clone, Debug)]
pub(crate) struct NodeName {
    /// With its namespace, as `/robot/tessera`.
    pub(crate) path: String,
    /// Whether others are of ROS 2 Humble, which has no type hashes, and identities of 24 bytes in DDS;
    /// later they have 16.
    pub(crate) is_humble: bool,
}

impl NodeName {
    /// Namespace and name: `/robot` and `tessera`, or `/` and `tessera`.
    pub(crate) fn split(&self) -> (&str, &str) {
        match self.path.rsplit_once('/') {
            Some(("", name)) => ("/", name),
            Some(split) => split,
            None => ("/", &self.path),
        }
    }
}

/// A topic that others write.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Seen {
    /// As `/camera/depth/image_raw`.
    pub(crate) topic: String,
    /// As `sensor_msgs/msg/Image`.
    pub(crate) kind: String,
}

/// Bytes before a message that say how it is written.
pub(crate) const ENCAPSULATION: usize = 4;

/// What was received: bytes with their encapsulation.
pub(crate) type Bytes = Vec<u8>;

/// Reads a topic.
pub(crate) trait Subscription {
    /// The oldest message that waits.
    fn take(&mut self) -> Result<Option<Bytes>, CarrierError>;
}

/// Writes a topic.
pub(crate) trait Publication {
    /// Sends a message, given with its encapsulation. Never waits for a reader.
    fn send(&mut self, message: &[u8]) -> Result<(), CarrierError>;
}

/// One who asked, as the carrier knows them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Client(pub(crate) Vec<u8>);

/// What a client asks, with its encapsulation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ServiceRequest {
    pub(crate) client: Client,
    pub(crate) request: Bytes,
}

/// Answers requests.
pub(crate) trait Server {
    /// The oldest request that waits.
    fn take(&mut self) -> Result<Option<ServiceRequest>, CarrierError>;
    /// Answers, with a message that has its encapsulation.
    fn answer(&mut self, client: &Client, message: &[u8]) -> Result<(), CarrierError>;
}

/// Carries messages between this process and a ROS 2 network.
pub(crate) trait Carrier {
    /// Reads a topic from now on.
    fn subscribe(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Subscription>, CarrierError>;
    /// Writes a topic.
    fn publish(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Publication>, CarrierError>;
    /// Answers requests of a service from now on.
    fn serve(&mut self, name: &str, service: Service) -> Result<Box<dyn Server>, CarrierError>;
    /// Sleeps until a message has come on a topic that is read, or for that long; whether one has.
    fn wait(&mut self, timeout: Duration) -> bool;
    /// Tells by name what this program reads and writes, where that has changed.
    fn introduce(&mut self) -> Result<(), CarrierError>;
    /// The topics that others write, in order, each once for each type.
    fn seen(&self) -> Vec<Seen>;
    /// The topics that others read.
    fn read_topics(&self) -> BTreeSet<String>;
    /// What keeps messages from being carried, each with the reason: readers and writers of others on our
    /// topics that cannot be joined to ours, or a program that must be there and is not.
    fn unmatched(&self) -> Vec<String>;
    /// Where no other program is heard: what was tried, and what would widen it, for people.
    fn alone(&self) -> Option<String> {
        None
    }
    /// Whether it has ended by itself, so that nothing is carried any more.
    fn has_ended(&mut self) -> bool {
        false
    }
    /// On what it listens and what may go wrong there, for people, a line each.
    fn words(&self) -> Vec<String>;
}

/// Why messages cannot be carried.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action}: {reason}")]
pub(crate) struct CarrierError {
    /// What was tried.
    pub(crate) action: String,
    /// Why not.
    pub(crate) reason: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_have_their_names_in_dds_and_back() {
        assert_eq!(IMAGE.in_dds(), "sensor_msgs::msg::dds_::Image_");
        for kind in TYPES {
            assert_eq!(from_dds(&kind.in_dds()), kind.name);
            assert_eq!(kind.hash.len(), "RIHS01_".len() + 64);
        }
        assert_eq!(from_dds("Plain"), "Plain");
    }

    #[test]
    fn a_reader_must_not_want_more_than_is_offered() {
        let (sensor, tf_static) = (Quality::SENSOR, Quality::STATIC);
        assert_eq!(sensor.mismatch(&Quality::DEFAULT), None);
        assert!(Quality::DEFAULT.mismatch(&sensor).unwrap().contains("best effort"));
        assert!(tf_static.mismatch(&Quality::DEFAULT).unwrap().contains("volatile"));
        assert_eq!(tf_static.mismatch(&tf_static), None);
    }
}
