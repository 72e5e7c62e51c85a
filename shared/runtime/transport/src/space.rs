//! Check of the space in shared memory, before a full one kills the run.
//!
//! Segments are sparse files: they always open, and a write into a full /dev/shm is a SIGBUS.

use crate::cleanup::{SHARED_MEMORY, shared_memory_files};
use crate::error::TransportError;
use crate::identity::RunIdentity;
use crate::layout::Layout;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Compares what the layout needs with what /dev/shm has free; answers the bytes needed.
///
/// # Errors
/// [`TransportError::Space`] with the numbers and a window that fits.
pub fn check_space(layout: &Layout) -> Result<u64, TransportError> {
    let path = Path::new(SHARED_MEMORY);
    let stat = rustix::fs::statvfs(path)
        .map_err(|errno| TransportError::io("look at the free space of", path)(errno.into()))?;
    check_free(layout, stat.f_bavail.saturating_mul(stat.f_frsize))
}

fn check_free(layout: &Layout, free: u64) -> Result<u64, TransportError> {
    let need = layout.shared_memory_bytes();
    if need <= free {
        return Ok(need);
    }
    let fits = |window: &u32| Layout { window: *window, ..*layout }.shared_memory_bytes() <= free;
    let window = (1..layout.window).rev().find(fits);
    Err(TransportError::Space { path: SHARED_MEMORY.into(), free, need, window })
}

/// Bytes of shared memory that a run has really touched.
pub fn shared_memory_in_use(identity: &RunIdentity) -> u64 {
    shared_memory_files(identity)
        .iter()
        .filter_map(|path| std::fs::metadata(path).ok())
        .map(|meta| meta.blocks().saturating_mul(512))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_messages::FrameShape;
    use tessera_surface::Grid;

    #[test]
    fn too_little_space_names_the_window_that_fits() {
        let layout = Layout {
            frame: FrameShape { width: 640, height: 480 },
            grid: Grid { width: 160, height: 120, step: 4 },
            window: 8,
            recent: 10,
            ahead: 3,
            live: false,
            external: false,
        };
        let need = layout.shared_memory_bytes();
        assert_eq!(check_free(&layout, need).unwrap(), need);
        let message = check_free(&layout, need - 1).unwrap_err().to_string();
        assert!(message.contains("flow.window=7") && message.contains(&need.to_string()), "{message}");
        assert!(message.contains("Docker: --shm-size="), "{message}");
        // No advice that does not help.
        let message = check_free(&layout, 1000).unwrap_err().to_string();
        assert!(!message.contains("flow.window"), "{message}");
        let least = Layout { window: 1, ..layout };
        assert!(!check_free(&least, 1000).unwrap_err().to_string().contains("flow.window"));
    }
}
