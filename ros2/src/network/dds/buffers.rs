//! The kernel's receive buffers: where they are too small for images, that is said.

use std::path::Path;

/// Receive buffer that holds the images of two cameras.
const NEEDED_BYTES: u64 = 4 << 20;
const ENOUGH_BYTES: u64 = 8 << 20;
const LIMIT: &str = "/proc/sys/net/core/rmem_max";

/// Words where the kernel's receive buffers are too small for images; `None` where they are not,
/// or it cannot be known.
pub(super) fn doubt_buffers() -> Option<String> {
    let limit = std::fs::read_to_string(Path::new(LIMIT)).ok()?.trim().parse().ok()?;
    doubt_limit(limit)
}

fn doubt_limit(limit: u64) -> Option<String> {
    (limit < NEEDED_BYTES).then(|| {
        format!(
            "net.core.rmem_max is {limit} bytes: images of DDS are larger and get lost; raise it: sudo sysctl -w net.core.rmem_max={ENOUGH_BYTES}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_buffers_are_told_with_the_command_that_raises_them() {
        assert!(doubt_limit(212_992).unwrap().contains("sudo sysctl -w net.core.rmem_max=8388608"));
        assert_eq!(doubt_limit(4 << 20), None);
    }
}
