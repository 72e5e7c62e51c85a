//! Spreading features over the image: an equal share for each cell, the strongest of each cell.

use crate::detect::Corner;

/// The corners of a level by cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Cells {
    /// Cell `c` holds `keys[starts[c]..starts[c + 1]]`.
    starts: Vec<u32>,
    /// `255 - score` above, index of the corner below: ascending is strongest first.
    keys: Vec<u64>,
    next: Vec<u32>,
    spare: Vec<u64>,
}

impl Cells {
    /// Sorts corners by cell.
    pub(crate) fn fill(&mut self, corners: &[Corner], n_cells: usize) {
        refill(&mut self.starts, n_cells + 1, 0);
        corners.iter().for_each(|corner| self.starts[corner.cell as usize + 1] += 1);
        (0..n_cells).for_each(|c| self.starts[c + 1] += self.starts[c]);
        self.next.clear();
        self.next.extend_from_slice(&self.starts);
        refill(&mut self.keys, corners.len(), 0);
        for (index, corner) in corners.iter().enumerate() {
            let next = &mut self.next[corner.cell as usize];
            self.keys[*next as usize] = u64::from(255 - corner.score) << 32 | index as u64;
            *next += 1;
        }
    }

    /// Corners in all cells.
    pub(crate) fn len(&self) -> usize {
        self.keys.len()
    }

    /// Replaces `chosen` by the indices of `quota` corners (or all), ascending: as many from each cell
    /// as an equal share allows, and the rest from the strongest that are left.
    pub(crate) fn choose(&mut self, quota: usize, chosen: &mut Vec<u32>) {
        chosen.clear();
        let share = self.equal_share(quota);
        self.spare.clear();
        for bounds in self.starts.windows(2) {
            let keys = &mut self.keys[bounds[0] as usize..bounds[1] as usize];
            let taken = if keys.len() > share {
                let (_, next, _) = keys.select_nth_unstable(share);
                self.spare.push(*next);
                &keys[..share]
            } else {
                &keys[..]
            };
            chosen.extend(taken.iter().map(|&key| key as u32));
        }
        self.spare.sort_unstable();
        let n_left = quota.saturating_sub(chosen.len());
        chosen.extend(self.spare.iter().take(n_left).map(|&key| key as u32));
        chosen.sort_unstable();
    }

    /// The largest number per cell that sums to at most `quota`.
    fn equal_share(&self, quota: usize) -> usize {
        let total = |share: usize| -> usize {
            self.starts.windows(2).map(|b| ((b[1] - b[0]) as usize).min(share)).sum()
        };
        if total(quota) <= quota {
            return quota;
        }
        let (mut fits, mut exceeds) = (0, quota);
        while exceeds - fits > 1 {
            let middle = fits.midpoint(exceeds);
            *(if total(middle) <= quota { &mut fits } else { &mut exceeds }) = middle;
        }
        fits
    }
}

fn refill<T: Clone>(values: &mut Vec<T>, n: usize, value: T) {
    values.clear();
    values.resize(n, value);
}

/// Splits `total` features over levels in proportion to `1 / scale`. What a level cannot fill goes to
/// the others, the coarsest first.
pub(crate) fn quotas(total: usize, available: &[usize], scales: &[f32]) -> Vec<usize> {
    let sum: f32 = scales.iter().map(|scale| 1.0 / scale).sum();
    let mut quotas: Vec<usize> = available
        .iter()
        .zip(scales)
        .map(|(&available, &scale)| available.min((total as f32 / (scale * sum)) as usize))
        .collect();
    let mut left = total - quotas.iter().sum::<usize>().min(total);
    for (quota, &available) in quotas.iter_mut().zip(available).rev() {
        let more = left.min(available - *quota);
        *quota += more;
        left -= more;
    }
    quotas
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choose(corners: &[(u32, u8)], quota: usize) -> Vec<u32> {
        let corner = |&(cell, score): &(u32, u8)| Corner { row: 0, column: 0, score, cell, around: [0; 4] };
        let corners: Vec<Corner> = corners.iter().map(corner).collect();
        let (mut cells, mut chosen) = (Cells::default(), Vec::new());
        cells.fill(&corners, 4);
        cells.choose(quota, &mut chosen);
        chosen
    }

    #[test]
    fn cells_share_and_the_strongest_of_each_stay() {
        let corners = [(0, 50), (0, 90), (0, 60), (0, 200), (1, 30), (3, 25)];
        assert_eq!(choose(&corners, 3), [3, 4, 5]);
        assert_eq!(choose(&corners, 4), [1, 3, 4, 5]);
        assert_eq!(choose(&corners, 1), [3]);
        assert_eq!(choose(&corners, 100), [0, 1, 2, 3, 4, 5]);
        assert!(choose(&corners, 0).is_empty() && choose(&[], 9).is_empty());
    }

    #[test]
    fn of_equal_corners_the_first_stays() {
        assert_eq!(choose(&[(0, 9), (0, 9), (0, 9), (2, 9), (2, 9)], 3), [0, 1, 3]);
    }

    #[test]
    fn levels_share_by_scale_and_help_each_other() {
        let scales = [1.0, 1.5, 2.0, 3.0];
        let split = quotas(500, &[1000, 1000, 1000, 1000], &scales);
        assert_eq!(split, [200, 133, 100, 67]);
        assert_eq!(quotas(500, &[10, 20, 300, 300], &scales), [10, 20, 170, 300]);
        assert_eq!(quotas(500, &[10, 20, 30, 40], &scales), [10, 20, 30, 40]);
    }
}
