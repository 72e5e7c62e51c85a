//! One view fused into one block, a line of eight voxels at a time, compiled for each instruction set.

use crate::block::{Block, SIDE};
use crate::view::{PreparedView, SeenLine};
use tessera_numerics::lanes::{LANES, Lanes, Real};

/// Depth below which certainty does not grow any more, metres.
const NEAREST_M: f32 = 0.4;
/// Colour is taken where the surface is nearer than this, truncations.
const NEAR: f32 = 0.5;

/// A block, where it is, and the view that is fused into it.
pub(crate) struct IntegrateBlock<'a> {
    pub(crate) view: &'a PreparedView<'a>,
    pub(crate) block: &'a mut Block,
    pub(crate) place: [i32; 3],
    pub(crate) voxel_m: f32,
    pub(crate) truncation_m: f32,
}

impl pulp::WithSimd for IntegrateBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        match self.view.is_rolling() {
            true => self.integrate::<true>(),
            false => self.integrate::<false>(),
        }
    }
}

impl IntegrateBlock<'_> {
    #[inline(always)]
    fn integrate<const IS_ROLLING: bool>(self) {
        let Self { view, block, place, voxel_m, truncation_m } = self;
        // Centres of voxels lie at halves.
        let along = |axis: usize, k: i32| ((place[axis] * SIDE + k) as f32 + 0.5) * voxel_m;
        let x = Lanes(std::array::from_fn(|k| along(0, k as i32)));
        for line in 0..SIDE * SIDE {
            let (y, z) = (Lanes::splat(along(1, line % SIDE)), Lanes::splat(along(2, line / SIDE)));
            let seen = view.look::<IS_ROLLING>([x, y, z], -truncation_m);
            if seen.is_seen != [false; LANES] {
                add(block, (line * SIDE) as usize, view, &seen, 1.0 / truncation_m);
            }
        }
    }
}

/// Takes what a view saw of the eight voxels from `at` on in.
#[inline(always)]
fn add(block: &mut Block, at: usize, view: &PreparedView<'_>, seen: &SeenLine, per_truncation: f32) {
    let distance = (seen.distance_m * Lanes::splat(per_truncation)).only(seen.is_seen);
    // Depth is less certain with the square of itself.
    let far = seen.depth_m.map(|depth| if depth > NEAREST_M { depth } else { NEAREST_M });
    let near = Lanes::splat(NEAREST_M) / far;
    let weight = (seen.cosine * near * near * near * near).only(seen.is_seen);
    let (own, own_weight) = (Lanes::load(&block.distance, at), Lanes::load(&block.weight, at));
    let sum = own_weight + weight;
    let share = (weight / sum).only(seen.is_seen);
    let truncated = distance.map(|d| if d < 1.0 { d } else { 1.0 });
    (own + (truncated - own) * share).store(&mut block.distance, at);
    sum.store(&mut block.weight, at);
    for k in 0..LANES {
        if seen.is_seen[k] && distance.0[k].abs() < NEAR {
            add_colour(block, at + k, view.colour(seen, k), weight.0[k]);
        }
    }
}

#[inline(always)]
fn add_colour(block: &mut Block, at: usize, rgb: [f32; 3], weight: f32) {
    let sum = block.colour_weight[at] + weight;
    let share = weight / sum;
    for (own, new) in block.rgb.iter_mut().zip(rgb) {
        own[at] += (new - own[at]) * share;
    }
    block.colour_weight[at] = sum;
}
