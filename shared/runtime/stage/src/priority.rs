//! Priority of a stage among the others.

/// How much lower the priority of the stage is that no frame waits for, in steps of `nice`: the kernel gives it a
/// tenth of a core that another stage wants.
const STEPS_BACK: i32 = 10;

/// Lets the other stages go first. To be called before the process has other threads.
pub(crate) fn step_back() {
    // What is refused here costs the others their time and no result.
    let _ = rustix::process::nice(STEPS_BACK);
}
