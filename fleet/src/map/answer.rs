//! The answer of a base to a request of a run: its keyframes, solved for in one graph with those of the runs
//! that share a place with it.

use crate::copies::arrivals::{Arrival, Extent};
use crate::error::FleetError;
use crate::map::joint::context_of;
use crate::map::past::{Past, Prefix, surfaces_of};
use crate::map::received::RunSurfaces;
use crate::map::surfaces::JointSurfaces;
use std::path::Path;
use tessera_journal::Follower;
use tessera_outputs::read_settings;
use tessera_slam::{Context, JointMap, OptimiseRecord, Optimiser, RequestRecord};
use tessera_stage::{BaseAnswer, OPTIMISE_JOURNAL, RunFile, RunFiles};

/// An answer, computed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeAnswer {
    /// The request.
    pub request: u64,
    /// The answer as it travels.
    pub bytes: Vec<u8>,
    /// Other runs that it is made of.
    pub n_sharing: usize,
}

/// A run with an open request.
struct Asking {
    context: Context,
    optimiser: Optimiser,
    request: RequestRecord,
    surfaces: RunSurfaces,
    journal: Prefix,
}

/// Answers the oldest open request of run `number` among `arrivals`, from so much of each;
/// `None` where the run asks no base or nothing is open. A function of that and of the
/// run's own corrections.
///
/// # Errors
/// Where the run cannot be read, or a surface is damaged. Other runs that cannot be read are left out.
pub fn answer(
    base: &Path,
    arrivals: &[Arrival],
    number: usize,
    extents: &[Extent],
) -> Result<Option<MadeAnswer>, FleetError> {
    let identity = arrivals[number].identity;
    let Some(asking) = Asking::read(base, &arrivals[number], extents[number])? else {
        return Ok(None);
    };
    let mut others: Vec<Past> = Vec::new();
    for (other, arrival) in arrivals.iter().enumerate().filter(|(other, _)| *other != number) {
        let past = Past::read(base, arrival, extents.get(other).copied().unwrap_or_default(), false);
        others.extend(past.ok());
    }
    let Asking { context, optimiser, request, mut surfaces, journal } = asking;
    let Some(mut map) = JointMap::of_request(context, &optimiser, &request) else { return Ok(None) };
    surfaces.keep_active(map.keyframes());
    for other in &others {
        map.add_seen_by(&other.state, &context_of(&other.run, &other.settings).session_cameras());
    }
    let mut joint = JointSurfaces::default();
    joint.add(map.keyframes_of(0), surfaces.of_keyframes());
    for (run, other) in (1..).zip(&others) {
        joint.add(map.keyframes_of(run), other.surfaces.of_keyframes());
    }
    map.join(&joint, &mut || ());
    let answer = map.answer(&optimiser, &request, &joint, &journal, &mut || ());
    drop(joint);
    // What was computed from a surface that is damaged or was given up is no answer.
    let every = std::iter::once(&mut surfaces).chain(others.iter_mut().map(|other| &mut other.surfaces));
    for surfaces in every {
        surfaces.check()?;
        surfaces.check_held()?;
    }
    let Some((correction, changes)) = answer else { return Ok(None) };
    let bytes = BaseAnswer { identity, correction, changes }.to_bytes()?;
    Ok(Some(MadeAnswer { request: request.request, bytes, n_sharing: map.n_sharing() }))
}

impl Asking {
    /// Reads a run up to its oldest open request; `None` where it has none, or none for a base.
    fn read(base: &Path, arrival: &Arrival, extent: Extent) -> Result<Option<Self>, FleetError> {
        let folder = arrival.folder(base);
        let files = RunFiles::new(&folder);
        let run = RunFile::read_recorded(&files)?;
        let settings = read_settings(&files)?;
        if settings.run.base_wait_s <= 0.0 {
            return Ok(None);
        }
        let context = context_of(&run, &settings);
        let mut optimiser = Optimiser::new(context.clone());
        let mut answers = Follower::<OptimiseRecord>::open(&files.optimise_journal(), OPTIMISE_JOURNAL)?;
        while let Some(record) = answers.next()? {
            optimiser.apply_own(&record);
        }
        let mut surfaces = surfaces_of(&folder, arrival.form, extent, run.layout(&settings).grid)?;
        let journal = Prefix::new(&files, extent.align_bytes);
        let mut problem = Ok(());
        journal.visit_all(&mut |record| {
            if problem.is_ok() && optimiser.next_request().is_none() {
                problem = surfaces.take_unread(&record);
                optimiser.apply(&record);
            }
        })?;
        problem?;
        let Some(request) = optimiser.next_request() else { return Ok(None) };
        // The run solves for its camera itself.
        if request.is_final && settings.mapping.global.refine_camera {
            return Ok(None);
        }
        Ok(Some(Self { context, optimiser, request, surfaces, journal }))
    }
}
