//! Exit codes, and the errors that lead to them.

use std::path::Path;
use std::process::ExitCode;
use tessera_evaluation::ReadError;
use tessera_journal::JournalError;
use tessera_outputs::ToolError;
use tessera_settings::SettingsError;
use tessera_sources::SourceError;
use tessera_stage::StageError;
use tessera_supervisor::SupervisorError;
use tessera_transport::TransportError;

/// How the command ended; documented in the README and in `tessera --help`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// All was done.
    Done = 0,
    /// Wrong arguments or configuration.
    Arguments = 2,
    /// Unusable input.
    Input = 3,
    /// A stage failed.
    Stage = 4,
    /// The camera was never found in the map that the run started in.
    NotInMap = 5,
    /// With `--strict`: the verdict is doubtful.
    Doubtful = 6,
    /// With `--strict`: the verdict is failed.
    Useless = 7,
    /// Ended by Ctrl-C or SIGTERM.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why a command could not do its work.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CommandError {
    /// A tool failed, or what the command itself read or wrote.
    #[error(transparent)]
    Tool(#[from] ToolError),
    /// The run could not be started or kept up.
    #[error(transparent)]
    Supervisor(#[from] SupervisorError),
    /// A stage failed; its log decides on the exit code.
    #[error("{message}")]
    Failed {
        /// The exit code.
        exit: Exit,
        /// Which stage, how, and its last lines of log.
        message: String,
    },
}

/// What a tool's error is made of, is a command's too.
macro_rules! from_tool {
    ($($error:ty),*) => {
        $(impl From<$error> for CommandError {
            fn from(error: $error) -> Self {
                Self::Tool(error.into())
            }
        })*
    };
}

from_tool!(SettingsError, ReadError, SourceError, TransportError, StageError, JournalError);

impl CommandError {
    /// The exit code that tells it to scripts.
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Tool(error) => of_tool(error),
            Self::Supervisor(error) => of_supervisor(error),
            Self::Failed { exit, .. } => *exit,
        }
    }

    /// An argument that cannot be used.
    pub(crate) fn arguments(message: impl Into<String>) -> Self {
        Self::Tool(ToolError::Arguments(message.into()))
    }

    /// Input that cannot be used.
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Tool(ToolError::Input(message.into()))
    }

    /// A failure that is not the user's doing.
    pub(crate) fn stage(message: impl Into<String>) -> Self {
        Self::Tool(ToolError::Stage(message.into()))
    }

    /// A failure to write `path`.
    pub(crate) fn write(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::Tool(ToolError::write(path, error))
    }
}

fn of_tool(error: &ToolError) -> Exit {
    match error {
        ToolError::Settings(_) | ToolError::Arguments(_) => Exit::Arguments,
        ToolError::Trajectory(_) | ToolError::Evaluation { .. } | ToolError::Input(_) => Exit::Input,
        ToolError::Source(_) | ToolError::Journal(_) => Exit::Input,
        ToolError::Transport(error) => of_transport(error),
        ToolError::RunFile(error) => of_stage(error),
        ToolError::Write { .. } | ToolError::Stage(_) => Exit::Stage,
    }
}

fn of_supervisor(error: &SupervisorError) -> Exit {
    match error {
        // A name or folder that cannot be used came from the command line.
        SupervisorError::RunExists { .. }
        | SupervisorError::FolderInUse { .. }
        | SupervisorError::Leftover { .. }
        | SupervisorError::Map { .. }
        | SupervisorError::Directory { .. } => Exit::Arguments,
        SupervisorError::Damaged { .. } => Exit::Input,
        SupervisorError::Transport(error) => of_transport(error),
        SupervisorError::Stage(error) => of_stage(error),
        SupervisorError::OpenFiles { .. } => Exit::Arguments,
        SupervisorError::Spawn { .. } => Exit::Stage,
    }
}

fn of_transport(error: &TransportError) -> Exit {
    match error {
        TransportError::Name { .. } | TransportError::NameInUse { .. } | TransportError::Space { .. } => {
            Exit::Arguments
        }
        _ => Exit::Stage,
    }
}

fn of_stage(error: &StageError) -> Exit {
    match error.exit_code() {
        2 => Exit::Arguments,
        3 => Exit::Input,
        _ => Exit::Stage,
    }
}
