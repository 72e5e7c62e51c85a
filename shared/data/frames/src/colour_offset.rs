//! The offset between two streams of images (method 1.7).

/// From a depth image's stamp to that of the colour image taken with it, before a pair is known, nanoseconds: depth
/// is stamped once it is computed. A Kinect v1 under OpenNI does so 20 ms late (fr1_rpy_400, and again fr1_desk_200),
/// cameras with stamps of their own at once.
const USUAL_OFFSET_NANOS: i64 = -7_500_000;
/// Images belong together when their offset differs from the usual one by less than this.
const MAX_DIFFERENCE_NANOS: i64 = 27_500_000;
/// The offset is followed this far from the usual one: a quarter of a frame at 30 Hz. Beyond three quarters the colour
/// image of the next frame is the nearer one.
const MOST_FOLLOWED_NANOS: i64 = 8_333_333;
/// Pairs of which the running offset is the mean.
const MEMORY: i64 = 16;

/// Running offset from the stamps of depth images to those of their colour images. Two streams of the same rate have
/// one phase: where it is about half a frame, the nearest colour image is now the one before and now the one after, a
/// whole frame later, and the offset tells which goes on with the others.
#[derive(Clone, Copy, Debug, Default)]
pub struct ColourOffset {
    mean_nanos: i64,
    n_pairs: i64,
}

impl ColourOffset {
    /// Images belong together between these differences, nanoseconds.
    pub(crate) const WITHIN_NANOS: [i64; 2] = [
        USUAL_OFFSET_NANOS.saturating_sub(MAX_DIFFERENCE_NANOS),
        USUAL_OFFSET_NANOS.saturating_add(MAX_DIFFERENCE_NANOS),
    ];

    /// Median deviation from the running offset, nanoseconds, up to which stamps jitter: one even over a frame at 30 Hz
    /// has twice that.
    pub(crate) const MOST_JITTER_NANOS: i64 = MOST_FOLLOWED_NANOS / 2;

    /// How far `difference_nanos`, a colour image's stamp less a depth image's, is from what is expected, nanoseconds;
    /// `None` where the two do not belong together.
    pub fn distance_nanos(&self, difference_nanos: i64) -> Option<i64> {
        let from_usual = difference_nanos.saturating_sub(USUAL_OFFSET_NANOS);
        let expected = if self.n_pairs == 0 { 0 } else { self.mean_nanos.saturating_sub(USUAL_OFFSET_NANOS) };
        let expected = expected.clamp(MOST_FOLLOWED_NANOS.saturating_neg(), MOST_FOLLOWED_NANOS);
        let is_near = from_usual.saturating_abs() < MAX_DIFFERENCE_NANOS;
        is_near.then(|| from_usual.saturating_sub(expected).saturating_abs())
    }

    /// Takes in a pair; one of the other side begins anew.
    pub fn add(&mut self, difference_nanos: i64) {
        let is_of_other_side = self.deviation_nanos(difference_nanos) > 2 * MOST_FOLLOWED_NANOS;
        let n_pairs = if is_of_other_side { 0 } else { self.n_pairs };
        self.n_pairs = n_pairs.saturating_add(1).min(MEMORY);
        let step = difference_nanos.saturating_sub(self.mean_nanos).checked_div(self.n_pairs).unwrap_or(0);
        self.mean_nanos = self.mean_nanos.saturating_add(step);
    }

    /// How far a pair's difference is from the running offset, nanoseconds.
    pub(crate) fn deviation_nanos(&self, difference_nanos: i64) -> i64 {
        difference_nanos.saturating_sub(self.mean_nanos).saturating_abs()
    }

    /// When a depth image was taken, nanoseconds: no image is stamped before, and that of colour is stamped sooner.
    pub fn taken_nanos(&self, depth_nanos: i64) -> i64 {
        depth_nanos.saturating_add(self.mean_nanos.min(0))
    }
}
