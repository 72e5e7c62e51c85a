//! The `align` stage as a process of its own, for a debugger or a profiler:
//! `tessera-align RUN_DIR`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(run_dir) = std::env::args_os().nth(1) else {
        eprintln!("align: expected one argument, the run directory");
        return ExitCode::from(2);
    };
    tessera_align::main(&tessera_stage::StageArgs { run_dir: run_dir.into(), watch_stdin: false })
}
