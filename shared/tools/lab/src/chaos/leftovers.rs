//! Leftovers of a run in shared memory.

use std::path::{Path, PathBuf};
use tessera_transport::RunIdentity;

/// Files of a run directory that the documentation names, outputs among them.
const DOCUMENTED: [&str; 27] = [
    "align.checkpoint",
    "align.journal",
    "align.synced",
    "base.answer",
    "base.contact",
    "broken_frames.txt",
    "config.toml",
    "groundtruth.txt",
    "keyframes.store",
    "keyframes.txt",
    "live.clock",
    "live.posed",
    "camera.session",
    "log.txt",
    "map.ply",
    "optimise.checkpoint",
    "optimise.journal",
    "optimise.synced",
    "report.html",
    "run.json",
    "states.csv",
    "statistics.json",
    "summary.json",
    "timeline.json",
    "trajectory.txt",
    "trajectory_marked.txt",
    "trajectory_online.txt",
];

/// Files in shared memory and in the private folder that belong to a run that is over, with the
/// bytes that they take.
pub(super) fn of_identity(identity: &RunIdentity, name: &str) -> Vec<(PathBuf, u64)> {
    let private = identity.root.parent().map(Path::to_path_buf).unwrap_or_default();
    let mut left = Vec::new();
    for folder in [PathBuf::from("/dev/shm"), private] {
        for item in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let file = item.file_name().to_string_lossy().into_owned();
            if file.starts_with(&identity.prefix) || file == format!("{name}.run") {
                left.push((item.path(), item.metadata().map_or(0, |meta| meta.len())));
            }
        }
    }
    left
}

/// Files of a run directory that no documentation names.
pub(super) fn undocumented(run_dir: &Path) -> Vec<PathBuf> {
    let items = std::fs::read_dir(run_dir).into_iter().flatten().flatten();
    // What `resume --drop-damaged` sets aside stays beside its file.
    let is_known = |name: &str| {
        DOCUMENTED.contains(&name) || name.starts_with("trajectory_submap_") || name.contains(".damaged-")
    };
    let unknown = items.filter(|item| !is_known(&item.file_name().to_string_lossy()));
    let mut paths: Vec<PathBuf> = unknown.map(|item| item.path()).collect();
    paths.sort();
    paths
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_beyond_the_documented_ones_are_found() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["align.journal", "log.txt", "keyframes.store.damaged-1", ".map.ply.partial", "core"] {
            std::fs::write(dir.path().join(name), "x").unwrap();
        }
        let names =
            undocumented(dir.path()).iter().map(|p| p.file_name().unwrap().to_owned()).collect::<Vec<_>>();
        assert_eq!(names, [".map.ply.partial", "core"]);
    }
}
