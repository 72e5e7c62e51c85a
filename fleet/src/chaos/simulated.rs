//! Two runs of the simulated room that share a part of the way, where the user gives no runs.

use super::processes::{FleetProcess, Patience, appending};
use crate::error::FleetError;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// First frame and number of frames of each.
const WAYS: [(u32, u32); 2] = [(0, 80), (50, 80)];

/// The command: the program that started this one, or that beside it, in the checkout, or on `PATH`.
fn tessera() -> PathBuf {
    if let Some(program) = std::env::var_os("TESSERA_PROGRAM") {
        return program.into();
    }
    let own = std::env::current_exe().unwrap_or_default();
    let folder = own.parent().unwrap_or(Path::new(""));
    let checkout = folder.join("../../../target/release");
    let places = [folder.to_owned(), checkout].into_iter().map(|place| place.join("tessera"));
    places.into_iter().find(|path| path.is_file()).unwrap_or_else(|| "tessera".into())
}

fn no_program(program: &Path, error: &std::io::Error) -> FleetError {
    let program = program.display();
    FleetError::Input(format!(
        "cannot start {program}: {error}; expected tessera beside this program or on PATH, or finished runs by --run"
    ))
}

/// Makes the runs, one after the other, in a folder.
///
/// # Errors
/// Where `tessera` is not there, or a run fails.
pub(super) fn simulated_runs(
    folder: &Path,
    log: &Path,
    patience: &Patience<'_>,
) -> Result<Vec<PathBuf>, FleetError> {
    let program = tessera();
    let mut runs = Vec::new();
    for (number, (skip, frames)) in WAYS.into_iter().enumerate() {
        let out = folder.join(format!("run-{}", number + 1));
        let name = format!("fleet-{}-{}", std::process::id(), number + 1);
        let mut command = Command::new(&program);
        command.args(["run", "room", "--quiet", "--skip", &skip.to_string()]);
        command.args(["--frames", &frames.to_string(), "--name", &name, "--out"]).arg(&out);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(appending(log)?);
        let mut run = FleetProcess(command.spawn().map_err(|error| no_program(&program, &error))?);
        let waited = patience.wait_for("a simulated run", || run.ended().is_some());
        if waited.is_err() {
            // It takes its own processes along.
            let _ = rustix::process::kill_process(
                rustix::process::Pid::from_child(&run.0),
                rustix::process::Signal::TERM,
            );
            let _ = run.0.wait();
        }
        waited?;
        if run.ended() != Some(true) {
            let said = std::fs::read_to_string(log).unwrap_or_default();
            return Err(FleetError::Input(format!("a simulated run failed: {}", said.trim())));
        }
        runs.push(out);
    }
    Ok(runs)
}
