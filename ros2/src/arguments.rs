//! The command line.

use crate::map::MapOptions;
use crate::network::open::CarrierKind;
use crate::network::reach::{NetworkReach, parse_reach};
use crate::network::remap::{Remap, is_name, parse_remap};
use clap::Parser;
use tessera_occupancy::{parse_cell_m, parse_heights_m};

/// Join a run to a ROS 2 network: images of its camera in, odometry and transforms out
#[derive(Debug, Parser)]
#[command(
    name = "tessera-ros2",
    version,
    max_term_width = 80,
    after_help = "Examples:\n  tessera ros2 desk --run                  start the run too\n  tessera ros2 desk                        join `tessera run external --name desk`\n  tessera ros2 desk --run -- --out desk    further words are those of `tessera run`"
)]
pub(crate) struct Ros2Arguments {
    /// Name of the run
    pub(crate) name: String,
    /// Start the run as well
    #[arg(long)]
    pub(crate) run: bool,
    /// Arguments of `tessera run`, with --run
    #[arg(last = true, requires = "run")]
    pub(crate) run_arguments: Vec<String>,
    /// Topic of depth [default: found by type and name]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) depth_topic: Option<String>,
    /// Topic of colour [default: found by type and name]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) color_topic: Option<String>,
    /// CameraInfo of depth [default: that of the nearest name]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) camera_info: Option<String>,
    /// A sensor_msgs/msg/Imu fixed to the camera: its gyroscope is used
    #[arg(long, value_name = "TOPIC")]
    pub(crate) imu_topic: Option<String>,
    /// Take no colour
    #[arg(long, conflicts_with = "color_topic")]
    pub(crate) no_color: bool,
    /// A camera file or a built-in camera instead of the CameraInfo
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// Subscribe images reliable instead of best effort
    #[arg(long)]
    pub(crate) reliable: bool,
    /// Frame of the robot whose pose is published
    #[arg(long, value_name = "FRAME", default_value = "base_link")]
    pub(crate) base_frame: String,
    /// Publish diagnostics and path by the time of /clock, of a simulation or a bag that is played
    #[arg(long)]
    pub(crate) use_sim_time: bool,
    /// Publish no transforms
    #[arg(long)]
    pub(crate) no_tf: bool,
    /// Where odometry and path are published
    #[arg(long, value_name = "NAMESPACE", default_value = "/tessera", value_parser = namespace)]
    pub(crate) namespace: String,
    /// Another name of a topic or service, such as /tf:=/robot1/tf; may be repeated
    #[arg(long, value_name = "FROM:=TO", value_parser = parse_remap)]
    pub(crate) remap: Vec<Remap>,
    /// Distance of neighbouring points of the map, metres
    #[arg(long, value_name = "M", default_value_t = 0.05, value_parser = parse_cell_m)]
    pub(crate) map_spacing: f64,
    /// Topic of the occupancy grid [default: NAMESPACE/grid]
    #[arg(long, value_name = "TOPIC", value_parser = namespace)]
    pub(crate) grid_topic: Option<String>,
    /// Edge of the grid's cells, metres
    #[arg(long, value_name = "M", default_value_t = 0.05, value_parser = parse_cell_m)]
    pub(crate) grid_cell: f64,
    /// Heights of obstacles above the origin of map, metres
    #[arg(
        long,
        value_name = "LOW,HIGH",
        default_value = "0.1,1.0",
        value_parser = parse_heights_m,
        allow_hyphen_values = true
    )]
    pub(crate) grid_heights: (f64, f64),
    /// What carries messages [default: zenoh where RMW_IMPLEMENTATION is rmw_zenoh_cpp, else dds]
    #[arg(long, value_name = "CARRIER")]
    pub(crate) carrier: Option<CarrierKind>,
    /// Distribution of ROS 2 of the others: humble has names of its own form [default: ROS_DISTRO]
    #[arg(long, value_name = "NAME")]
    pub(crate) ros_distro: Option<String>,
    /// Domain, 0 to 232 [default: ROS_DOMAIN_ID, else 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=232))]
    pub(crate) domain: Option<u16>,
    /// loopback, all, or the address of an interface [default: by ROS 2's variables, else loopback]
    #[arg(long, value_name = "REACH", value_parser = parse_reach)]
    pub(crate) network: Option<NetworkReach>,
    /// Say nothing but errors
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

fn namespace(text: &str) -> Result<String, String> {
    match is_name(text) {
        true => Ok(text.to_owned()),
        false => Err("expected a name such as /tessera".to_owned()),
    }
}

impl Ros2Arguments {
    /// How the map is published.
    pub(crate) fn map(&self) -> MapOptions {
        MapOptions { spacing_m: self.map_spacing, cell_m: self.grid_cell, heights_m: self.grid_heights }
    }

    /// Whether node names have the form of ROS 2 Humble.
    pub(crate) fn is_humble(&self) -> bool {
        let distro = self.ros_distro.clone().or_else(|| std::env::var("ROS_DISTRO").ok());
        distro.is_some_and(|name| name == "humble")
    }

    /// Topic of the occupancy grid.
    pub(crate) fn grid_topic(&self) -> String {
        self.grid_topic.clone().unwrap_or_else(|| format!("{}/grid", self.namespace))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Ros2Arguments::command().debug_assert();
        let words = ["tessera-ros2", "desk", "--run", "--domain", "7", "--", "--frames", "3"];
        let arguments = Ros2Arguments::try_parse_from(words).unwrap();
        assert_eq!((arguments.domain, arguments.run_arguments.len()), (Some(7), 2));
        for wrong in [
            ["x", "--namespace", "tessera"],
            ["x", "--domain", "233"],
            ["x", "--network", "wlan0"],
            ["x", "--map-spacing", "nan"],
            ["x", "--grid-heights", "1,0"],
        ] {
            assert!(Ros2Arguments::try_parse_from(["tessera-ros2"].into_iter().chain(wrong)).is_err());
        }
    }
}
