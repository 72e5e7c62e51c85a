//! Elimination order of the poses of a sparse system, and the blocks that fill in.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

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

/// Poses up to which the minimum degree is searched for exactly, at a cost of O(n^2).
///
/// Graphs of six neighbours and a far one at every third pose: 0.2, 3 and 45 ms for 200, 1,000 and
/// 2,000 poses, AMD 0.3, 10 and 8 ms; 5,000 poses 345 and 29 ms, AMD with 6 % fewer blocks.
const MOST_EXACT: usize = 2000;

impl Elimination {
    /// The order for a system of `n` poses; `pairs` are its blocks off the diagonal. Minimum degree,
    /// approximate (AMD) in systems of more than [`MOST_EXACT`] poses.
    pub(crate) fn new(n: usize, pairs: &[(usize, usize)]) -> Self {
        let approximate = if n > MOST_EXACT { approximate_minimum_degree(n, pairs) } else { None };
        approximate.map_or_else(|| Self::minimum_degree(n, pairs), |place| Self::in_order(place, pairs))
    }

    /// The factor's pattern for a given order: a column fills in with the rows of its children in
    /// the elimination tree.
    fn in_order(place: Vec<usize>, pairs: &[(usize, usize)]) -> Self {
        let n = place.len();
        let mut columns: Vec<Vec<u32>> = vec![Vec::new(); n];
        for &(a, b) in pairs.iter().filter(|(a, b)| a != b) {
            let (a, b) = (place[a], place[b]);
            columns[a.min(b)].push(a.max(b) as u32);
        }
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for column in 0..n {
            let mut own = std::mem::take(&mut columns[column]);
            own.sort_unstable();
            own.dedup();
            if let Some((&parent, others)) = own.split_first() {
                columns[parent as usize].extend(others);
            }
            rows.append(&mut own);
            starts.push(rows.len());
        }
        Self { place, starts, rows }
    }

    /// Minimum degree: next comes the pose with the fewest neighbours left, the first among equals,
    /// and its neighbours become neighbours of each other.
    fn minimum_degree(n: usize, pairs: &[(usize, usize)]) -> Self {
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

/// Place of each pose by faer's approximate minimum degree; integers alone, so that all machines
/// agree. `None` where it has no memory to work in.
fn approximate_minimum_degree(n: usize, pairs: &[(usize, usize)]) -> Option<Vec<usize>> {
    let mut columns: Vec<Vec<usize>> = vec![Vec::new(); n];
    for &(a, b) in pairs.iter().filter(|(a, b)| a != b) {
        columns[a.max(b)].push(a.min(b));
    }
    let (mut starts, mut rows) = (vec![0], Vec::new());
    for column in &mut columns {
        column.sort_unstable();
        column.dedup();
        rows.append(column);
        starts.push(rows.len());
    }
    let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
    let mut memory = MemBuffer::try_new(amd::order_scratch::<usize>(n, rows.len())).ok()?;
    let (mut order, mut place) = (vec![0; n], vec![0; n]);
    let control = amd::Control::default();
    amd::order(&mut order, &mut place, pattern, control, MemStack::new(&mut memory)).ok()?;
    Some(place)
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
        for (n, place) in [(70, None), (70, approximate_minimum_degree(70, &pairs_of(70)))] {
            let found = place.map_or_else(
                || Elimination::new(n, &pairs_of(n)),
                |place| Elimination::in_order(place, &pairs_of(n)),
            );
            check_pattern(&found, &pairs_of(n));
        }
        // Large enough for the approximate order.
        let n = MOST_EXACT + 1;
        check_pattern(&Elimination::new(n, &chain_of(n)), &chain_of(n));
    }

    #[test]
    fn a_given_order_has_the_pattern_that_elimination_finds() {
        let exact = Elimination::minimum_degree(70, &pairs_of(70));
        let again = Elimination::in_order(exact.place.clone(), &pairs_of(70));
        assert_eq!((exact.starts, exact.rows), (again.starts, again.rows));
    }

    #[test]
    fn the_approximate_order_fills_in_little_more() {
        let pairs = chain_of(600);
        let exact = Elimination::minimum_degree(600, &pairs).rows.len();
        let place = approximate_minimum_degree(600, &pairs).unwrap();
        let approximate = Elimination::in_order(place, &pairs).rows.len();
        assert!(approximate <= exact + exact / 4, "{approximate} blocks, {exact} with the exact order");
    }

    fn pairs_of(n: usize) -> Vec<(usize, usize)> {
        (0..n).flat_map(|i| [(i, (i + 1) % n), (i, (i * 37 + 11) % n)]).collect()
    }

    /// A trajectory of `n` poses with a loop closure at every tenth.
    fn chain_of(n: usize) -> Vec<(usize, usize)> {
        let steps = (1..n).flat_map(|i| [(i, i - 1), (i, i.saturating_sub(2))]);
        steps.chain((0..n).step_by(10).map(|i| (i, (i * 37 + 11) % n))).collect()
    }

    fn check_pattern(found: &Elimination, pairs: &[(usize, usize)]) {
        let n = found.place.len();
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
