//! Long work on all threads, with signs of life.

use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};

/// Items of a part: some tens of milliseconds of work.
const PART: usize = 256;

/// Maps items on all threads, each thread with a state of its own; in order, with a call of
/// `progress` after each part. How long that takes does not depend on how many items there are.
pub fn map_in_parts<T: Sync, R: Send, S: Send>(
    items: &[T],
    state: impl Fn() -> S + Sync + Send,
    map: impl Fn(&mut S, &T) -> R + Sync + Send,
    progress: &mut dyn FnMut(),
) -> Vec<R> {
    map_parts(items.chunks(PART), items.len(), state, map, progress)
}

/// As [`map_in_parts`], for items that change.
pub fn map_in_parts_mut<T: Send, R: Send, S: Send>(
    items: &mut [T],
    state: impl Fn() -> S + Sync + Send,
    map: impl Fn(&mut S, &mut T) -> R + Sync + Send,
    progress: &mut dyn FnMut(),
) -> Vec<R> {
    let n = items.len();
    map_parts(items.chunks_mut(PART), n, state, map, progress)
}

fn map_parts<P: IntoParallelIterator, R: Send, S: Send>(
    parts: impl Iterator<Item = P> + Send,
    n: usize,
    state: impl Fn() -> S + Sync + Send,
    map: impl Fn(&mut S, P::Item) -> R + Sync + Send,
    progress: &mut dyn FnMut(),
) -> Vec<R> {
    let idle = Mutex::new(Vec::new());
    let lend = || Lent { state: locked(&idle).pop(), idle: &idle };
    let map = |lent: &mut Lent<'_, S>, item| map(lent.state.get_or_insert_with(&state), item);
    in_pool(progress, |progress| {
        let mut mapped = Vec::with_capacity(n);
        for part in parts {
            mapped.par_extend(part.into_par_iter().map_init(lend, map));
            progress();
        }
        mapped
    })
}

/// A state with its buffers, given back for the next part of the work.
struct Lent<'a, S> {
    /// None until the first item, where none was idle.
    state: Option<S>,
    idle: &'a Mutex<Vec<S>>,
}

impl<S> Drop for Lent<'_, S> {
    fn drop(&mut self) {
        locked(self.idle).extend(self.state.take());
    }
}

fn locked<S>(idle: &Mutex<Vec<S>>) -> MutexGuard<'_, Vec<S>> {
    idle.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does work that shares out many small parts on one of the threads that they are shared out to: from
/// outside, each part would put the caller to sleep and wake it. `progress` is called here, for each
/// call of what `work` gets. A caller that is one of those threads does it itself.
pub fn in_pool<R: Send>(progress: &mut dyn FnMut(), work: impl FnOnce(&mut dyn FnMut()) -> R + Send) -> R {
    if rayon::current_thread_index().is_some() {
        return work(progress);
    }
    let (sender, receiver) = mpsc::channel();
    let mut result = None;
    rayon::in_place_scope(|scope| {
        scope.spawn(|_| {
            // The caller may be gone; the error is then dropped.
            let mut tell = move || {
                let _: Result<(), mpsc::SendError<()>> = sender.send(());
            };
            result = Some(work(&mut tell));
        });
        receiver.iter().for_each(|()| progress());
    });
    result.expect("the scope ends when the work has")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_in_the_pool_tells_its_caller() {
        let caller = std::thread::current().id();
        let mut n_calls = 0;
        let mut progress = || {
            assert_eq!(std::thread::current().id(), caller);
            n_calls += 1;
        };
        let is_worker = in_pool(&mut progress, |tell| {
            (0..5).for_each(|_| tell());
            rayon::current_thread_index().is_some()
        });
        assert!(is_worker && n_calls == 5);
    }

    #[test]
    fn a_thread_of_the_pool_does_not_wait_for_itself() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let mut n_calls = 0;
        let sum =
            pool.install(|| in_pool(&mut || n_calls += 1, |tell| (0..5).inspect(|_| tell()).sum::<i32>()));
        assert_eq!((sum, n_calls), (10, 5));
    }

    #[test]
    fn items_stay_in_order_and_every_part_tells() {
        let items: Vec<usize> = (0..3 * PART + 1).collect();
        let mut n_calls = 0;
        let squares = map_in_parts(&items, || (), |(), item| item * item, &mut || n_calls += 1);
        assert_eq!(squares, items.iter().map(|item| item * item).collect::<Vec<_>>());
        assert_eq!(n_calls, 4);
        let mut changed = items.clone();
        let before = map_in_parts_mut(&mut changed, || (), |(), item| std::mem::take(item), &mut || ());
        assert_eq!((before, changed), (items, vec![0; 3 * PART + 1]));
    }
}
