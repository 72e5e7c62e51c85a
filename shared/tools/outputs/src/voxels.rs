//! Thins a cloud to one point a voxel, in an order that depends on the points alone.

use nalgebra::Vector3;
use std::collections::HashMap;

/// A coloured point with its normal, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Metres.
    pub position: Vector3<f64>,
    /// Unit length.
    pub normal: Vector3<f64>,
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// The keyframe that saw it first.
    pub keyframe: u32,
}

#[derive(Clone, Copy, Default)]
struct Sum {
    position: [f64; 3],
    normal: [f32; 3],
    rgb: [u32; 3],
    n: u32,
    keyframe: u32,
}

/// A cloud with the mean of its points in each voxel, voxels in the order of their first point.
pub(crate) struct VoxelCloud {
    edge_m: f64,
    index: HashMap<[i32; 3], u32>,
    sums: Vec<Sum>,
}

impl VoxelCloud {
    /// An empty cloud with voxels of that edge, metres.
    pub(crate) fn new(edge_m: f64) -> Self {
        Self { edge_m, index: HashMap::new(), sums: Vec::new() }
    }

    /// Adds a point; one that is not finite or farther than 2^31 voxels away is left out.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::indexing_slicing,
        reason = "cells of 32 bits, three axes"
    )]
    pub(crate) fn add(&mut self, point: &MapPoint) {
        let cell = (point.position / self.edge_m).map(f64::floor);
        if !cell.iter().all(|c| c.abs() < f64::from(i32::MAX)) {
            return;
        }
        let Ok(next) = u32::try_from(self.sums.len()) else { return };
        let slot = *self.index.entry([cell.x as i32, cell.y as i32, cell.z as i32]).or_insert(next);
        if slot == next {
            self.sums.push(Sum { keyframe: point.keyframe, ..Sum::default() });
        }
        let sum = &mut self.sums[slot as usize];
        for axis in 0..3 {
            sum.position[axis] += point.position[axis];
            sum.normal[axis] += point.normal[axis] as f32;
            sum.rgb[axis] = sum.rgb[axis].saturating_add(u32::from(point.rgb[axis]));
        }
        sum.n = sum.n.saturating_add(1);
    }

    /// The same cloud in voxels of another edge, metres.
    pub(crate) fn thinned(&self, edge_m: f64) -> Self {
        let mut thinned = Self::new(edge_m);
        self.points().for_each(|point| thinned.add(&point));
        thinned
    }

    /// Number of voxels with a point.
    pub(crate) fn len(&self) -> usize {
        self.sums.len()
    }

    /// The mean point of each voxel.
    pub(crate) fn points(&self) -> impl Iterator<Item = MapPoint> + '_ {
        self.sums.iter().map(|sum| {
            let n = f64::from(sum.n);
            let normal = Vector3::from(sum.normal.map(f64::from));
            MapPoint {
                position: Vector3::from(sum.position) / n,
                // Normals of the two sides of a thin wall can cancel out.
                normal: normal.try_normalize(1e-6).unwrap_or_else(Vector3::zeros),
                rgb: sum.rgb.map(|c| rounded_mean(c, sum.n)),
                keyframe: sum.keyframe,
            }
        })
    }
}

fn rounded_mean(sum: u32, n: u32) -> u8 {
    let mean = sum.saturating_add(n / 2).checked_div(n);
    mean.and_then(|mean| u8::try_from(mean).ok()).unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, rgb: [u8; 3]) -> MapPoint {
        MapPoint {
            position: Vector3::new(x, 0.0, 0.0),
            normal: Vector3::z(),
            rgb,
            keyframe: u32::from(rgb[0]),
        }
    }

    #[test]
    fn points_of_a_voxel_become_their_mean_in_order_of_appearance() {
        let mut cloud = VoxelCloud::new(0.1);
        for p in [point(0.51, [10; 3]), point(-0.01, [0; 3]), point(0.53, [20; 3]), point(f64::NAN, [0; 3])] {
            cloud.add(&p);
        }
        let points: Vec<MapPoint> = cloud.points().collect();
        assert_eq!(cloud.len(), 2);
        assert!((points[0].position.x - 0.52).abs() < 1e-12);
        assert_eq!((points[0].rgb, points[0].normal, points[0].keyframe), ([15; 3], Vector3::z(), 10));
        assert_eq!(points[1].position.x, -0.01);
    }

    #[test]
    fn a_voxel_with_opposite_normals_has_none() {
        let mut cloud = VoxelCloud::new(0.1);
        cloud.add(&point(0.01, [0; 3]));
        cloud.add(&MapPoint { normal: -Vector3::z(), ..point(0.02, [0; 3]) });
        assert_eq!(cloud.points().next().unwrap().normal, Vector3::zeros());
    }
}
