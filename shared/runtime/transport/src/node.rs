//! A process's node in the shared memory of a run.

use crate::cleanup::make_private;
use crate::error::TransportError;
use crate::identity::RunIdentity;
use crate::patience::patiently;
use iceoryx2::prelude::{
    Config, LogLevel, Node, NodeBuilder, NodeName, SignalHandlingMode, ipc, set_log_level_from_env_or,
};

/// Makes a node under a name that tools show, with the run's configuration.
///
/// # Errors
/// Where the run's configuration is missing or no node can be made.
pub(crate) fn open_node(
    identity: &RunIdentity,
    name: &str,
) -> Result<(Node<ipc::Service>, Config), TransportError> {
    set_log_level_from_env_or(LogLevel::Fatal);
    let config = identity.load()?;
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
    Ok((node, config))
}
