//! A pair's share of the normal equations (SPEC 4.1, 5.1).

use crate::graph::Pair;
use tessera_geometry::{Matrix6, Pose, Vector6, adjoint};

/// What a pair adds to the normal equations, its weight included.
pub(crate) struct Linearised {
    pub(crate) h_query: Matrix6,
    pub(crate) g_query: Vector6,
    pub(crate) h_target: Matrix6,
    pub(crate) g_target: Vector6,
    pub(crate) h_across: Matrix6,
    pub(crate) cost: f64,
}

impl Linearised {
    /// The terms at `target_from_query`; those of the target only where it is free.
    pub(crate) fn new(pair: &Pair, target_from_query: &Pose, is_target_free: bool) -> Self {
        let (h, g, f) = pair.block.linearise(target_from_query);
        let (h_query, g_query) = (h * pair.weight, g * pair.weight);
        let cost = pair.weight * f;
        let (mut h_target, mut g_target, mut h_across) = Default::default();
        if is_target_free {
            // J_j = -J_i Ad(T_ji) (SPEC 4.1).
            let ad = adjoint(&target_from_query.inverse());
            h_across = h_query * ad;
            h_target = ad.transpose() * h_across;
            g_target = ad.transpose() * g_query;
        }
        Self { h_query, g_query, h_target, g_target, h_across, cost }
    }
}
