//! The program that starts a run is kept by one that only waits: killed or broken, it is started again and
//! takes the run over, as a stage is.

use crate::error::Ros2Error;
use crate::stop_flag;
use rustix::process::{Pid, Signal, getppid, kill_process, set_parent_process_death_signal};
use std::process::{Child, Command, ExitCode, ExitStatus};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Variable by which a kept program knows its keeper: the keeper's process id.
const KEEPER: &str = "TESSERA_ROS2_KEEPER";
/// Exit code of a panic.
const PANIC: i32 = 101;
/// Deaths within [`SHORT`] after which it is not started again.
const MOST_DEATHS: usize = 5;
const SHORT: Duration = Duration::from_secs(60);
/// Time before it is started again.
const AGAIN: Duration = Duration::from_millis(500);
const POLL: Duration = Duration::from_millis(20);

/// Whether this process is to keep another one, which does the work: where it starts a run and is not kept
/// itself.
pub(crate) fn is_needed(starts_run: bool) -> bool {
    starts_run && std::env::var_os(KEEPER).is_none()
}

/// Ends this process where its keeper dies: nothing would take note of its end, or start it again.
pub(crate) fn die_with_keeper() {
    let Some(keeper) = std::env::var(KEEPER).ok().and_then(|pid| pid.parse().ok()) else { return };
    // Fails on no Linux.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    if getppid().map(Pid::as_raw_pid) != Some(keeper) {
        std::process::exit(0);
    }
}

/// Keeps this same program with the same arguments until it ends by itself; its exit code.
///
/// # Errors
/// Where it cannot be started, or dies again and again.
pub(crate) fn keep(is_quiet: bool) -> Result<ExitCode, Ros2Error> {
    let is_stopped = stop_flag()?;
    let broken = |error: std::io::Error| Ros2Error::Run(format!("cannot start this program again: {error}"));
    let program = std::env::current_exe().map_err(broken)?;
    let mut deaths: Vec<Instant> = Vec::new();
    loop {
        let mut command = Command::new(&program);
        command.args(std::env::args_os().skip(1)).env(KEEPER, std::process::id().to_string());
        let mut child = command.spawn().map_err(broken)?;
        let status = wait(&mut child, &|| is_stopped.load(Ordering::Relaxed)).map_err(broken)?;
        if let Some(code) = status.code().filter(|code| *code != PANIC) {
            return Ok(u8::try_from(code).map_or(ExitCode::FAILURE, ExitCode::from));
        }
        if is_stopped.load(Ordering::Relaxed) {
            return Err(Ros2Error::Run(format!("this program died when it was to end: {status}")));
        }
        deaths.retain(|at| at.elapsed() < SHORT);
        deaths.push(Instant::now());
        if deaths.len() > MOST_DEATHS {
            let n = deaths.len();
            return Err(Ros2Error::Run(format!("this program died {n} times in a minute: {status}")));
        }
        if !is_quiet {
            eprintln!("tessera-ros2: died ({status}) and is started again");
        }
        std::thread::sleep(AGAIN);
    }
}

/// Waits for its end; what this process is told is passed on.
fn wait(child: &mut Child, is_stopped: &dyn Fn() -> bool) -> std::io::Result<ExitStatus> {
    let mut is_told = false;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if !is_told && is_stopped() {
            is_told = true;
            // Fails where it has ended.
            let _ = kill_process(Pid::from_child(child), Signal::TERM);
        }
        std::thread::sleep(POLL);
    }
}
