//! Programs of the project that are built apart, because their crates are many: each is found or
//! told how to be built.

use crate::exit::CommandError;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

/// A program that is built apart.
#[derive(Debug)]
pub(crate) struct Companion {
    pub(crate) program: &'static str,
    /// Its folder in the project.
    folder: &'static str,
}

/// Shows a run in Rerun.
pub(crate) const VIEWER: Companion = Companion { program: "tessera-view", folder: "view" };
/// Joins a run to a ROS 2 network.
pub(crate) const ROS2: Companion = Companion { program: "tessera-ros2", folder: "ros2" };

/// Either end of a fleet.
pub(crate) const FLEET: Companion = Companion { program: "tessera-fleet", folder: "fleet" };

impl Companion {
    /// The program, beside this one, in the checkout (`target/release` of its folder, as seen from
    /// `target/release/tessera`), or on `PATH`.
    ///
    /// # Errors
    /// Where it is not; says how to build it.
    pub(crate) fn command(&self) -> Result<Command, CommandError> {
        let Self { program, folder } = self;
        let beside = std::env::current_exe().ok().and_then(|path| path.parent().map(Path::to_owned));
        let checkout = beside.as_ref().map(|place| place.join("../..").join(folder).join("target/release"));
        let path = std::env::var_os("PATH").unwrap_or_default();
        let places = beside.into_iter().chain(checkout).chain(std::env::split_paths(&path));
        let found = places.map(|place| place.join(program)).find(|path| path.is_file());
        found.map(Command::new).ok_or_else(|| {
            CommandError::arguments(format!(
                "{program} is neither beside this program nor on PATH; it is built apart, in the project's folder: cargo build --release --manifest-path {folder}/Cargo.toml"
            ))
        })
    }
}

/// Becomes another program; comes back only where it cannot.
pub(crate) fn become_program(mut command: Command) -> CommandError {
    let error = command.exec();
    CommandError::stage(format!("cannot start {}: {error}", command.get_program().display()))
}
