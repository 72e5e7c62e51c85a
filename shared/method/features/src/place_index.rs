//! Recognition of places by their features: which of many images shows what this one shows?
//!
//! Binary words without a vocabulary. A descriptor has eight parts of 32 bits; each of four of them is kept
//! in order over all descriptors. Descriptors of one corner share leading bits of some part and are
//! neighbours in that order; the distance of the whole descriptors decides. This is locality-sensitive
//! hashing with prefixes of any length (Bawa, Condie and Ganesan, "LSH forest", WWW 2005): nothing is
//! trained, a search takes a logarithm of the number of places, and the answer is a function of the
//! set of places, not of the order in which they came.

use crate::feature::Feature;
use crate::matching::hamming_distance;
use crate::sorted_runs::SortedRuns;

/// Words of a place and of a search: the strongest features.
const WORDS: usize = 128;
/// Parts of a descriptor that are kept in order.
const PARTS: usize = 4;
/// Neighbours that are looked at in each direction, and entries that are passed over for them.
const NEAR: usize = 8;
const MOST_PASSED: usize = 64;
/// Bits of a part, and of the whole descriptor, in which words of one corner differ at most.
const MAX_PART_BITS: u32 = 8;
const MAX_DISTANCE: u32 = 36;
/// Bits of a word's number in an entry; those of its place stand above.
const WORD_BITS: u32 = 7;
/// Places have smaller numbers.
const MAX_PLACES: u32 = 1 << (32 - WORD_BITS);

const _: () = assert!(WORDS <= 1 << WORD_BITS);

type Descriptor = [u64; 4];

/// A place that shows some of what was searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaceMatch {
    /// Number of the place.
    pub place: u32,
    /// Words of the search that were found there.
    pub n_words: u32,
}

/// Places with the words that are seen there.
#[derive(Clone, Debug)]
pub struct PlaceIndex {
    arch: pulp::Arch,
    /// By place; none of a place that is not there.
    words: Vec<Option<Box<[Descriptor]>>>,
    /// Entries `part << 32 | place << WORD_BITS | word`, in order.
    parts: [SortedRuns; PARTS],
}

impl PlaceIndex {
    /// No places; loops are compiled for `arch`, which does not change an answer.
    pub fn new(arch: pulp::Arch) -> Self {
        Self { arch, words: Vec::new(), parts: Default::default() }
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.words.iter().flatten().count()
    }

    /// Whether there is no place.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Makes the places those of `places`: what is new there is read by `features`, what is not there
    /// any more goes. Numbers from 2^25 on are left out.
    pub fn hold_only<F: AsRef<[Feature]>>(
        &mut self,
        places: impl Iterator<Item = u32>,
        mut features: impl FnMut(u32) -> F,
    ) {
        let mut is_held = vec![false; self.words.len()];
        for place in places.filter(|place| *place < MAX_PLACES) {
            let at = place as usize;
            if at >= self.words.len() {
                self.words.resize(at + 1, None);
                is_held.resize(at + 1, false);
            }
            is_held[at] = true;
            if self.words[at].is_none() {
                let features = features(place);
                let words = strongest(features.as_ref());
                let words: Box<[Descriptor]> = words.iter().map(|feature| feature.descriptor).collect();
                for (k, part) in self.parts.iter_mut().enumerate() {
                    entries(place, &words, k).for_each(|entry| part.insert(entry));
                }
                self.words[at] = Some(words);
            }
        }
        for (place, words) in (0..).zip(&mut self.words) {
            if let Some(words) = words.take_if(|_| !is_held[place as usize]) {
                for (k, part) in self.parts.iter_mut().enumerate() {
                    entries(place, &words, k).for_each(|entry| part.remove(entry));
                }
            }
        }
    }

    /// The places that show most of these features, the best first, equals by number; at most `n`, and
    /// each with at least `min_words`. `is_admitted` selects the places that count.
    pub fn find(
        &self,
        features: &[Feature],
        n: usize,
        min_words: u32,
        is_admitted: impl Fn(u32) -> bool,
    ) -> Vec<PlaceMatch> {
        let mut n_words = vec![0u32; self.words.len()];
        self.arch.dispatch(PlaceSearch { index: self, features, is_admitted, n_words: &mut n_words });
        let found = (0..).zip(n_words).filter(|(_, n_words)| *n_words >= min_words.max(1));
        let mut found: Vec<PlaceMatch> =
            found.map(|(place, n_words)| PlaceMatch { place, n_words }).collect();
        found.sort_by_key(|found| (std::cmp::Reverse(found.n_words), found.place));
        found.truncate(n);
        found
    }
}

/// A search compiled for each instruction set.
struct PlaceSearch<'a, A> {
    index: &'a PlaceIndex,
    features: &'a [Feature],
    is_admitted: A,
    /// By place.
    n_words: &'a mut [u32],
}

impl<A: Fn(u32) -> bool> pulp::WithSimd for PlaceSearch<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { index, features, is_admitted, n_words } = self;
        let mut seen: Vec<u32> = Vec::new();
        for feature in strongest(features) {
            seen.clear();
            let descriptor = &feature.descriptor;
            for (k, part) in index.parts.iter().enumerate() {
                let bits = bits(descriptor, k);
                let middle = u64::from(bits) << 32;
                let (below, from) = part.around(middle);
                index.look(descriptor, bits, from, &is_admitted, &mut seen);
                index.look(descriptor, bits, below, &is_admitted, &mut seen);
            }
            seen.sort_unstable();
            seen.dedup();
            seen.iter().for_each(|place| n_words[*place as usize] += 1);
        }
    }
}

impl PlaceIndex {
    /// Adds the places of words near a descriptor; `entries` come the nearest first.
    #[inline(always)]
    fn look<'a>(
        &self,
        descriptor: &Descriptor,
        bits: u32,
        entries: impl Iterator<Item = &'a u64>,
        is_admitted: &impl Fn(u32) -> bool,
        found: &mut Vec<u32>,
    ) {
        let place = |entry: u64| entry as u32 >> WORD_BITS;
        let admitted = entries.take(MOST_PASSED).filter(|entry| is_admitted(place(**entry)));
        for &entry in admitted.take(NEAR) {
            if (bits ^ (entry >> 32) as u32).count_ones() > MAX_PART_BITS {
                continue;
            }
            let word = entry as usize & ((1 << WORD_BITS) - 1);
            let words = self.words[place(entry) as usize].as_deref().unwrap_or(&[]);
            if words.get(word).is_some_and(|word| hamming_distance(word, descriptor) <= MAX_DISTANCE) {
                found.push(place(entry));
            }
        }
    }
}

/// A part of a descriptor.
fn bits(descriptor: &Descriptor, part: usize) -> u32 {
    // The lower halves: any four of the eight would do.
    descriptor[part] as u32
}

/// Entries of a place in the order of one part.
fn entries(place: u32, words: &[Descriptor], part: usize) -> impl Iterator<Item = u64> {
    let entry = move |(word, descriptor): (u32, &Descriptor)| {
        u64::from(bits(descriptor, part)) << 32 | u64::from(place << WORD_BITS | word)
    };
    (0..).zip(words).map(entry)
}

/// The strongest features, equals in their order.
fn strongest(features: &[Feature]) -> Vec<&Feature> {
    let mut chosen: Vec<&Feature> = features.iter().collect();
    chosen.sort_by(|a, b| b.response.total_cmp(&a.response));
    chosen.truncate(WORDS);
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    fn image(random: &mut SplitMix64) -> Vec<Feature> {
        let feature = |_| Feature {
            response: random.below(200) as f32,
            descriptor: [0; 4].map(|_: u64| random.next_u64()),
            ..Feature::default()
        };
        (0..200).map(feature).collect()
    }

    /// The same corners from elsewhere: a third of them gone, and `n_bits` turned in the others.
    fn seen_again(known: &[Feature], n_bits: usize, random: &mut SplitMix64) -> Vec<Feature> {
        let mut other = image(random);
        for (feature, known) in other.iter_mut().zip(known).skip(67) {
            *feature = *known;
            (0..n_bits).for_each(|_| feature.descriptor[random.below(4)] ^= 1 << random.below(64));
        }
        other
    }

    fn index_of(images: &[Vec<Feature>], places: &[u32]) -> PlaceIndex {
        let mut index = PlaceIndex::new(pulp::Arch::new());
        index.hold_only(places.iter().copied(), |place| &images[place as usize]);
        index
    }

    #[test]
    fn a_place_is_found_again_among_many_and_an_unknown_one_is_not() {
        let mut random = SplitMix64::new(5);
        let images: Vec<Vec<Feature>> = (0..400).map(|_| image(&mut random)).collect();
        let index = index_of(&images, &(0..400).collect::<Vec<u32>>());
        for place in [0, 123, 399] {
            let found = index.find(&seen_again(&images[place], 20, &mut random), 2, 8, |_| true);
            assert!(found.len() == 1 && found[0].place as usize == place, "{found:?}");
            assert_eq!(index.find(&images[place], 9, 8, |other| other as usize != place), []);
        }
        assert_eq!(index.find(&image(&mut random), 9, 3, |_| true), []);
        assert_eq!(index.find(&[], 9, 0, |_| true), []);
    }

    #[test]
    fn the_answer_is_that_of_the_places_however_they_came() {
        let mut random = SplitMix64::new(6);
        let mut images: Vec<Vec<Feature>> = (0..40).map(|_| image(&mut random)).collect();
        // Places that show a part of the first one.
        (20..40).for_each(|k| images[k] = seen_again(&images[0], 2 * k, &mut random));
        let searched = seen_again(&images[0], 10, &mut random);
        let places = [0, 3, 21, 25, 26, 39];
        let at_once = index_of(&images, &places);
        let mut index = index_of(&images, &[30, 21]);
        assert_eq!(index.len(), 2);
        for held in [&[21, 25, 0][..], &[0, 1, 2, 3, 26, 25], &places] {
            index.hold_only(held.iter().copied(), |place| &images[place as usize]);
            assert_eq!(index.len(), held.len());
        }
        let found = index.find(&searched, 9, 1, |_| true);
        assert!(found.len() > 2 && found[0].place == 0, "{found:?}");
        assert_eq!(found, at_once.find(&searched, 9, 1, |_| true));
        let baseline = PlaceIndex { arch: pulp::Arch::Scalar, ..at_once };
        assert_eq!(found, baseline.find(&searched, 9, 1, |_| true));
        index.hold_only(std::iter::empty(), |_| &[]);
        assert!(index.is_empty() && index.find(&searched, 9, 0, |_| true).is_empty());
    }
}
