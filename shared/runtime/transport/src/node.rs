//! A process's node in the shared memory of a run.

use crate::cleanup::{make_private, remove_everything};
use crate::error::TransportError;
use crate::identity::RunIdentity;
use crate::patience::patiently;
use iceoryx2::prelude::{
    Config, LogLevel, Node, NodeBuilder, NodeName, SignalHandlingMode, ipc, set_log_level_from_env_or,
};

/// A run in whose shared memory a process has a node; to be dropped behind it. Where the run is over and cleared
/// away by then, what the node made since is removed: no run does.
#[derive(Debug)]
pub(crate) struct VisitedRun(RunIdentity);

impl Drop for VisitedRun {
    fn drop(&mut self) {
        if !self.0.is_there() {
            // What cannot be removed has no other to tell of it.
            let _ = remove_everything(&self.0);
        }
    }
}

/// Makes a node under a name that tools show, with the run's configuration.
///
/// # Errors
/// Where the run's configuration is missing or no node can be made.
pub(crate) fn open_node(
    identity: &RunIdentity,
    name: &str,
) -> Result<(Node<ipc::Service>, Config, VisitedRun), TransportError> {
    set_log_level_from_env_or(LogLevel::Fatal);
    let config = identity.load()?;
    let run = VisitedRun(identity.clone());
    let node_name = NodeName::new(name).map_err(|e| TransportError::Open {
        what: format!("a node named {name:?}"),
        reason: format!("{e:?}"),
    })?;
    let node = patiently(&format!("a node in {}", identity.root.display()), None, || {
        NodeBuilder::new()
            .name(&node_name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
    })?;
    // The first node of a process closes the folder to other users.
    make_private(identity)?;
    if !identity.is_there() {
        // Cleared away between the two.
        drop(node);
        return Err(TransportError::Open {
            what: format!("a node named {name:?}"),
            reason: "the run is over".into(),
        });
    }
    Ok((node, config, run))
}
