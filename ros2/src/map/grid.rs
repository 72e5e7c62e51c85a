//! An occupancy grid as `nav_msgs/msg/OccupancyGrid`, and its changes as
//! `map_msgs/msg/OccupancyGridUpdate`.

use serde::Serialize;
use tessera_occupancy::{GridPart, OccupancyCells};
use tessera_recording::ros::{Header, RosPose, Time};

/// The message of a grid; cells have that edge, metres.
pub(crate) fn grid_message<'a>(
    grid: &'a OccupancyCells,
    header: Header<'a>,
    cell_m: f64,
) -> OccupancyGrid<'a> {
    let [x, y] = grid.begin.map(|cells| f64::from(cells) * cell_m);
    let info = MapMetaData {
        map_load_time: header.stamp,
        resolution: cell_m as f32,
        width: grid.width,
        height: grid.height,
        origin: RosPose { position: [x, y, 0.0], orientation_xyzw: [0.0, 0.0, 0.0, 1.0] },
    };
    OccupancyGrid { header, info, data: &grid.cells }
}

/// The message of a part of a grid.
pub(crate) fn part_message<'a>(part: &'a GridPart, header: Header<'a>) -> OccupancyGridUpdate<'a> {
    let &GridPart { x, y, width, height, .. } = part;
    OccupancyGridUpdate { header, x: x as i32, y: y as i32, width, height, data: &part.cells }
}

/// `nav_msgs/msg/MapMetaData`.
#[derive(Clone, Copy, Debug, Serialize)]
struct MapMetaData {
    map_load_time: Time,
    resolution: f32,
    width: u32,
    height: u32,
    origin: RosPose,
}

/// `nav_msgs/msg/OccupancyGrid`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OccupancyGrid<'a> {
    header: Header<'a>,
    info: MapMetaData,
    #[serde(with = "serde_bytes")]
    data: &'a [u8],
}

/// `map_msgs/msg/OccupancyGridUpdate`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OccupancyGridUpdate<'a> {
    header: Header<'a>,
    x: i32,
    y: i32,
    width: u32,
    height: u32,
    #[serde(with = "serde_bytes")]
    data: &'a [u8],
}
