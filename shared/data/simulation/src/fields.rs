//! Random fields over an image, smooth over a few pixels.

use crate::random;
use crate::render::Scratch;

/// Scale that brings a uniform draw on `[-1, 1]` to unit variance: the sum of squared weights is 19 along
/// rows and along columns, the variance of the draw 1/3.
const OF_UNIFORM: f32 = 1.732_050_8 / 19.0;
/// The same for a field that was smoothed once: weights 1 4 10 16 19 16 10 4 1 in all.
const OF_SMOOTHED: f32 = 19.0 / 1107.0;

/// Three fields of unit variance, smooth over four pixels, into `scratch.fields`.
pub(super) fn draw_fields(key: u64, width: usize, height: usize, scratch: &mut Scratch) {
    let n = width * height;
    for field in &mut scratch.fields {
        field.resize(n, 0.0);
    }
    scratch.work.resize(n.max(width), 0.0);
    let Scratch { fields: [a, b, c], work, .. } = scratch;
    let uniform = |bits: u64| (bits & 0xffff) as f32 * (2.0 / 65_535.0) - 1.0;
    for at in 0..n {
        let word = random::word(key, at as u64);
        a[at] = uniform(word);
        b[at] = uniform(word >> 16);
        c[at] = uniform(word >> 32);
    }
    for field in [a, b, c] {
        smooth(field, work, width, height, OF_UNIFORM);
    }
}

/// Smooths the fields of [`draw_fields`] once more, over seven pixels; their variance stays.
pub(super) fn smooth_again(width: usize, height: usize, scratch: &mut Scratch) {
    let Scratch { fields, work, .. } = scratch;
    for field in fields {
        smooth(field, work, width, height, OF_SMOOTHED);
    }
}

/// Weights 1 2 3 2 1 along rows, then along columns, times `scale`.
fn smooth(field: &mut [f32], work: &mut [f32], width: usize, height: usize, scale: f32) {
    for row in 0..height {
        let from = &field[row * width..(row + 1) * width];
        let to = &mut work[row * width..(row + 1) * width];
        let at = |column: isize| from[column.clamp(0, width as isize - 1) as usize];
        let weighted = |k: isize| 3.0 * at(k) + 2.0 * (at(k - 1) + at(k + 1)) + (at(k - 2) + at(k + 2));
        for column in [0, 1, width - 2, width - 1] {
            to[column] = weighted(column as isize);
        }
        for (value, five) in to[2..width - 2].iter_mut().zip(from.windows(5)) {
            *value = 3.0 * five[2] + 2.0 * (five[1] + five[3]) + (five[0] + five[4]);
        }
    }
    let line = |row: isize| {
        let row = row.clamp(0, height as isize - 1) as usize;
        &work[row * width..(row + 1) * width]
    };
    for row in 0..height {
        let k = row as isize;
        let to = &mut field[row * width..(row + 1) * width];
        let (n2, n1, here, p1, p2) = (line(k - 2), line(k - 1), line(k), line(k + 1), line(k + 2));
        for column in 0..width {
            to[column] =
                scale * (3.0 * here[column] + 2.0 * (n1[column] + p1[column]) + (n2[column] + p2[column]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_have_unit_variance_and_are_smooth_over_a_few_pixels() {
        let (width, height) = (320, 240);
        let mut scratch = Scratch::default();
        draw_fields(99, width, height, &mut scratch);
        for field in &scratch.fields {
            let correlation = |lag: usize| {
                let (mut sum, mut n) = (0.0f64, 0.0);
                for row in 5..height - 5 {
                    for column in 5..width - 15 {
                        let at = row * width + column;
                        sum += f64::from(field[at]) * f64::from(field[at + lag]);
                        n += 1.0;
                    }
                }
                sum / n
            };
            assert!((correlation(0) - 1.0).abs() < 0.05, "{}", correlation(0));
            assert!(correlation(1) > 0.75 && correlation(2) > 0.4, "{} {}", correlation(1), correlation(2));
            assert!(correlation(8).abs() < 0.1, "{}", correlation(8));
        }
        smooth_again(width, height, &mut scratch);
        for field in &scratch.fields {
            let variance = field.iter().map(|v| f64::from(v * v)).sum::<f64>() / field.len() as f64;
            assert!((variance - 1.0).abs() < 0.07, "{variance}");
        }
    }
}
