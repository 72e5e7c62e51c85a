//! Intensity and colour of the cells of one row.

use crate::planes::Workspace;

/// Those of the middle pixel of each cell.
#[inline(always)]
pub(crate) fn middle(row: usize, step: usize, width: usize, colour: Option<&[u8]>, w: &mut Workspace) {
    let (start, n) = (w.layout.row(row), w.layout.grid.width);
    let (intensity, out) = (&mut w.intensity[start..start + n], &mut w.colour_row[row * n..(row + 1) * n]);
    let Some(colour) = colour else {
        intensity.fill(0.5);
        out.iter_mut().for_each(|c| *c = [128, 128, 128, c[3]]);
        return;
    };
    let height = colour.len() / (3 * width);
    let pixel_row = (row * step + step / 2).min(height - 1);
    let line = &colour[3 * pixel_row * width..3 * (pixel_row + 1) * width];
    match step {
        2 => middle_row::<2>(line, intensity, out),
        4 => middle_row::<4>(line, intensity, out),
        8 => middle_row::<8>(line, intensity, out),
        _ => middle_row::<1>(line, intensity, out),
    }
    // A cell that the image's border cuts short takes the last pixel.
    for column in width / step..n {
        let at = 3 * (column * step + step / 2).min(width - 1);
        (intensity[column], out[column]) = of_pixel(&line[at..at + 3], out[column][3]);
    }
}

#[inline(always)]
fn middle_row<const STEP: usize>(line: &[u8], intensity: &mut [f32], out: &mut [[u8; 4]]) {
    let cells = line.chunks_exact(3 * STEP);
    let at = 3 * (STEP / 2);
    for ((cell, intensity), out) in cells.zip(intensity.iter_mut()).zip(out.iter_mut()) {
        // One load of four bytes where the cell has a fourth.
        let rgb = if at + 4 <= 3 * STEP {
            u32::from_le_bytes([cell[at], cell[at + 1], cell[at + 2], cell[at + 3]])
        } else {
            u32::from_le_bytes([cell[at], cell[at + 1], cell[at + 2], 0])
        };
        let sum = (rgb & 0xff) + ((rgb >> 8) & 0xff) + ((rgb >> 16) & 0xff);
        *intensity = sum as f32 * (1.0 / 765.0);
        *out = ((rgb & 0xff_ffff) | (u32::from(out[3]) << 24)).to_le_bytes();
    }
}

#[inline(always)]
fn of_pixel(rgb: &[u8], row_offset: u8) -> (f32, [u8; 4]) {
    let sum = u32::from(rgb[0]) + u32::from(rgb[1]) + u32::from(rgb[2]);
    (sum as f32 * (1.0 / 765.0), [rgb[0], rgb[1], rgb[2], row_offset])
}
