//! Errors of transport.

use std::path::{Path, PathBuf};

/// A run's shared memory cannot be set up or used.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// A file or folder outside iceoryx2.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A folder that must be private is not.
    #[error("{path} {problem}; remove it, or set XDG_RUNTIME_DIR to a private folder")]
    NotPrivate {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The run's name cannot be a file name.
    #[error(
        "run name {name:?} is not usable: expected 1 to 64 letters, digits, `.`, `_` or `-`, not beginning with `.` or `-`"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// Another run has this name.
    #[error(
        "a run named {name:?} is going on (pid {pid}, {run_dir}); give another --name, or wait for it to end"
    )]
    NameInUse {
        /// The name.
        name: String,
        /// Its supervisor.
        pid: u32,
        /// Its run directory.
        run_dir: PathBuf,
    },
    /// Shared memory is too small.
    #[error(
        "{path} has {} MB free, this run needs {} MB ({need} bytes); free some, enlarge it (Docker: --shm-size={}m){}", free / 1_000_000, need.div_ceil(1_000_000), need.div_ceil(1 << 20), lower_window(*.window)
    )]
    Space {
        /// The file system.
        path: PathBuf,
        /// Bytes free.
        free: u64,
        /// Bytes needed.
        need: u64,
        /// Largest smaller window that fits, if any does.
        window: Option<u32>,
    },
    /// iceoryx2 refused, again and again.
    #[error("cannot open {what}: {reason}")]
    Open {
        /// Which node, service or port.
        what: String,
        /// Its error.
        reason: String,
    },
    /// A message cannot be lent, sent or received.
    #[error("cannot {action} on {service}: {reason}")]
    Message {
        /// What was tried.
        action: &'static str,
        /// Which service.
        service: &'static str,
        /// The error of iceoryx2.
        reason: String,
    },
    /// A living process cannot be connected with; one that is started again can.
    #[error("cannot connect with a living process on {service}, as where memory or open files are used up")]
    Unreached {
        /// Which service.
        service: &'static str,
    },
}

fn lower_window(window: Option<u32>) -> String {
    window.map_or(String::new(), |window| format!(", or lower the window with --set flow.window={window}"))
}

impl TransportError {
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> TransportError {
        move |source| TransportError::Io { action, path: path.into(), source }
    }
}
