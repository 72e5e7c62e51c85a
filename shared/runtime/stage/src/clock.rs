//! The clock that latencies and epochs are told by.

use rustix::time::{ClockId, clock_gettime};

/// Nanoseconds of the monotonic clock: the same in all processes, never steps back, and no result
/// depends on it.
pub fn monotonic_nanos() -> u64 {
    nanos(ClockId::Monotonic)
}

/// CPU time that this process has used, nanoseconds.
pub fn cpu_nanos() -> u64 {
    nanos(ClockId::ProcessCPUTime)
}

fn nanos(id: ClockId) -> u64 {
    let time = clock_gettime(id);
    (time.tv_sec as u64).saturating_mul(1_000_000_000).saturating_add(time.tv_nsec as u64)
}
