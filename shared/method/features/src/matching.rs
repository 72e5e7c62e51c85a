//! Data association by descriptor: mutual nearest neighbours with a ratio test.

use crate::feature::Feature;
use crate::gate::{AT_ONCE, Gate, TargetCells};
use crate::settings::MatchSettings;

/// A query feature and the target feature that it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FeatureMatch {
    /// Index of the query.
    pub query: u32,
    /// Index of the target.
    pub target: u32,
    /// Hamming distance of the descriptors, 0 to 256.
    pub distance: u32,
}

/// Buffers of [`match_features`], and the instruction set.
#[derive(Clone, Debug)]
pub struct MatchWorkspace {
    arch: pulp::Arch,
    cells: TargetCells,
    /// Indices of the targets that a gate admits.
    admitted: Vec<u32>,
    candidates: MatchCandidates,
    distances: Vec<u32>,
    /// Nearest target of each query and nearest query of each target: [`key`].
    of_query: Vec<u32>,
    of_target: Vec<u32>,
    /// Distance of the second nearest target of each query.
    second: Vec<u32>,
}

impl MatchWorkspace {
    /// Buffers for loops compiled for `arch`; the instruction set does not change a bit of the result.
    pub fn new(arch: pulp::Arch) -> Self {
        Self {
            arch,
            cells: TargetCells::default(),
            admitted: Vec::new(),
            candidates: MatchCandidates::default(),
            distances: Vec::new(),
            of_query: Vec::new(),
            of_target: Vec::new(),
            second: Vec::new(),
        }
    }
}

/// Number of bits in which two descriptors differ.
#[inline(always)]
pub fn hamming_distance(a: &[u64; 4], b: &[u64; 4]) -> u32 {
    (0..4).map(|k| (a[k] ^ b[k]).count_ones()).sum()
}

/// A candidate that may not be matched.
const REFUSED: u32 = 511;
/// Bits of an index in a key; distances stand above.
const INDEX_BITS: u32 = 22;

/// The index in a key.
const INDEX: u32 = (1 << INDEX_BITS) - 1;

/// Orders candidates by distance, equal ones by index.
#[inline(always)]
fn key(distance: u32, index: u32) -> u32 {
    distance << INDEX_BITS | index
}

/// Matches queries to targets: each is the other's nearest by Hamming distance among the pairs that
/// gates and levels admit, near enough, and distinctly nearer than any target elsewhere. Equal
/// distances go to the lower index. In order of queries.
///
/// `gates`: one for each query, or none at all.
///
/// # Panics
/// When there are gates and not one for each query, or more than 4 million features.
pub fn match_features(
    queries: &[Feature],
    targets: &[Feature],
    gates: Option<&[Gate]>,
    settings: &MatchSettings,
    workspace: &mut MatchWorkspace,
) -> Vec<FeatureMatch> {
    assert!(gates.is_none_or(|gates| gates.len() == queries.len()), "one gate for each query");
    assert!(queries.len().max(targets.len()) < 1 << INDEX_BITS, "indices of features fit");
    let arch = workspace.arch;
    arch.dispatch(Matching { queries, targets, gates, settings, w: workspace });
    let w = workspace;
    let passes = |q: usize| -> Option<FeatureMatch> {
        let (distance, target) = (w.of_query[q] >> INDEX_BITS, w.of_query[q] & INDEX);
        let is_near = distance <= settings.max_distance.min(256);
        let is_mutual = is_near && w.of_target[target as usize] == key(distance, q as u32);
        let is_distinct = distance as f32 <= settings.max_ratio * w.second[q] as f32;
        (is_mutual && is_distinct).then_some(FeatureMatch { query: q as u32, target, distance })
    };
    (0..queries.len()).filter_map(passes).collect()
}

struct Matching<'a> {
    queries: &'a [Feature],
    targets: &'a [Feature],
    gates: Option<&'a [Gate]>,
    settings: &'a MatchSettings,
    w: &'a mut MatchWorkspace,
}

impl pulp::WithSimd for Matching<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { queries, targets, gates, settings, w } = self;
        w.of_query.clear();
        w.second.clear();
        w.of_target.clear();
        w.of_target.resize(targets.len(), u32::MAX);
        match gates {
            Some(gates) => {
                w.cells.fill(targets);
                w.admitted.clear();
                w.admitted.resize(targets.len() + AT_ONCE, 0);
                w.distances.resize(targets.len() + AT_ONCE, 0);
                for (q, pair) in (0..).zip(queries.iter().zip(gates)) {
                    w.match_gated(q, pair, targets, settings);
                }
            }
            None => {
                w.candidates.fill(targets);
                queries
                    .iter()
                    .enumerate()
                    .for_each(|(q, query)| w.match_anywhere(q as u32, query, targets, settings));
            }
        }
    }
}

impl MatchWorkspace {
    /// One query among the few targets that its gate admits.
    #[inline(always)]
    fn match_gated(
        &mut self,
        q: u32,
        (query, gate): (&Feature, &Gate),
        targets: &[Feature],
        settings: &MatchSettings,
    ) {
        let Self { cells, admitted, distances, of_target, .. } = self;
        let n = cells.within(gate, query.level.into(), settings.max_level_difference, admitted);
        let mut nearest = key(REFUSED, 0);
        for (&target, distance) in admitted[..n].iter().zip(distances.iter_mut()) {
            *distance = hamming_distance(&query.descriptor, &targets[target as usize].descriptor);
            nearest = nearest.min(key(*distance, target));
            let best = &mut of_target[target as usize];
            *best = (*best).min(key(*distance, q));
        }
        let mut second = REFUSED;
        let pixel = targets.get((nearest & INDEX) as usize).map_or([0.0; 2], |target| target.pixel);
        for (&target, &distance) in admitted[..n].iter().zip(distances.iter()) {
            let is_elsewhere = is_elsewhere(targets[target as usize].pixel, pixel, settings.same_corner_px);
            // Beyond all distances where it is the same corner.
            second = second.min(distance | u32::from(!is_elsewhere) << 9);
        }
        self.of_query.push(nearest);
        self.second.push(second);
    }

    /// One query among all targets.
    #[inline(always)]
    fn match_anywhere(&mut self, q: u32, query: &Feature, targets: &[Feature], settings: &MatchSettings) {
        self.candidates.measure(query, settings.max_level_difference, &mut self.distances);
        let nearest = self.candidates.nearest(&self.distances);
        self.of_query.push(nearest);
        let second = self.candidates.second(nearest, targets, settings.same_corner_px, &self.distances);
        self.second.push(second);
        for (best, &distance) in self.of_target.iter_mut().zip(&self.distances) {
            *best = (*best).min(key(distance, q));
        }
    }
}

/// Whether a pixel is no other level's view of the corner at `corner`.
#[inline(always)]
fn is_elsewhere(pixel: [f32; 2], corner: [f32; 2], same_corner_px: f32) -> bool {
    ((pixel[0] - corner[0]).abs() > same_corner_px) | ((pixel[1] - corner[1]).abs() > same_corner_px)
}

/// All targets as columns, so that loops over them vectorise.
#[derive(Clone, Debug, Default)]
struct MatchCandidates {
    descriptor: Vec<[u64; 4]>,
    level: Vec<u32>,
    row: Vec<f32>,
    column: Vec<f32>,
}

impl MatchCandidates {
    fn fill(&mut self, targets: &[Feature]) {
        self.descriptor.clear();
        self.descriptor.extend(targets.iter().map(|target| target.descriptor));
        self.level.clear();
        self.level.extend(targets.iter().map(|target| u32::from(target.level)));
        self.row.clear();
        self.row.extend(targets.iter().map(|target| target.pixel[0]));
        self.column.clear();
        self.column.extend(targets.iter().map(|target| target.pixel[1]));
    }

    /// Distances to all candidates.
    #[inline(always)]
    fn measure(&self, query: &Feature, max_level_difference: u32, distances: &mut Vec<u32>) {
        let n = self.descriptor.len();
        distances.clear();
        distances.resize(n, 0);
        let (descriptor, level, distances) = (&self.descriptor[..n], &self.level[..n], &mut distances[..n]);
        let of = query.descriptor;
        for i in 0..n {
            distances[i] = hamming_distance(&of, &descriptor[i]);
        }
        let query_level = u32::from(query.level);
        for i in 0..n {
            let is_admitted = query_level.abs_diff(level[i]) <= max_level_difference;
            distances[i] = if is_admitted { distances[i] } else { REFUSED };
        }
    }

    /// Key of the nearest candidate.
    #[inline(always)]
    fn nearest(&self, distances: &[u32]) -> u32 {
        let keys = (0u32..).zip(distances).map(|(target, &distance)| key(distance, target));
        keys.fold(key(REFUSED, 0), u32::min)
    }

    /// Distance of the nearest candidate that is not the corner of the nearest one.
    #[inline(always)]
    fn second(&self, nearest: u32, targets: &[Feature], same_corner_px: f32, distances: &[u32]) -> u32 {
        let Some(nearest) = targets.get((nearest & INDEX) as usize) else { return REFUSED };
        let n = distances.len();
        let (row, column, mut second) = (&self.row[..n], &self.column[..n], REFUSED);
        for i in 0..n {
            let is_elsewhere = is_elsewhere([row[i], column[i]], nearest.pixel, same_corner_px);
            second = second.min(if is_elsewhere { distances[i] } else { REFUSED });
        }
        second
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    /// Targets at random, and queries that are targets with some bits turned.
    fn features(n: usize, seed: u64) -> [Vec<Feature>; 2] {
        let mut random = SplitMix64::new(seed);
        let mut of_image = |bits: usize| -> Vec<Feature> {
            let mut descriptors = SplitMix64::new(99);
            let feature = |_| {
                let mut descriptor = [0; 4].map(|_: u64| descriptors.next_u64());
                (0..random.below(bits)).for_each(|_| descriptor[random.below(4)] ^= 1 << random.below(64));
                let pixel = [480.0, 640.0].map(|side| side * random.unit() as f32);
                Feature { pixel, level: random.below(4) as u8, descriptor, ..Feature::default() }
            };
            (0..n).map(feature).collect()
        };
        [of_image(90), of_image(1)]
    }

    /// The definition, pair by pair.
    fn reference(
        q: &[Feature],
        t: &[Feature],
        gates: Option<&[Gate]>,
        s: &MatchSettings,
    ) -> Vec<FeatureMatch> {
        let distance = |i: usize, j: usize| {
            let gate = gates.map_or(Gate::ANYWHERE, |gates| gates[i]);
            let [row, column] = [0, 1].map(|k| t[j].pixel[k] - gate.pixel[k]);
            let is_inside = row * row + column * column <= gate.radius_px * gate.radius_px;
            let is_near_level = u32::from(q[i].level.abs_diff(t[j].level)) <= s.max_level_difference;
            (is_inside && is_near_level).then(|| hamming_distance(&q[i].descriptor, &t[j].descriptor))
        };
        let of = |i: usize| {
            let (d, j) = (0..t.len()).filter_map(|j| Some((distance(i, j)?, j))).min()?;
            let (_, back) = (0..q.len()).filter_map(|i| Some((distance(i, j)?, i))).min()?;
            let is_elsewhere =
                |k: &usize| (0..2).any(|a| (t[*k].pixel[a] - t[j].pixel[a]).abs() > s.same_corner_px);
            let second =
                (0..t.len()).filter(is_elsewhere).filter_map(|k| distance(i, k)).min().unwrap_or(511);
            let passes = back == i && d <= s.max_distance && d as f32 <= s.max_ratio * second as f32;
            passes.then_some(FeatureMatch { query: i as u32, target: j as u32, distance: d })
        };
        (0..q.len()).filter_map(of).collect()
    }

    fn check(n: usize, radius_px: Option<f32>, settings: &MatchSettings) -> usize {
        let [queries, targets] = features(n, 3);
        let mut random = SplitMix64::new(8);
        let mut gate = |t: &Feature| Gate {
            pixel: t.pixel.map(|p| p + 30.0 * random.unit() as f32 - 15.0),
            radius_px: radius_px.unwrap_or(0.0),
        };
        let mut gates: Vec<Gate> = targets.iter().map(&mut gate).collect();
        if let [first, second, third, ..] = &mut gates[..] {
            *first = Gate::ANYWHERE;
            second.pixel = [f32::NAN; 2];
            third.pixel = [-1e9, 1e9];
        }
        let gates = radius_px.map(|_| &gates[..]);
        let found =
            match_features(&queries, &targets, gates, settings, &mut MatchWorkspace::new(pulp::Arch::new()));
        assert_eq!(found, reference(&queries, &targets, gates, settings));
        found.len()
    }

    #[test]
    fn matches_agree_with_their_definition() {
        let settings = MatchSettings::default();
        assert!(check(300, None, &settings) > 150);
        assert!(check(300, Some(25.0), &settings) > 150);
        assert!(check(300, Some(5.0), &settings) < 60);
        let wide = MatchSettings { same_corner_px: 60.0, max_level_difference: 1, ..settings.clone() };
        assert!(check(300, None, &wide) > 20);
        let all = MatchSettings { max_ratio: 1.0, max_distance: 256, ..settings };
        assert!(check(300, Some(100.0), &all) > 150);
        check(0, None, &all);
        check(1, Some(10.0), &all);
    }

    #[test]
    fn equal_distances_go_to_the_lower_index() {
        let [_, mut targets] = features(4, 1);
        targets[2] = Feature { pixel: [400.0, 10.0], ..targets[1] };
        let queries = [targets[1], targets[1]];
        let settings = MatchSettings { max_ratio: 1.0, ..MatchSettings::default() };
        let found =
            match_features(&queries, &targets, None, &settings, &mut MatchWorkspace::new(pulp::Arch::new()));
        assert_eq!(found, [FeatureMatch { query: 0, target: 1, distance: 0 }]);
        let strict = MatchSettings::default();
        targets[1].descriptor[0] ^= 1;
        targets[2].descriptor[0] ^= 2;
        let found =
            match_features(&queries, &targets, None, &strict, &mut MatchWorkspace::new(pulp::Arch::new()));
        assert_eq!(found, [], "as near elsewhere");
    }
}
