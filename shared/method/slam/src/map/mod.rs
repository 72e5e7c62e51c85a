//! The map: keyframes and frames as a fold over journal records.

pub(crate) mod active_ids;
pub(crate) mod appearance;
pub(crate) mod cameras;
pub(crate) mod cause;
pub(crate) mod context;
pub(crate) mod correction;
pub(crate) mod culling;
pub(crate) mod detection;
pub(crate) mod frame;
pub(crate) mod given_up;
pub(crate) mod input_hash;
pub(crate) mod keyframe;
pub(crate) mod map_view;
pub(crate) mod newest_blocks;
pub(crate) mod placement;
pub(crate) mod pose_history;
pub(crate) mod records;
pub(crate) mod rounded_pose;
mod single;
pub(crate) mod sorted_keys;
pub(crate) mod split;
pub(crate) mod state;
pub(crate) mod submaps;
pub(crate) mod surfaces;
#[cfg(test)]
pub(crate) mod test_wall;
pub(crate) mod view_limits;
