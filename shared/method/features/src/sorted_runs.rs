//! Numbers in order, in runs of bounded length: a search among a hundred thousand reads few lines of memory, and
//! the neighbours of what it finds lie beside it.

/// Numbers of a run, at most.
const MOST: usize = 512;

/// A set of numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct SortedRuns {
    /// The first number of each run.
    firsts: Vec<u64>,
    /// Rising, from run to run and in each; none is empty.
    runs: Vec<Vec<u64>>,
}

impl SortedRuns {
    /// The run in which a number is or would be.
    fn run_of(&self, number: u64) -> usize {
        self.firsts.partition_point(|first| *first <= number).saturating_sub(1)
    }

    pub(crate) fn insert(&mut self, number: u64) {
        let at = self.run_of(number);
        let Some(run) = self.runs.get_mut(at) else {
            self.firsts.push(number);
            self.runs.push(vec![number]);
            return;
        };
        let Err(place) = run.binary_search(&number) else { return };
        run.insert(place, number);
        self.firsts[at] = run[0];
        if run.len() > MOST {
            let rest = run.split_off(MOST / 2);
            self.firsts.insert(at + 1, rest[0]);
            self.runs.insert(at + 1, rest);
        }
    }

    pub(crate) fn remove(&mut self, number: u64) {
        let at = self.run_of(number);
        let Some(run) = self.runs.get_mut(at) else { return };
        let Ok(place) = run.binary_search(&number) else { return };
        run.remove(place);
        match run.first() {
            Some(first) => self.firsts[at] = *first,
            None => {
                self.firsts.remove(at);
                self.runs.remove(at);
            }
        }
    }

    /// The numbers below one, falling, and those from it on, rising.
    pub(crate) fn around(
        &self,
        number: u64,
    ) -> (impl Iterator<Item = &u64> + '_, impl Iterator<Item = &u64> + '_) {
        let at = self.run_of(number);
        let run = self.runs.get(at).map_or(&[][..], Vec::as_slice);
        let (below, from) = run.split_at(run.partition_point(|other| *other < number));
        let before = self.runs[..at].iter().rev().flat_map(|run| run.iter().rev());
        let after = self.runs.iter().skip(at + 1).flatten();
        (below.iter().rev().chain(before), from.iter().chain(after))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use tessera_numerics::SplitMix64;

    #[test]
    fn a_set_of_runs_is_a_set() {
        let mut random = SplitMix64::new(3);
        let (mut runs, mut set) = (SortedRuns::default(), BTreeSet::new());
        assert_eq!((runs.around(5).0.count(), runs.around(5).1.count()), (0, 0));
        for round in 0..20_000 {
            let number = random.below(6000) as u64;
            // It grows to several runs, and shrinks to nothing.
            if random.below(20_000) > round {
                runs.insert(number);
                set.insert(number);
            } else {
                runs.remove(number);
                set.remove(&number);
            }
            if round % 500 == 0 {
                let (below, from) = runs.around(number);
                assert!(below.eq(set.range(..number).rev()), "round {round}");
                assert!(from.eq(set.range(number..)), "round {round}");
            }
        }
        assert!(runs.runs.iter().all(|run| !run.is_empty() && run.len() <= MOST));
        set.iter().for_each(|number| runs.remove(*number));
        assert!(runs.runs.is_empty() && runs.firsts.is_empty());
    }
}
