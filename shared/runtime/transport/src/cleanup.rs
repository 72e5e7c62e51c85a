//! Cleanup of resources left by crashed processes, and at the end of a run.

use crate::error::TransportError;
use crate::identity::RunIdentity;
use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, Config, Node, NodeState, ipc};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// What a clean-up did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaned {
    /// Dead nodes whose resources iceoryx2 removed.
    pub nodes: u32,
    /// Dead nodes that iceoryx2 could not clean up, removed by hand.
    pub forced: u32,
}

/// Removes what dead nodes left, so that their successors find free places.
pub(crate) fn clean_dead_nodes(config: &Config, identity: &RunIdentity) -> Cleaned {
    let mut dead = Vec::new();
    let _ = Node::<ipc::Service>::list(config, |state| {
        if let NodeState::Dead(node) = state {
            dead.push(node);
        }
        CallbackProgression::Continue
    });
    let mut cleaned = Cleaned::default();
    for node in dead {
        let id = node.id().value().to_string();
        if node.blocking_remove_stale_resources(Duration::from_millis(500)).is_ok() {
            cleaned.nodes = cleaned.nodes.saturating_add(1);
        } else {
            // Killed while it made a service or port: a tag stays in its folder, and iceoryx2
            // 0.10 then fails for ever. Its process is gone, so these files are needed no more.
            remove_node_files(&identity.root, &id);
            cleaned.forced = cleaned.forced.saturating_add(1);
        }
    }
    cleaned
}

fn remove_node_files(root: &Path, id: &str) {
    let nodes = root.join("nodes");
    let _ = std::fs::remove_dir_all(nodes.join(id));
    for path in entries(&nodes) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.contains(&format!("{id}.node_monitor")) {
            let _ = std::fs::remove_file(path);
        }
    }
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder)
        .map(|items| items.filter_map(|item| item.ok().map(|item| item.path())).collect())
        .unwrap_or_default()
}

/// Files of a run in shared memory.
pub(crate) fn shared_memory_files(identity: &RunIdentity) -> Vec<PathBuf> {
    let mut files = entries(Path::new(SHARED_MEMORY));
    files.retain(|path| {
        path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(identity.prefix.as_bytes()))
    });
    files
}

/// Makes the counter that iceoryx2 leaves world-writable private: garbage in it would make every
/// later node fail.
pub(crate) fn make_private(identity: &RunIdentity) -> Result<(), TransportError> {
    use std::os::unix::fs::PermissionsExt;
    for path in shared_memory_files(identity) {
        if path.extension().is_some_and(|extension| extension == "global_mgmt") {
            std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600))
                .map_err(TransportError::io("make private", &path))?;
        }
    }
    Ok(())
}

/// How long a stage that was started by a supervisor as that died may make files, until it notices.
const ORPHAN_PATIENCE: Duration = Duration::from_secs(5);

/// Removes all that a run has in shared memory and in the private folder, dead or alive. Its configuration goes
/// first: a process that makes a node meanwhile sees that, and removes what it made.
///
/// # Errors
/// Where something is there and cannot be removed.
pub fn remove_everything(identity: &RunIdentity) -> Result<(), TransportError> {
    ignore_absent(std::fs::remove_file(&identity.config_file))
        .map_err(TransportError::io("remove", &identity.config_file))?;
    let began = Instant::now();
    loop {
        for path in shared_memory_files(identity) {
            ignore_absent(std::fs::remove_file(&path)).map_err(TransportError::io("remove", &path))?;
        }
        match ignore_absent(std::fs::remove_dir_all(&identity.root)) {
            Err(error) if is_written_to(&error) && began.elapsed() < ORPHAN_PATIENCE => {
                std::thread::sleep(Duration::from_millis(10));
            }
            result => return result.map_err(TransportError::io("remove", &identity.root)),
        }
    }
}

/// Whether something was made in a folder while it was emptied.
fn is_written_to(error: &std::io::Error) -> bool {
    error.kind() == std::io::ErrorKind::DirectoryNotEmpty
}

fn ignore_absent(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::RunClaim;

    #[test]
    fn what_an_orphan_makes_while_all_is_removed_is_removed_too() {
        let dir = tempfile::tempdir().unwrap();
        let claim = RunClaim::take(&format!("test-orphan-{}", std::process::id()), dir.path()).unwrap();
        let identity = claim.entry.identity.clone();
        let (root, began) = (identity.root.clone(), Instant::now());
        let orphan = std::thread::spawn(move || {
            for k in 0.. {
                let _ = std::fs::write(root.join(k.to_string()), "");
                if began.elapsed() > Duration::from_millis(300) {
                    return;
                }
            }
        });
        while entries(&identity.root).len() < 100 {
            std::thread::yield_now();
        }
        remove_everything(&identity).unwrap();
        orphan.join().unwrap();
        assert!(!identity.root.exists());
    }
}
