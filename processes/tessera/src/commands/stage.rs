//! `tessera stage`: one stage as a process, as the supervisor starts it or by hand.

use crate::arguments::StageArguments;
use crate::exit::CommandError;
use crate::run_folder;
use std::process::ExitCode;
use tessera_messages::Stage;
use tessera_stage::StageArgs;
use tessera_supervisor::LIFELINE_VARIABLE;

/// Becomes a stage.
pub(crate) fn stage(arguments: &StageArguments) -> Result<ExitCode, CommandError> {
    let Some(stage) = Stage::from_name(&arguments.stage) else {
        return Err(CommandError::arguments(format!(
            "no stage {:?}, expected one of {}",
            arguments.stage,
            Stage::ALL.map(Stage::name).join(", ")
        )));
    };
    let run_dir = match (&arguments.run_dir, &arguments.run) {
        (Some(run_dir), _) => run_dir.clone(),
        (None, Some(name)) => run_folder::find(name)?,
        (None, None) => return Err(CommandError::arguments("expected --run NAME or --run-dir DIR")),
    };
    let watch_stdin = std::env::var_os(LIFELINE_VARIABLE).is_some();
    let args = StageArgs { run_dir, watch_stdin };
    Ok(match stage {
        Stage::Sensor => tessera_sensor::main(&args),
        Stage::Reconstruct => tessera_reconstruct::main(&args),
        Stage::Align => tessera_align::main(&args),
        Stage::Optimise => tessera_optimise::main(&args),
    })
}
