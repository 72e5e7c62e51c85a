//! Stamps of a live camera's images: they rise, and one that was misread costs its image alone. Taken, it would
//! have all later ones refused, for they lie before it.

/// Time by which stamps may run ahead of this machine's clock from one image to the next, nanoseconds. Less than
/// `run.camera_timeout_s` by default: a smaller jump refuses images for as long, and the run goes on.
const AHEAD_NANOS: i64 = 10_000_000_000;
/// Time that an image which was left out may have taken, nanoseconds.
const IMAGE_NANOS: i64 = 1_000_000_000;

/// The last image that was taken.
#[derive(Clone, Copy, Debug)]
struct TakenStamp {
    stamp_nanos: i64,
    /// Time from the one before it, by their stamps.
    step_nanos: i64,
    /// When it came, on the monotonic clock.
    came_nanos: u64,
}

/// Stamps so far.
#[derive(Debug, Default)]
pub(super) struct Stamps {
    last: Option<TakenStamp>,
    /// A stamp far ahead that was refused, and nothing was taken since.
    doubted: Option<i64>,
}

impl Stamps {
    /// Time from the last image that was taken to this stamp.
    pub(super) fn since_last(&self, stamp_nanos: i64) -> Option<i64> {
        self.last.map(|last| stamp_nanos.saturating_sub(last.stamp_nanos))
    }

    /// Whether an image that leaves `n_left_out` out and comes at `now_nanos` may have this stamp. One far ahead
    /// is refused once: where the next image confirms it, the machine had slept, or the camera had paused.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn check(
        &mut self,
        image: u64,
        stamp_nanos: i64,
        n_left_out: u64,
        now_nanos: u64,
    ) -> Result<(), String> {
        let Some(last) = self.last else { return Ok(()) };
        let found = format!("frame {image}: stamp_nanos is {stamp_nanos}");
        if stamp_nanos <= last.stamp_nanos {
            return Err(format!(
                "{found}, expected more than {} as the image before it has",
                last.stamp_nanos
            ));
        }
        let nanos = |n: u64| i64::try_from(n).unwrap_or(i64::MAX);
        let elapsed = nanos(now_nanos.saturating_sub(last.came_nanos));
        let most = AHEAD_NANOS
            .saturating_add(elapsed.max(last.step_nanos).saturating_mul(2))
            .saturating_add(nanos(n_left_out).saturating_mul(IMAGE_NANOS));
        let is_confirmed = self.doubted.is_some_and(|doubted| doubted < stamp_nanos);
        if stamp_nanos.saturating_sub(last.stamp_nanos) <= most || is_confirmed {
            return Ok(());
        }
        self.doubted = Some(stamp_nanos);
        let limit = last.stamp_nanos.saturating_add(most);
        Err(format!("{found}, expected at most {limit}, unless the next image confirms it"))
    }

    /// Notes an image that was taken.
    pub(super) fn take(&mut self, stamp_nanos: i64, now_nanos: u64) {
        let step_nanos = self.since_last(stamp_nanos).unwrap_or(0);
        *self =
            Self { last: Some(TakenStamp { stamp_nanos, step_nanos, came_nanos: now_nanos }), doubted: None };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Whether images with these stamps are taken, one after the other each 33 ms.
    fn are_taken(stamps_ms: &[i64]) -> Vec<bool> {
        let mut stamps = Stamps::default();
        let times = (0..).map(|k: u64| k * 33_000_000);
        let take = |(stamp_ms, now): (&i64, u64)| {
            let stamp = stamp_ms.saturating_mul(MS);
            let is_taken = stamps.check(7, stamp, 0, now).is_ok();
            if is_taken {
                stamps.take(stamp, now);
            }
            is_taken
        };
        stamps_ms.iter().zip(times).map(take).collect()
    }

    #[test]
    fn a_stamp_that_was_misread_costs_its_image_alone() {
        for misread in [100_000, 1 << 40, i64::MAX, i64::MIN, 5] {
            assert_eq!(are_taken(&[10, 43, misread, 76, 109]), [true, true, false, true, true], "{misread}");
        }
        let mut stamps = Stamps::default();
        stamps.take(0, 0);
        let words = stamps.check(7, 60_000 * MS, 0, 33_000_000).unwrap_err();
        assert!(
            words.starts_with("frame 7: stamp_nanos is 60000000000, expected at most 10066000000"),
            "{words}"
        );
        assert!(stamps.check(8, 0, 0, 66_000_000).unwrap_err().contains("expected more than 0"));
    }

    #[test]
    fn a_machine_that_slept_a_pause_and_slow_images_are_believed() {
        let hour = 3_600_000;
        assert_eq!(are_taken(&[10, 43, hour, hour + 33, hour + 66]), [true, true, false, true, true]);
        // Images each minute, played fast.
        assert_eq!(are_taken(&[0, 60_000, 120_000, 180_000, 240_000]), [true, false, true, true, true]);
        let mut stamps = Stamps::default();
        stamps.take(0, 0);
        assert!(stamps.check(1, 60_000 * MS, 0, 60_000_000_000).is_ok(), "it came a minute later");
        assert!(
            stamps.check(1801, 60_000 * MS, 1800, 33_000_000).is_ok(),
            "its index tells of the pause too"
        );
    }
}
