//! The `tessera` executable: the command, the supervisor and, on request, any one stage.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    tessera_command::main()
}
