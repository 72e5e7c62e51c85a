//! The FAST-9 corner score of every pixel (Rosten and Drummond 2006), without a branch per pixel.
//!
//! A pixel is a corner at threshold `t` where nine contiguous pixels of the ring of sixteen are all
//! brighter than it by more than `t`, or all darker. The largest such `t` is
//! `max over arcs of (min of arc) - centre`, or its counterpart for dark arcs, so that the score
//! needs minima and maxima of bytes alone: one instruction for 16 to 64 pixels.

use tessera_numerics::{Bits, WORD};

/// Pixels that are scored at a time.
pub(crate) const RUN: usize = 32;
/// Radius of the ring.
const RADIUS: usize = 3;
/// Bytes of a row that a run reads.
const SPAN: usize = RUN + 2 * RADIUS;

/// The scores of a row by column, and a bit for each run, from the first scored column on, that holds one above the
/// floor.
#[derive(Clone, Debug, Default)]
pub(crate) struct ScoreRow {
    pub(crate) scores: Vec<u8>,
    pub(crate) runs: Vec<u64>,
}

/// Scores a part of row `row`; 0 where no pixel of a whole run can have a score above `floor`.
///
/// Up to `RUN - 1` values beyond the last column are written and mean nothing. The ring must lie
/// inside the image, and `RUN` more pixels beyond it inside its buffer.
#[inline(always)]
pub(crate) fn score_row(
    pixels: &[u8],
    width: usize,
    row: usize,
    columns: std::ops::Range<usize>,
    floor: u8,
    out: &mut ScoreRow,
) {
    let n_runs = columns.len().div_ceil(RUN);
    let first = (row - RADIUS) * width + columns.start - RADIUS;
    let window = |run: usize| -> Window<'_> {
        std::array::from_fn(|r| pixels[first + r * width + run * RUN..].first_chunk().unwrap_or(&[0; SPAN]))
    };
    let scored = &mut out.scores[columns.start..][..n_runs * RUN];
    bounds(pixels, width, first, scored);
    out.runs.clear();
    out.runs.resize(n_runs.div_ceil(WORD), 0);
    for (run, bounds) in scored.as_chunks().0.iter().enumerate() {
        out.runs[run / WORD] |= u64::from(is_above(bounds, floor)) << (run % WORD);
    }
    scored.fill(0);
    for (word, bits) in out.runs.iter_mut().enumerate() {
        for bit in Bits(std::mem::take(bits)) {
            let run = word * WORD + bit;
            let scores = scores(&window(run));
            *bits |= u64::from(is_above(&scores, floor)) << bit;
            scored[run * RUN..][..RUN].copy_from_slice(&scores);
        }
    }
}

#[inline(always)]
fn is_above(values: &[u8; RUN], floor: u8) -> bool {
    values.iter().fold(0, |any, value| any | value.saturating_sub(floor)) != 0
}

/// What a run reads, row by row.
type Window<'a> = [&'a [u8; SPAN]; 7];

/// The pixels of a window at a row and column of the ring.
#[inline(always)]
fn at<'a>(window: &Window<'a>, (row, column): (usize, usize)) -> &'a [u8; RUN] {
    window[row][column..].first_chunk().unwrap_or(&[0; RUN])
}

/// An upper bound of the score of each pixel of a row: an arc of nine holds two neighbours of the
/// four pixels above, right, below and left, and two of the four between them.
#[inline(always)]
fn bounds(pixels: &[u8], width: usize, first: usize, out: &mut [u8]) {
    let n = out.len();
    let at = |row: usize, column: usize| &pixels[first + row * width + column..][..n];
    let (north, east, south, west) = (at(0, 3), at(3, 6), at(6, 3), at(3, 0));
    let (north_east, south_east, south_west, north_west) = (at(1, 5), at(5, 5), at(5, 1), at(1, 1));
    let centre = at(3, 3);
    for i in 0..n {
        let (n, e, s, w) = (north[i], east[i], south[i], west[i]);
        let (a, b, c, d) = (north_east[i], south_east[i], south_west[i], north_west[i]);
        let bright = n.max(s).min(w.max(e)).min(a.max(c).min(b.max(d)));
        let dark = n.min(s).max(w.min(e)).max(a.min(c).max(b.min(d)));
        out[i] = bright.saturating_sub(centre[i]).max(centre[i].saturating_sub(dark));
    }
}

/// Ring of sixteen as row and column in the window, clockwise from above.
const RING: [(usize, usize); 16] = [
    (0, 3),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 6),
    (4, 6),
    (5, 5),
    (6, 4),
    (6, 3),
    (6, 2),
    (5, 1),
    (4, 0),
    (3, 0),
    (2, 0),
    (1, 1),
    (0, 2),
];

#[inline(always)]
fn scores(window: &Window<'_>) -> [u8; RUN] {
    let rings: [&[u8; RUN]; 16] = std::array::from_fn(|k| at(window, RING[k]));
    let centres = at(window, (RADIUS, RADIUS));
    let mut out = [0; RUN];
    for i in 0..RUN {
        let (ring, centre) = (std::array::from_fn(|k| rings[k][i]), centres[i]);
        let bright = arcs(&ring, u8::min, u8::max).saturating_sub(centre);
        let dark = centre.saturating_sub(arcs(&ring, u8::max, u8::min));
        out[i] = bright.max(dark);
    }
    out
}

/// `outer` over all sixteen arcs of nine of `inner` over the arc. The two arcs that share the eight
/// pixels after an odd one are taken together: `outer(inner(eight, one end), inner(eight, other))`
/// is `inner(eight, outer(of both ends))`.
#[inline(always)]
fn arcs(ring: &[u8; 16], inner: impl Fn(u8, u8) -> u8, outer: impl Fn(u8, u8) -> u8) -> u8 {
    let two: [u8; 8] = std::array::from_fn(|k| inner(ring[2 * k + 1], ring[(2 * k + 2) % 16]));
    let four: [u8; 8] = std::array::from_fn(|k| inner(two[k], two[(k + 1) % 8]));
    let eight: [u8; 8] = std::array::from_fn(|k| inner(four[k], four[(k + 2) % 8]));
    let both: [u8; 8] = std::array::from_fn(|k| inner(eight[k], outer(ring[2 * k], ring[(2 * k + 9) % 16])));
    let pairs: [u8; 4] = std::array::from_fn(|k| outer(both[k], both[k + 4]));
    outer(outer(pairs[0], pairs[1]), outer(pairs[2], pairs[3]))
}

/// Keeps the scores of `middle` from `column` on that are above `floor` and that no neighbour
/// exceeds; of equal neighbours the first in reading order stays. Others become 0.
#[inline(always)]
pub(crate) fn suppress(rows: [&[u8]; 3], column: usize, floor: u8) -> [u8; RUN] {
    let [[a, b, c], [left, middle, right], [d, e, f]] = rows.map(|row| -> [&[u8; RUN]; 3] {
        let run = &row[column - 1..][..RUN + 2];
        std::array::from_fn(|k| run[k..].first_chunk().unwrap_or(&[0; RUN]))
    });
    let mut out = [0; RUN];
    for i in 0..RUN {
        let before = a[i].max(b[i]).max(c[i]).max(left[i]).max(floor);
        let after = d[i].max(e[i]).max(f[i]).max(right[i]);
        out[i] = if (middle[i] > before) & (middle[i] >= after) { middle[i] } else { 0 };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    /// The definition, threshold by threshold.
    fn reference(ring: &[u8; 16], centre: u8) -> u8 {
        let is_corner = |t: i32| {
            (0..16).any(|first| {
                let difference = |k: usize| i32::from(ring[(first + k) % 16]) - i32::from(centre);
                (0..9).all(|k| difference(k) > t) || (0..9).all(|k| difference(k) < -t)
            })
        };
        (0..=255).take_while(|&t| is_corner(t)).count() as u8
    }

    #[test]
    fn the_score_is_the_largest_threshold_of_a_corner() {
        let (width, height) = (64, 40);
        let mut random = SplitMix64::new(3);
        for contrast in [3, 40, 256] {
            let pixels: Vec<u8> = (0..width * height)
                .map(|i| (random.below(contrast) + if i % width > 30 { 128 - contrast / 2 } else { 0 }) as u8)
                .collect();
            let mut n_corners = 0;
            for row in [3, 9, 20] {
                let mut found = ScoreRow { scores: vec![0; width + RUN], runs: Vec::new() };
                score_row(&pixels, width, row, 3..width - 3, 5, &mut found);
                let ScoreRow { scores: found, runs } = found;
                for column in 3..width - 3 {
                    let ring: [u8; 16] = std::array::from_fn(|k| {
                        pixels[(row + RING[k].0 - 3) * width + column + RING[k].1 - 3]
                    });
                    // A corner at `t` for all `t` below the score: the score itself is no corner.
                    let score = reference(&ring, pixels[row * width + column]);
                    let is_skipped = found[column] == 0 && score <= 5;
                    assert!(found[column] == score || is_skipped, "{contrast} {row} {column}");
                    n_corners += usize::from(score > 5);
                    assert!(
                        score <= 5 || runs[0] >> ((column - 3) / RUN) & 1 == 1,
                        "{contrast} {row} {column}"
                    );
                }
            }
            assert!(n_corners > 0 || contrast == 3, "a test without corners tests nothing");
        }
    }

    #[test]
    fn one_of_equal_neighbours_survives() {
        let (mut above, mut middle, below) = (vec![0; 40], vec![0; 40], vec![0; 40]);
        middle[5..8].fill(30);
        above[20] = 30;
        middle[21] = 30;
        middle[27] = 4;
        let kept = suppress([&above, &middle, &below], 1, 4);
        let columns: Vec<usize> = (0..RUN).filter(|&i| kept[i] > 0).map(|i| i + 1).collect();
        assert_eq!(columns, [5]);
    }
}
