//! Depth images that no camera takes: bytes in the wrong order, and one image again and again.

use std::hash::{DefaultHasher, Hash, Hasher};

/// How much rougher an image is than with its bytes swapped where these are in the wrong order: noise of the
/// lower byte becomes steps of half the range.
const MANY_TIMES_ROUGHER: f64 = 10.0;
/// Images in a row that may be one and the same: cameras repeat one where they deliver faster than they take.
const FEW: u64 = 4;

/// What is seen of some images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OddDepth {
    /// Sums of the steps between neighbours relative to their depth: as the bytes are, and swapped.
    steps: [f64; 2],
    /// For each image with depth its index and what tells it from others.
    images: Vec<(u64, u64)>,
}

impl OddDepth {
    /// Looks at an image.
    pub(crate) fn add(&mut self, index: u64, depth_raw: &[u16]) {
        let is_depth = |raw: &u16| *raw != 0 && *raw != u16::MAX;
        let mut n = 0_u64;
        for (&a, &b) in
            depth_raw.iter().zip(depth_raw.iter().skip(1)).filter(|(a, b)| is_depth(a) && is_depth(b))
        {
            n = n.saturating_add(1);
            for (sum, [a, b]) in self.steps.iter_mut().zip([[a, b], [a, b].map(u16::swap_bytes)]) {
                *sum += f64::from(a.abs_diff(b)) / (f64::from(a) + f64::from(b));
            }
        }
        if n > 0 {
            let mut hasher = DefaultHasher::new();
            depth_raw.hash(&mut hasher);
            self.images.push((index, hasher.finish()));
        }
    }

    /// What looks wrong, in sentences.
    pub(crate) fn doubts(&self) -> Vec<String> {
        self.byte_order().into_iter().chain(self.repeated()).collect()
    }

    /// That the bytes of each value are in the wrong order.
    pub(crate) fn byte_order(&self) -> Option<String> {
        let [as_it_is, swapped] = self.steps;
        (as_it_is > MANY_TIMES_ROUGHER * swapped && swapped > 0.0).then(|| {
            format!(
                "neighbouring pixels differ by {:.0} times less with both bytes of each value swapped: depth was written in the other byte order; write it again (numpy: image.byteswap())",
                as_it_is / swapped
            )
        })
    }

    /// That one image comes again and again.
    fn repeated(&self) -> Option<String> {
        let mut pairs = self.images.iter().zip(self.images.iter().skip(1));
        let (a, b) = pairs.find(|(a, b)| a.1 == b.1 && b.0.saturating_sub(a.0) >= FEW)?;
        Some(format!(
            "frames {} and {} have the same depth image, bit for bit: depth stood still, or one image was written again and again",
            a.0, b.0
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(noise: u16) -> Vec<u16> {
        (0..4000_u32).map(|at| 1500 + (at % 80) as u16 * 7 + (at * 7919 % 13) as u16 + noise).collect()
    }

    fn doubts(images: &[(u64, Vec<u16>)]) -> String {
        let mut odd = OddDepth::default();
        images.iter().for_each(|(index, image)| odd.add(*index, image));
        odd.doubts().join("\n")
    }

    #[test]
    fn swapped_bytes_are_named() {
        assert_eq!(doubts(&[(0, wall(0))]), "");
        let swapped: Vec<u16> = wall(0).iter().map(|raw| raw.swap_bytes()).collect();
        assert!(doubts(&[(0, swapped)]).contains("in the other byte order"));
    }

    #[test]
    fn an_image_that_is_repeated_for_long_is_named() {
        assert_eq!(doubts(&[(0, wall(0)), (4, wall(1)), (8, wall(2))]), "");
        assert_eq!(
            doubts(&[(0, wall(0)), (1, wall(0)), (2, wall(0))]),
            "",
            "a camera that delivers too fast"
        );
        assert_eq!(doubts(&[(0, vec![0; 9]), (8, vec![0; 9])]), "", "no depth at all is said elsewhere");
        assert!(doubts(&[(0, wall(0)), (4, wall(1)), (8, wall(1))]).contains("frames 4 and 8 have the same"));
    }
}
