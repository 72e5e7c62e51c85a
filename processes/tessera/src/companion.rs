//! Programs of the project that are built apart, because their crates are many: each is found, or named
//! with the package that has it.

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
    /// The package that installs it.
    package: &'static str,
}

/// Shows a run in Rerun.
pub(crate) const VIEWER: Companion =
    Companion { program: "tessera-view", folder: "view", package: "tessera-slam-view" };
/// Joins a run to a ROS 2 network.
pub(crate) const ROS2: Companion =
    Companion { program: "tessera-ros2", folder: "ros2", package: "tessera-slam-ros2" };

/// Either end of a fleet.
pub(crate) const FLEET: Companion =
    Companion { program: "tessera-fleet", folder: "fleet", package: "tessera-slam-fleet" };

impl Companion {
    /// The program, beside this one, in the checkout (`target/release` of its folder, as seen from
    /// `target/release/tessera`), or on `PATH`.
    ///
    /// # Errors
    /// Where it is not; names the package that has it, and in a checkout how it is built.
    pub(crate) fn command(&self) -> Result<Command, CommandError> {
        let Self { program, folder, .. } = self;
        let beside = std::env::current_exe().ok().and_then(|path| path.parent().map(Path::to_owned));
        let source = beside.as_ref().map(|place| place.join("../..").join(folder));
        let is_checkout = source.as_ref().is_some_and(|source| source.join("Cargo.toml").is_file());
        let checkout = source.map(|source| source.join("target/release"));
        let path = std::env::var_os("PATH").unwrap_or_default();
        let places = beside.into_iter().chain(checkout).chain(std::env::split_paths(&path));
        let found = places.map(|place| place.join(program)).find(|path| path.is_file());
        found.map(Command::new).ok_or_else(|| CommandError::arguments(self.missing(is_checkout)))
    }

    fn missing(&self, is_checkout: bool) -> String {
        let Self { program, folder, package } = self;
        let words = format!(
            "{program} is neither beside this program nor on PATH; the package {package} has it: sudo apt install ./{package}_*.deb"
        );
        match is_checkout {
            true => format!(
                "{words}; in this checkout: cargo build --release --manifest-path {folder}/Cargo.toml"
            ),
            false => words,
        }
    }
}

/// Becomes another program; comes back only where it cannot.
pub(crate) fn become_program(mut command: Command) -> CommandError {
    let error = command.exec();
    CommandError::stage(format!("cannot start {}: {error}", command.get_program().display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_installed_is_named_by_its_package_and_built_in_a_checkout_alone() {
        for (companion, package) in
            [(&VIEWER, "tessera-slam-view"), (&ROS2, "tessera-slam-ros2"), (&FLEET, "tessera-slam-fleet")]
        {
            let installed = companion.missing(false);
            assert!(installed.contains(&format!("the package {package} has it")), "{installed}");
            assert!(!installed.contains("cargo"), "{installed}");
            assert!(companion.missing(true).contains("cargo build"));
        }
    }
}
