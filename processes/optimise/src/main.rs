//! The `optimise` stage as a process of its own, for a debugger or a profiler:
//! `tessera-optimise RUN_DIR`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(run_dir) = std::env::args_os().nth(1) else {
        eprintln!("optimise: expected one argument, the run directory");
        return ExitCode::from(2);
    };
    tessera_optimise::main(&tessera_stage::StageArgs { run_dir: run_dir.into(), watch_stdin: false })
}
