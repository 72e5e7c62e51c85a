//! Search trees of the last references, for the exact search. Made anew when they are missing:
//! nothing of them is state.

use crate::map::context::Context;
use crate::tracking::prediction::Reference;
use std::collections::BTreeMap;
use std::sync::Arc;
use tessera_registration::{KdTree, ShutterTable};

/// A surface's tree and the readout motion it was made for.
type Known = (ShutterTable, Arc<KdTree>);

/// Trees by surface, each with the readout motion it was made for.
#[derive(Debug, Default)]
pub(crate) struct Trees {
    known: BTreeMap<(bool, u64), Vec<Known>>,
}

impl Trees {
    /// One tree for each reference; none for the projective search.
    pub(crate) fn of(&mut self, context: &Context, references: &[Reference<'_>]) -> Vec<Option<Arc<KdTree>>> {
        let trees = references.iter().map(|reference| self.tree(context, reference)).collect();
        self.known.retain(|key, _| references.iter().any(|r| r.key == *key));
        trees
    }

    fn tree(&mut self, context: &Context, reference: &Reference<'_>) -> Option<Arc<KdTree>> {
        let known = self.known.get(&reference.key).into_iter().flatten();
        if let Some((_, tree)) = known.into_iter().find(|(shutter, _)| *shutter == reference.shutter) {
            return Some(Arc::clone(tree));
        }
        let tree = Arc::new(context.tree(&reference.surface, &reference.shutter)?);
        let entry = (reference.shutter, Arc::clone(&tree));
        self.known.entry(reference.key).or_default().push(entry);
        Some(tree)
    }
}
