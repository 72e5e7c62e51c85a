//! `tessera stage`: one stage as a process, as the supervisor starts it or by hand.

use crate::arguments::StageArguments;
use crate::exit::CommandError;
use crate::run_folder;
use crate::supervisor::run_stage;
use std::process::ExitCode;
use tessera_messages::Stage;

/// Becomes a stage.
pub(crate) fn stage(arguments: &StageArguments) -> Result<ExitCode, CommandError> {
    let Some(stage) = Stage::from_name(&arguments.stage) else {
        return Err(CommandError::Arguments(format!(
            "no stage {:?}, expected one of {}",
            arguments.stage,
            Stage::ALL.map(Stage::name).join(", ")
        )));
    };
    let run_dir = match (&arguments.run_dir, &arguments.run) {
        (Some(run_dir), _) => run_dir.clone(),
        (None, Some(name)) => run_folder::find(name)?,
        (None, None) => return Err(CommandError::Arguments("expected --run NAME or --run-dir DIR".into())),
    };
    Ok(run_stage(stage, run_dir))
}
