//! Long work in parts, each with a sign of life.

use rayon::prelude::*;

/// Items of a part: some tens of milliseconds of work.
const PART: usize = 256;

/// Maps items on all threads, each thread with a state of its own; in order, with a call of
/// `progress` after each part. How long that takes does not depend on how many items there are.
pub(crate) fn map_in_parts<T: Sync, R: Send, S>(
    items: &[T],
    state: impl Fn() -> S + Sync + Send,
    map: impl Fn(&mut S, &T) -> R + Sync + Send,
    progress: &mut dyn FnMut(),
) -> Vec<R> {
    let mut mapped = Vec::with_capacity(items.len());
    for part in items.chunks(PART) {
        mapped.par_extend(part.par_iter().map_init(&state, &map));
        progress();
    }
    mapped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_stay_in_order_and_every_part_tells() {
        let items: Vec<usize> = (0..3 * PART + 1).collect();
        let mut n_calls = 0;
        let squares = map_in_parts(&items, || (), |(), item| item * item, &mut || n_calls += 1);
        assert_eq!(squares, items.iter().map(|item| item * item).collect::<Vec<_>>());
        assert_eq!(n_calls, 4);
    }
}
