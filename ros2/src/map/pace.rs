//! When what shows the whole map is due again: not while nothing moved, and not more often than a
//! network and its readers can bear.

use super::follow::Scene;
use std::time::{Duration, Instant};

/// Least time between two of a kind.
const PERIOD: Duration = Duration::from_secs(5);
/// Bytes a second on average, at most.
const BYTES_PER_S: f64 = 2e6;

/// The keyframes as they were shown last, and when they may be shown again.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    shown: Scene,
    next: Option<Instant>,
}

impl Pace {
    /// Whether this is to be shown now; `is_last` waits for nothing.
    pub(crate) fn is_due(&self, scene: &Scene, now: Instant, is_last: bool) -> bool {
        *scene != self.shown && (is_last || self.next.is_none_or(|next| now >= next))
    }

    /// Notes that it was shown with so many bytes.
    pub(crate) fn show(&mut self, scene: Scene, now: Instant, n_bytes: usize) {
        let wait = PERIOD.max(Duration::from_secs_f64(n_bytes as f64 / BYTES_PER_S));
        (self.shown, self.next) = (scene, Some(now + wait));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::Pose;

    #[test]
    fn what_moved_is_shown_again_after_a_while() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        let scene = |x| vec![(0, Pose::translation(x, 0.0, 0.0))];
        let after = |seconds| now + Duration::from_secs(seconds);
        assert!(!pace.is_due(&Vec::new(), now, true), "there is no keyframe");
        assert!(pace.is_due(&scene(0.0), now, false));
        pace.show(scene(0.0), now, 1000);
        assert!(!pace.is_due(&scene(0.0), after(60), true));
        assert!(!pace.is_due(&scene(1.0), after(4), false) && pace.is_due(&scene(1.0), after(4), true));
        assert!(pace.is_due(&scene(1.0), after(5), false));
        pace.show(scene(1.0), now, 40_000_000);
        assert!(!pace.is_due(&scene(2.0), after(19), false) && pace.is_due(&scene(2.0), after(20), false));
    }
}
