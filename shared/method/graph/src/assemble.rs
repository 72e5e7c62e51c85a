//! The normal equations of a graph from its pairs and priors (method 5.3).

use crate::graph::Graph;
use crate::linearised::Terms;
use crate::solve::BlockSystem;
use tessera_geometry::{Vector6, log};

impl Graph {
    /// Fills the system and returns the cost; `terms` keeps what it needs again.
    pub(crate) fn linearise(&self, slot: &[usize], system: &mut BlockSystem, terms: &mut Terms) -> f64 {
        system.clear();
        terms.update(self, slot);
        let mut cost = 0.0;
        for (pair, terms) in self.pairs.iter().zip(&terms.pairs).filter(|(_, terms)| terms.weight != 0.0) {
            let (i, j) = (slot[pair.query], slot[pair.target]);
            cost += terms.cost;
            if i != usize::MAX {
                system.diagonal[i] += terms.h_query;
                system.gradient[i] += terms.g_query;
            }
            if j == usize::MAX {
                continue;
            }
            system.diagonal[j] += terms.h_target;
            system.gradient[j] -= terms.g_target;
            if i != usize::MAX
                && let Some(place) = system.place(i, j)
            {
                // H_ij = -H_ii Ad; stored with the larger slot as row.
                if i > j {
                    system.lower[place] -= terms.h_across;
                } else {
                    system.lower[place] -= terms.h_across.transpose();
                }
            }
        }
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
        // Pairs between fixed poses are left out of the loop above but belong to the cost.
        cost + self
            .pairs
            .iter()
            .filter(|p| p.weight != 0.0 && slot[p.query] == usize::MAX && slot[p.target] == usize::MAX)
            .map(|p| p.weight * p.block.cost(&self.target_from_query(p)))
            .sum::<f64>()
    }
}
