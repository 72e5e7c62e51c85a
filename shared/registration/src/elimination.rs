//! In which order poses are eliminated from a sparse system, and which blocks fill in.

/// An order of elimination with the factor's pattern; worked out once for a graph.
pub(crate) struct Elimination {
    /// Place in the order of each pose.
    pub(crate) place: Vec<usize>,
    /// Column `c` of the factor has its blocks below the diagonal at `starts[c]..starts[c + 1]`.
    pub(crate) starts: Vec<usize>,
    /// Their rows, rising within a column; rows and columns are places in the order.
    pub(crate) rows: Vec<u32>,
}

/// Bits of a word of the sets below.
const BITS: usize = u64::BITS as usize;

impl Elimination {
    /// Minimum degree: next comes the pose with the fewest neighbours left, the first among equals,
    /// and its neighbours become neighbours of each other. `pairs` are the system's blocks off the
    /// diagonal.
    pub(crate) fn new(n: usize, pairs: &[(usize, usize)]) -> Self {
        let n_words = n.div_ceil(BITS);
        let mut neighbours = vec![0u64; n * n_words];
        for &(a, b) in pairs.iter().filter(|(a, b)| a != b) {
            neighbours[a * n_words + b / BITS] |= 1 << (b % BITS);
            neighbours[b * n_words + a / BITS] |= 1 << (a % BITS);
        }
        let mut degree: Vec<u32> = neighbours.chunks(n_words.max(1)).map(count).collect();
        let mut place = vec![usize::MAX; n];
        let mut below: Vec<usize> = Vec::new();
        let mut starts = vec![0];
        let mut own = vec![0u64; n_words];
        for next in 0..n {
            let left = (0..n).filter(|&pose| place[pose] == usize::MAX);
            let Some(pose) = left.min_by_key(|&pose| degree[pose]) else { break };
            place[pose] = next;
            own.copy_from_slice(&neighbours[pose * n_words..][..n_words]);
            let first = below.len();
            below.extend(members(&own));
            for &other in &below[first..] {
                let row = &mut neighbours[other * n_words..][..n_words];
                for (word, mine) in row.iter_mut().zip(&own) {
                    *word |= mine;
                }
                row[other / BITS] &= !(1 << (other % BITS));
                row[pose / BITS] &= !(1 << (pose % BITS));
                degree[other] = count(row);
            }
            starts.push(below.len());
        }
        let mut rows: Vec<u32> = below.iter().map(|&pose| place[pose] as u32).collect();
        starts.windows(2).for_each(|column| rows[column[0]..column[1]].sort_unstable());
        Self { place, starts, rows }
    }
}

fn count(set: &[u64]) -> u32 {
    set.iter().map(|word| word.count_ones()).sum()
}

fn members(set: &[u64]) -> impl Iterator<Item = usize> {
    set.iter().enumerate().flat_map(|(at, &word)| {
        let mut rest = word;
        std::iter::from_fn(move || {
            let bit = (rest != 0).then_some(rest.trailing_zeros() as usize)?;
            rest &= rest - 1;
            Some(at * BITS + bit)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_fills_nothing_in_and_a_star_ends_with_its_middle() {
        let chain: Vec<_> = (1..100).map(|i| (i, i - 1)).collect();
        assert_eq!(Elimination::new(100, &chain).rows.len(), 99);
        let star: Vec<_> = (0..99).map(|i| (99, i)).collect();
        let star = Elimination::new(100, &star);
        assert_eq!((star.rows.len(), star.place[99]), (99, 99));
    }

    #[test]
    fn every_block_and_every_fill_has_a_place_below_the_diagonal() {
        let n = 70;
        let pairs: Vec<_> = (0..n).flat_map(|i| [(i, (i + 1) % n), (i, (i * 37 + 11) % n)]).collect();
        let found = Elimination::new(n, &pairs);
        let column = |c: usize| &found.rows[found.starts[c]..found.starts[c + 1]];
        for &(a, b) in pairs.iter().filter(|(a, b)| a != b) {
            let (a, b) = (found.place[a], found.place[b]);
            assert!(column(a.min(b)).contains(&(a.max(b) as u32)));
        }
        for c in 0..n {
            let rows = column(c);
            assert!(rows.iter().all(|&r| r as usize > c) && rows.windows(2).all(|w| w[0] < w[1]));
            for (k, &row) in rows.iter().enumerate() {
                assert!(rows[k + 1..].iter().all(|r| column(row as usize).contains(r)), "fill of {c}");
            }
        }
    }
}
