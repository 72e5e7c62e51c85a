//! The normal equations of a graph from its pairs, priors and measurements of up (method 5.3).

use crate::graph::{Graph, MIN_SHARED_PAIRS};
use crate::linearised::{Linearised, Terms};
use crate::solve::{BlockPlaces, BlockSystem};
use tessera_geometry::{Matrix6, Vector6, log};

impl Graph {
    /// Fills the system and returns the cost; `terms` keeps what it needs again.
    pub(crate) fn linearise(&self, slot: &[usize], system: &mut BlockSystem, terms: &mut Terms) -> f64 {
        system.clear();
        terms.update(self, slot);
        let BlockSystem { diagonal, lower, gradient, places, .. } = system;
        let mut of_poses = || add_of_poses(self, slot, terms, (diagonal, gradient));
        let mut across = || add_across(self, slot, terms, (lower, places));
        let (mut cost, ()) = match self.pairs.len() < MIN_SHARED_PAIRS {
            true => (of_poses(), across()),
            false => rayon::join(of_poses, across),
        };
        for prior in &self.priors {
            let s = slot[prior.vertex];
            let e: Vector6 = log(&(prior.predicted.inverse() * self.poses[prior.vertex])).to_vector();
            cost += e.dot(&(prior.information * e));
            if s != usize::MAX {
                // Near the prediction the Jacobian of the logarithm is the identity.
                system.diagonal[s] += prior.information;
                system.gradient[s] += prior.information * e;
            }
        }
        if !self.ups.measured.is_empty() {
            cost += self.ups.cost(&self.poses);
            self.ups.add_to(&self.poses, slot, system);
        }
        // Pairs between fixed poses are left out of the loop above but belong to the cost.
        cost + self
            .pairs
            .iter()
            .filter(|p| p.weight != 0.0 && slot[p.query] == usize::MAX && slot[p.target] == usize::MAX)
            .map(|p| p.weight * p.block.cost(&self.target_from_query(p)))
            .sum::<f64>()
    }
}

/// The terms that take part, with the places of their poses.
fn in_part<'a>(
    graph: &'a Graph,
    slot: &'a [usize],
    terms: &'a Terms,
) -> impl Iterator<Item = (usize, usize, &'a Linearised)> {
    let all = graph.pairs.iter().zip(&terms.pairs).filter(|(_, terms)| terms.weight != 0.0);
    all.map(|(pair, terms)| (slot[pair.query], slot[pair.target], terms))
}

/// Adds the terms of single poses, and returns the cost.
fn add_of_poses(
    graph: &Graph,
    slot: &[usize],
    terms: &Terms,
    (diagonal, gradient): (&mut [Matrix6], &mut [Vector6]),
) -> f64 {
    let mut cost = 0.0;
    for (i, j, terms) in in_part(graph, slot, terms) {
        cost += terms.cost;
        if i != usize::MAX {
            diagonal[i] += terms.h_query;
            gradient[i] += terms.g_query;
        }
        if j != usize::MAX {
            diagonal[j] += terms.h_target;
            gradient[j] -= terms.g_target;
        }
    }
    cost
}

/// Adds the terms between two poses.
fn add_across(graph: &Graph, slot: &[usize], terms: &Terms, (lower, places): (&mut [Matrix6], &BlockPlaces)) {
    let mut next = 0;
    for (i, j, terms) in in_part(graph, slot, terms) {
        if let Some(place) = places.find((i, j), next) {
            next = place + 1;
            // H_ij = -H_ii Ad; stored with the larger slot as row.
            if i > j {
                lower[place] -= terms.h_across;
            } else {
                lower[place] -= terms.h_across.transpose();
            }
        }
    }
}
