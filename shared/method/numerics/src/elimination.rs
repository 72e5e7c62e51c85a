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

impl Elimination {
    /// The order for a system of `n` poses: approximate minimum degree (AMD); `pairs` are its blocks off the diagonal.
    pub(crate) fn new(n: usize, pairs: &[(usize, usize)]) -> Self {
        Self::in_order(minimum_degree(n, pairs).unwrap_or_else(|| (0..n).collect()), pairs)
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
}

/// Place of each pose by faer's approximate minimum degree; integers alone, so that all machines
/// agree. `None` where it has no memory to work in.
fn minimum_degree(n: usize, pairs: &[(usize, usize)]) -> Option<Vec<usize>> {
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
        check_pattern(&Elimination::new(70, &pairs_of(70)), &pairs_of(70));
        check_pattern(&Elimination::new(600, &chain_of(600)), &chain_of(600));
    }

    #[test]
    fn little_fills_in() {
        let pairs = chain_of(600);
        let in_time = Elimination::in_order((0..600).collect(), &pairs).rows.len();
        let found = Elimination::new(600, &pairs).rows.len();
        assert!(found < in_time / 4, "{found} blocks, {in_time} in order of time");
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
