//! Processes of a run as the system shows them.

use std::path::Path;
use tessera_messages::Stage;

/// The process that is a stage of this supervisor now.
pub(super) fn stage_pid(supervisor: u32, stage: Stage) -> Option<u32> {
    stage_pids(supervisor).into_iter().find(|(of, _)| *of == stage).map(|(_, pid)| pid)
}

/// All stages of a supervisor that live now.
pub(super) fn stage_pids(supervisor: u32) -> Vec<(Stage, u32)> {
    pids_where(|pid, words| {
        let is_child = status_number(pid, "PPid:") == Some(supervisor.into());
        stage_of(words).filter(|_| is_child)
    })
}

/// All stages that work in a run directory, of any parent.
pub(super) fn stages_in(run_dir: &Path) -> Vec<(Stage, u32)> {
    let dir = run_dir.display().to_string();
    pids_where(|_, words| stage_of(words).filter(|_| words.iter().any(|word| *word == dir)))
}

fn pids_where(accept: impl Fn(u32, &[&str]) -> Option<Stage>) -> Vec<(Stage, u32)> {
    let mut found = Vec::new();
    for item in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Ok(pid) = item.file_name().to_string_lossy().parse::<u32>() else { continue };
        let line = std::fs::read(item.path().join("cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line);
        let words: Vec<&str> = line.split('\0').collect();
        found.extend(accept(pid, &words).map(|stage| (stage, pid)));
    }
    found
}

/// `… stage NAME --run-dir DIR`.
fn stage_of(words: &[&str]) -> Option<Stage> {
    let at = words.iter().position(|word| *word == "stage")?;
    Stage::from_name(words.get(at + 1)?)
}

/// Resident memory of a process now, bytes.
pub(super) fn rss_bytes(pid: u32) -> Option<u64> {
    status_number(pid, "VmRSS:").map(|kilobytes| kilobytes << 10)
}

/// Open files of a process.
pub(super) fn n_open_files(pid: u32) -> Option<u64> {
    std::fs::read_dir(format!("/proc/{pid}/fd")).ok().map(|items| items.count() as u64)
}

fn status_number(pid: u32, key: &str) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    line.split_whitespace().next()?.parse().ok()
}
