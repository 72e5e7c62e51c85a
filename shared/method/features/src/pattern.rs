//! Sampling pattern of the descriptor, for every orientation.

use crate::patch::{CENTRE, RADIUS, SIDE};
use tessera_numerics::SplitMix64;

/// Sample positions of a descriptor.
pub(crate) const POINTS: usize = 128;
/// Bit `i` of part `k` compares sample `i` with sample `i + SHIFTS[k]`: every sample takes part in
/// four comparisons, and comparisons of neighbouring samples vectorise.
pub(crate) const SHIFTS: [usize; 256 / POINTS] = [37, 64 + 17];
/// Orientations that are told apart: every 5.6 degrees.
const ORIENTATIONS: usize = 64;
/// The draw of the positions.
const SEED: u64 = 0x7e55_e7a0;

/// Indices of the samples in a [`crate::patch::Patch`] for every orientation.
#[derive(Clone, Debug)]
pub(crate) struct Pattern(Vec<[u16; POINTS]>);

impl Pattern {
    /// Positions normally distributed about the corner, as in BRIEF (Calonder et al. 2010),
    /// rotated in steps.
    pub(crate) fn new() -> Self {
        let positions = positions();
        let of_orientation = |orientation: usize| {
            let angle = orientation as f64 * std::f64::consts::TAU / ORIENTATIONS as f64;
            let (sine, cosine) = (libm::sin(angle), libm::cos(angle));
            positions.map(|[x, y]| {
                let column = libm::round(cosine * x - sine * y) + CENTRE as f64;
                let row = libm::round(sine * x + cosine * y) + CENTRE as f64;
                row as u16 * SIDE as u16 + column as u16
            })
        };
        Self((0..ORIENTATIONS).map(of_orientation).collect())
    }

    /// The samples at an orientation.
    #[inline(always)]
    pub(crate) fn at(&self, angle_rad: f32) -> &[u16; POINTS] {
        let turns = angle_rad * (1.0 / std::f32::consts::TAU);
        let orientation = libm::floorf(turns * ORIENTATIONS as f32 + 0.5) as i32;
        &self.0[orientation.rem_euclid(ORIENTATIONS as i32) as usize]
    }
}

/// Column and row from the corner, inside the disc.
fn positions() -> [[f64; 2]; POINTS] {
    let mut random = SplitMix64::new(SEED);
    let reach = RADIUS as f64 - 0.5;
    std::array::from_fn(|_| {
        loop {
            // The sum of twelve uniform numbers is as good as normal here.
            let mut normal = || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
            let [x, y] = [normal() * reach / 1.5, normal() * reach / 1.5];
            if x * x + y * y <= reach * reach {
                return [x, y];
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_stay_inside_the_disc_and_turn_with_the_angle() {
        let pattern = Pattern::new();
        for orientation in 0..ORIENTATIONS {
            for &index in pattern.at(orientation as f32 / ORIENTATIONS as f32 * std::f32::consts::TAU) {
                let v = i32::from(index) / SIDE as i32 - CENTRE as i32;
                let u = i32::from(index) % SIDE as i32 - CENTRE as i32;
                assert!(u * u + v * v <= (RADIUS * RADIUS) as i32);
            }
        }
        let quarter = pattern.at(std::f32::consts::FRAC_PI_2);
        for (&index, &turned) in pattern.at(0.0).iter().zip(quarter) {
            let of = |index: u16| {
                [
                    i32::from(index) % SIDE as i32 - CENTRE as i32,
                    i32::from(index) / SIDE as i32 - CENTRE as i32,
                ]
            };
            let ([x, y], [u, v]) = (of(index), of(turned));
            assert!((u + y).abs() <= 1 && (v - x).abs() <= 1);
        }
        assert_eq!(pattern.at(-0.5), pattern.at(-0.5 + std::f32::consts::TAU));
    }
}
