//! Where a stage runs and before whom: cores, priority, threads, and memory that stays.
//!
//! What the system does not permit is said once in the log, and the stage works without it. No
//! result depends on any of it.

use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit, setpriority_process};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_setaffinity};
use tessera_settings::StageSettings;
use thread_priority::{
    Error, RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Log line of a stage about its place, with what is in force behind it.
pub const PLACED: &str = "placed:";

/// Gives this process its place. To be called while it has one thread: the later ones inherit it.
pub(crate) fn take_place(settings: &StageSettings) {
    let mut in_force = Vec::new();
    let mut note = |what: String, result: Result<(), String>| match result {
        Ok(()) => in_force.push(what),
        Err(reason) => tracing::warn!("without {what}: {reason}"),
    };
    if !settings.cores.is_empty() {
        let cores: Vec<String> = settings.cores.iter().map(u32::to_string).collect();
        note(format!("cores {}", cores.join(",")), keep_to(&settings.cores));
    }
    if settings.nice != 0 {
        note(format!("niceness {}", settings.nice), be_nice(settings.nice));
    }
    if settings.fifo != 0 {
        note(format!("SCHED_FIFO priority {}", settings.fifo), be_real_time(settings.fifo));
    }
    if settings.lock_memory {
        note("locked memory".to_owned(), lock_memory());
    }
    if settings.threads != 0 {
        let threads = settings.threads as usize;
        let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        note(format!("{threads} threads"), built.map_err(|e| e.to_string()));
    }
    if !in_force.is_empty() {
        tracing::info!("{PLACED} {}", in_force.join("; "));
    }
}

fn keep_to(cores: &[u32]) -> Result<(), String> {
    let mut set = CpuSet::new();
    for &core in cores {
        let core = core as usize;
        if core >= CpuSet::MAX_CPU {
            return Err(format!("core {core} is found, the system counts to {}", CpuSet::MAX_CPU - 1));
        }
        set.set(core);
    }
    sched_setaffinity(None, &set).map_err(|error| match error {
        Errno::INVAL => "this process may run on none of them".to_owned(),
        other => other.to_string(),
    })
}

fn be_nice(nice: i32) -> Result<(), String> {
    setpriority_process(None, nice)
        .map_err(|error| format!("{error}; it takes CAP_SYS_NICE or a limit (LimitNICE=, `ulimit -e`)"))
}

fn be_real_time(priority: u32) -> Result<(), String> {
    let value = ThreadPriorityValue::try_from(priority as u8).map_err(|error| format!("{error:?}"))?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy).map_err(
        |error| {
            let words = match error {
                Error::OS(code) => std::io::Error::from_raw_os_error(code).to_string(),
                other => format!("{other:?}"),
            };
            format!("{words}; it takes CAP_SYS_NICE or a limit (LimitRTPRIO=, `ulimit -r`)")
        },
    )
}

/// Pages are locked when they are first touched: whole thread stacks and the mapped map are not
/// read in.
fn lock_memory() -> Result<(), String> {
    // Under a limit the lock would be granted now and the next mapping refused in the middle of
    // the work.
    let is_unlimited = getrlimit(Resource::Memlock).current.is_none();
    let may_exceed = capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    if !is_unlimited && !may_exceed {
        return Err("the limit on locked memory must be lifted (LimitMEMLOCK=infinity, `ulimit -l`)".into());
    }
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT)
        .map_err(|error| error.to_string())
}
