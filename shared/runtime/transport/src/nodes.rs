//! Nodes of the processes that have joined a run.

use crate::error::TransportError;
use crate::identity::RunIdentity;
use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, Node, NodeState, ipc};

/// A process that has joined a run and lives, whether it says so or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LivingNode {
    /// The name that it joined under: of a stage, the stage's own.
    pub name: String,
    /// Process id.
    pub pid: u32,
}

/// The processes of a run that live, by the locks that they hold: one that is frozen or busy is
/// among them.
///
/// # Errors
/// Where the run's configuration or its folder of nodes cannot be read.
pub fn living_nodes(identity: &RunIdentity) -> Result<Vec<LivingNode>, TransportError> {
    let mut living = Vec::new();
    let listed = Node::<ipc::Service>::list(&identity.load()?, |state| {
        if let NodeState::Alive(node) = state
            && let Some(details) = node.details()
            && let Ok(pid) = node.id().pid::<ipc::Service>()
        {
            let name = details.name().as_str().to_owned();
            living.push(LivingNode { name, pid: pid.value().unsigned_abs() });
        }
        CallbackProgression::Continue
    });
    listed.map_err(|error| TransportError::Open {
        what: format!("the nodes in {}", identity.root.display()),
        reason: format!("{error:?}"),
    })?;
    living.sort_unstable_by(|a, b| (&a.name, a.pid).cmp(&(&b.name, b.pid)));
    Ok(living)
}
