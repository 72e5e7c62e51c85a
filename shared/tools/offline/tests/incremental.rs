//! Corrections that go on from the pairs of the one before: what a successor of the optimiser computes from the journals.

mod common;

use common::scene;
use std::collections::BTreeSet;
use tessera_features::Feature;
use tessera_offline::{Method, RawFrame, Run, SavedMap};
use tessera_slam::{AlignRecord, Context, KeyframeSurfaces, OptimiseRecord, Optimiser, PairChanges};
use tessera_sources::{SceneName, SimulationOptions, Source};
use tessera_surface::Vertex;

struct Surfaces(SavedMap);

impl KeyframeSurfaces for Surfaces {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0.surfaces[keyframe as usize]
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        self.0.features.get(keyframe as usize).map_or(&[], Vec::as_slice)
    }
}

/// Once round the room and on into what has been seen, with a correction for few new keyframes.
fn walked() -> (Context, Vec<AlignRecord>, Surfaces) {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let mut method = Method::default();
    method.mapping.loops.request_interval = 4;
    let mut run = Run::new(source.camera(), &method).unwrap();
    for index in (0..640).step_by(2) {
        run.push(&RawFrame::read(&source, index % 360).unwrap());
    }
    let (records, map) = run.finish_with_map();
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    (context, records.records, Surfaces(map))
}

#[test]
fn a_successor_gives_the_bits_of_an_optimiser_that_lived_and_old_pairs_are_not_searched_again() {
    let (context, records, surfaces) = walked();
    let mut lived = Optimiser::new(context.clone());
    let mut answers: Vec<OptimiseRecord> = Vec::new();
    for (n, record) in records.iter().enumerate() {
        lived.apply(record);
        let Some(request) = lived.next_request() else { continue };
        let before = &records[..=n];
        let answer = lived.solve(&request, &surfaces, &before, &mut || ()).unwrap();
        let mut successor = Optimiser::new(context.clone());
        answers.iter().for_each(|own| successor.apply_own(own));
        before.iter().for_each(|record| successor.apply(record));
        let again = successor.solve(&request, &surfaces, &before, &mut || ()).unwrap();
        assert!(again == answer, "request {}", request.request);
        lived.apply_own(&answer);
        answers.push(answer);
    }
    let (mut pairs, mut shares) = (BTreeSet::new(), Vec::new());
    // The final one is searched anew.
    let (last, others) = answers.split_last().unwrap();
    assert_eq!(last.pair_changes(), Some(&PairChanges::default()));
    for answer in others {
        let PairChanges { searched, dropped } = answer.pair_changes().unwrap();
        pairs.retain(|pair| !dropped.contains(pair));
        pairs.extend(searched.iter().map(|m| (m.newer, m.older)));
        shares.push(searched.len() as f64 / pairs.len() as f64);
    }
    assert!(shares.len() >= 3 && shares[0] == 1.0, "{shares:?}");
    assert!(shares[2..].iter().all(|share| *share < 0.5), "{shares:?}");
}
