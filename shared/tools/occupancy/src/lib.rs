//! An occupancy grid of the floor: for each keyframe rays from its camera to its points, for each cell a
//! vote of all keyframes. A function of keyframes and poses, whatever order they come in.
#![forbid(unsafe_code)]

mod arguments;
mod floor;
mod grid;
mod lattice;
mod map_server;
mod points;
mod scan;
mod votes;

pub use arguments::{parse_cell_m, parse_heights_m};
pub use floor::{Floor, FloorFinder};
pub use grid::{FREE, GridPart, OCCUPIED, OccupancyCells, UNKNOWN};
pub use lattice::CellLattice;
pub use map_server::write_map;
pub use points::{ColouredPoint, KeyframeView, PointThinner, thinned_surface};
pub use scan::RayScan;
pub use votes::CellVotes;
