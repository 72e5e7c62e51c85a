//! One run of one robot at the base: journals that become the robot's, byte for byte, and either the whole
//! store or the surfaces of the keyframes that the run keeps.

use crate::copies::arrivals::{CopyForm, Extent};
use crate::copies::asked::ComingAnswer;
pub use crate::copies::asked::{Pulled, ask_offer};
use crate::copies::checked::{AnswerFacts, RunFacts};
use crate::copies::journal::JournalCopy;
use crate::copies::store::StoreCopy;
use crate::copies::surfaces::{SurfaceCopy, TravelledSurface, check_surface};
use crate::error::FleetError;
use crate::robot::served::{grid_of, identity_of};
use crate::wire::carrier::RobotCarrier;
use crate::wire::request::{Growing, MAX_SMALL_BYTES, Offer, PieceRefusal, Request, SMALL_FILES};
use crate::wire::surfaces::{Framed, MOST_WANTED, WantedSurfaces, frames};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tessera_journal::{Durability, MAX_FRAMED_BYTES, write_atomically};
use tessera_messages::max_stored_bytes;
use tessera_outputs::{Ended, read_statistics};
use tessera_surface::Grid;

/// Bytes of a request, at first, at least and at most: it grows while answers take less than
/// [`SHORT`], and shrinks where they take more than [`LONG`] or are cut.
const FIRST_WINDOW: u64 = 256 << 10;
const LEAST_WINDOW: u64 = 16 << 10;
const MOST_WINDOW: u64 = 8 << 20;
const SHORT: Duration = Duration::from_millis(300);
const LONG: Duration = Duration::from_secs(2);
/// How long surfaces are asked for until it is looked for newer keyframes.
const SURFACES_FOR: Duration = Duration::from_secs(1);
/// How long no new keyframe comes of a robot that is not on its way.
const STANDS_AFTER: Duration = Duration::from_secs(5);
/// Bytes of a surface, before the first one has come.
const GUESSED_SURFACE_BYTES: u64 = 16 << 10;

/// The surfaces of a run.
enum CopiedSurfaces {
    Whole(StoreCopy),
    Kept(SurfaceCopy),
}

/// The copy of a run.
pub struct Replica {
    folder: PathBuf,
    robot: String,
    identity: u64,
    align: JournalCopy,
    optimise: JournalCopy,
    surfaces: CopiedSurfaces,
    facts: RunFacts,
    answers: AnswerFacts,
    window: u64,
    /// How many keyframes there were when the last one came, and since when.
    newest: (usize, Instant),
}

impl Replica {
    /// Opens or creates the copy in a folder and goes on from what is durable in it.
    ///
    /// # Errors
    /// Where its files cannot be read or written.
    pub fn open(folder: &Path, robot: &str, identity: u64, form: CopyForm) -> Result<Self, FleetError> {
        std::fs::create_dir_all(folder).map_err(FleetError::io("make", folder))?;
        let (mut facts, mut answers) = (RunFacts::default(), AnswerFacts::default());
        let align =
            JournalCopy::open(folder, Growing::Align, |version, payload| facts.take(version, payload))?;
        let optimise =
            JournalCopy::open(folder, Growing::Optimise, |version, payload| answers.take(version, payload))?;
        let surfaces = match form {
            CopyForm::Whole => CopiedSurfaces::Whole(StoreCopy::open(folder, &facts.slots)?),
            CopyForm::Kept => CopiedSurfaces::Kept(SurfaceCopy::open(folder)?),
        };
        let (folder, robot) = (folder.to_owned(), robot.to_owned());
        let (window, newest) = (FIRST_WINDOW, (0, Instant::now()));
        Ok(Self { folder, robot, identity, align, optimise, surfaces, facts, answers, window, newest })
    }

    /// What the records say of the run.
    pub fn facts(&self) -> &RunFacts {
        &self.facts
    }

    /// Bytes of the aligner's journal.
    pub fn align_bytes(&self) -> u64 {
        self.align.len_bytes()
    }

    /// Bytes of both journals and the surfaces.
    pub fn len_bytes(&self) -> u64 {
        let surfaces = match &self.surfaces {
            CopiedSurfaces::Whole(store) => store.len_bytes(),
            CopiedSurfaces::Kept(copy) => copy.len_bytes(),
        };
        self.align.len_bytes().saturating_add(self.optimise.len_bytes()).saturating_add(surfaces)
    }

    /// Surfaces that are here, and those that the map lacks.
    pub fn n_surfaces(&self) -> (u64, u64) {
        let n_here = match &self.surfaces {
            CopiedSurfaces::Whole(store) => store.n_whole() as u64,
            CopiedSurfaces::Kept(copy) => copy.n_records(),
        };
        let n_missing = match &self.surfaces {
            CopiedSurfaces::Whole(_) => (self.facts.slots.len() as u64).saturating_sub(n_here),
            CopiedSurfaces::Kept(copy) => {
                let is_active = (0..).zip(&self.facts.is_active);
                is_active.filter(|(id, is_active)| **is_active && !copy.has(*id)).count() as u64
            }
        };
        (n_here, n_missing)
    }

    /// Whether every surface that a map is made of is here.
    pub fn is_complete(&self) -> bool {
        self.n_surfaces().1 == 0
    }

    /// Whether the statistics are those that a run writes last, some time after the end of its journals.
    pub fn has_last_word(&self) -> bool {
        let said = read_statistics(&self.folder).map(|statistics| statistics.ended);
        said.is_ok_and(|ended| matches!(ended, Ended::Finished | Ended::Failed))
    }

    /// What a map can be made of now; `None`: of no more than before.
    pub fn extent(&self) -> Option<Extent> {
        let align_bytes = self.align_bytes();
        match &self.surfaces {
            CopiedSurfaces::Whole(_) => self.is_complete().then_some(Extent { align_bytes, n_surfaces: 0 }),
            CopiedSurfaces::Kept(copy) => {
                // Without a surface there is nothing to be seen.
                let n_surfaces = copy.n_records();
                (n_surfaces > 0 || self.is_complete()).then_some(Extent { align_bytes, n_surfaces })
            }
        }
    }

    /// Answers in the run that came from a base.
    pub fn n_from_base(&self) -> u64 {
        self.answers.n_from_base
    }

    /// The oldest request of the run without an answer, once all is here that an answer is made of.
    pub fn open_request(&self) -> Option<u64> {
        let n_answered = self.answers.n_answered;
        // A correction that has taken effect was journaled before.
        let is_whole = self.is_complete() && self.facts.n_applied <= n_answered;
        self.facts.requests.iter().copied().find(|request| is_whole && *request >= n_answered)
    }

    /// Keyframes whose surfaces are to be asked for now, the newest first.
    fn missing(&self, copy: &SurfaceCopy) -> Vec<u32> {
        let is_moving = self.newest.1.elapsed() < STANDS_AFTER;
        self.facts.wanted(is_moving).into_iter().rev().filter(|id| !copy.has(*id)).collect()
    }

    /// Bytes that the robot has and the base wants and has not; of surfaces that were not packed yet, as many
    /// as of others.
    pub fn lag_bytes(&self, offer: &Offer) -> u64 {
        let align = offer.align_bytes.saturating_sub(self.align.len_bytes());
        let optimise = offer.optimise_bytes.saturating_sub(self.optimise.len_bytes());
        let surfaces = match &self.surfaces {
            CopiedSurfaces::Whole(store) => self.facts.store_bytes().saturating_sub(store.len_bytes()),
            CopiedSurfaces::Kept(copy) => match copy.mean_bytes() {
                0 => GUESSED_SURFACE_BYTES.saturating_mul(self.missing(copy).len() as u64),
                mean => mean.saturating_mul(self.missing(copy).len() as u64),
            },
        };
        align.saturating_add(optimise).saturating_add(surfaces)
    }

    /// Asks for everything that the offer has and the base has not, until it is here or an answer
    /// brings nothing.
    ///
    /// # Errors
    /// Where the copy cannot be written; what the robot does wrong is in the answer.
    pub fn pull(
        &mut self,
        carrier: &mut dyn RobotCarrier,
        offer: &Offer,
        stop: &dyn Fn() -> bool,
    ) -> Result<Pulled, FleetError> {
        let mut pulled = Pulled::default();
        let journals = [(&self.align, offer.align_bytes), (&self.optimise, offer.optimise_bytes)];
        for (copy, bytes) in journals {
            if bytes < copy.len_bytes() {
                let words = format!("a journal has {bytes} bytes, {} were copied", copy.len_bytes());
                pulled.refuse(PieceRefusal::Replaced, words);
                return Ok(pulled);
            }
        }
        self.pull_small(carrier, offer, &mut pulled)?;
        let begun = Instant::now();
        let mut refused = BTreeSet::new();
        while !stop() {
            let before = (pulled.taken_bytes, refused.len());
            if self.align.len_bytes() < offer.align_bytes {
                self.pull_journal(carrier, Growing::Align, &mut pulled)?;
            }
            // Before all journal is here it is not known which surfaces are wanted.
            let is_known = self.align.len_bytes() >= offer.align_bytes;
            if self.newest.0 != self.facts.slots.len() {
                self.newest = (self.facts.slots.len(), Instant::now());
            }
            match &self.surfaces {
                CopiedSurfaces::Whole(store) if store.len_bytes() < self.facts.store_bytes() => {
                    self.pull_store(carrier, &mut pulled)?;
                }
                CopiedSurfaces::Kept(_) if is_known => {
                    self.pull_surfaces(carrier, &mut refused, &mut pulled)?;
                }
                _ => {}
            }
            if self.optimise.len_bytes() < offer.optimise_bytes {
                self.pull_journal(carrier, Growing::Optimise, &mut pulled)?;
            }
            if (pulled.taken_bytes, refused.len()) == before {
                break;
            }
            // There may be newer keyframes, which come before those that are left.
            if matches!(self.surfaces, CopiedSurfaces::Kept(_)) && is_known && begun.elapsed() > SURFACES_FOR
            {
                break;
            }
        }
        Ok(pulled)
    }

    fn pull_small(
        &mut self,
        carrier: &mut dyn RobotCarrier,
        offer: &Offer,
        pulled: &mut Pulled,
    ) -> Result<(), FleetError> {
        for name in SMALL_FILES {
            let path = self.folder.join(name);
            let Some(crc) = offer.small.get(name) else { continue };
            if std::fs::read(&path).is_ok_and(|bytes| crc32fast::hash(&bytes) == *crc) {
                continue;
            }
            let request = Request::Small { file: name.into() };
            let Some(bytes) = self.ask(carrier, &request, 0, MAX_SMALL_BYTES, pulled) else { continue };
            if crc32fast::hash(&bytes) != *crc {
                // It has changed since the offer.
                continue;
            }
            if name == "run.json" && identity_of(&bytes) != self.identity {
                pulled.refuse(PieceRefusal::OtherRun, "run.json is of another run");
                continue;
            }
            write_atomically(&path, Durability::RunState, |writer| writer.write_all(&bytes))
                .map_err(FleetError::io("write", &path))?;
            pulled.took(bytes.len());
        }
        Ok(())
    }

    fn pull_journal(
        &mut self,
        carrier: &mut dyn RobotCarrier,
        file: Growing,
        pulled: &mut Pulled,
    ) -> Result<(), FleetError> {
        let copy = if file == Growing::Align { &self.align } else { &self.optimise };
        let (from, checksum) = (copy.len_bytes(), copy.checksum());
        let request = Request::Bytes { file, identity: self.identity, from, checksum, max: self.window };
        let most = whole(self.window).saturating_add(MAX_FRAMED_BYTES);
        let Some(bytes) = self.ask(carrier, &request, from, most, pulled) else { return Ok(()) };
        let (used, problem) = match file {
            Growing::Align => {
                let facts = &mut self.facts;
                self.align.append(&bytes, |version, payload| facts.take(version, payload))?
            }
            _ => {
                let answers = &mut self.answers;
                self.optimise.append(&bytes, |version, payload| answers.take(version, payload))?
            }
        };
        pulled.took(used);
        if let Some((refusal, words)) = problem {
            pulled.refuse(refusal, words);
        }
        Ok(())
    }

    fn pull_store(&mut self, carrier: &mut dyn RobotCarrier, pulled: &mut Pulled) -> Result<(), FleetError> {
        let CopiedSurfaces::Whole(store) = &self.surfaces else { return Ok(()) };
        let from = store.len_bytes();
        let max = self.window.min(self.facts.store_bytes().saturating_sub(from));
        let request =
            Request::Bytes { file: Growing::Store, identity: self.identity, from, checksum: 0, max };
        let Some(bytes) = self.ask(carrier, &request, from, whole(max), pulled) else { return Ok(()) };
        let CopiedSurfaces::Whole(store) = &mut self.surfaces else { return Ok(()) };
        if bytes.is_empty() {
            return Ok(());
        }
        if store.append(&bytes, &self.facts.slots)? {
            pulled.took(bytes.len());
        } else {
            pulled.refuse(PieceRefusal::Checksum, "a surface is not what its record says");
        }
        Ok(())
    }

    /// Asks for surfaces of kept keyframes, the newest first; those in `refused` came to nothing before.
    fn pull_surfaces(
        &mut self,
        carrier: &mut dyn RobotCarrier,
        refused: &mut BTreeSet<u32>,
        pulled: &mut Pulled,
    ) -> Result<(), FleetError> {
        let CopiedSurfaces::Kept(copy) = &self.surfaces else { return Ok(()) };
        let mut wanted = self.missing(copy);
        wanted.retain(|id| !refused.contains(id));
        wanted.truncate(MOST_WANTED);
        if wanted.is_empty() {
            return Ok(());
        }
        let grid = match grid_of(&self.folder) {
            Ok(grid) => grid,
            Err(words) => {
                pulled.refuse(PieceRefusal::Nonsense, words);
                return Ok(());
            }
        };
        let slot = |id: u32| Some((id, *self.facts.slots.get(id as usize)?));
        let (wanted, slots): (Vec<u32>, Vec<_>) = wanted.into_iter().filter_map(slot).unzip();
        let (identity, max) = (self.identity, self.window);
        let request = Request::Surfaces { identity, max, wanted: WantedSurfaces::new(slots) };
        let most = whole(max).saturating_add(max_stored_bytes(grid));
        let Some(stream) = self.ask(carrier, &request, 0, most, pulled) else { return Ok(()) };
        let surfaces = surfaces_in(&stream, grid, &wanted, refused, pulled);
        if let CopiedSurfaces::Kept(copy) = &mut self.surfaces {
            copy.append(&surfaces)?;
        }
        pulled.took(surfaces.iter().map(|surface| surface.bytes.len()).sum());
        Ok(())
    }

    /// The bytes of an answer from `at` on, as far as its pieces continue each other; `None` where
    /// nothing of use came.
    fn ask(
        &mut self,
        carrier: &mut dyn RobotCarrier,
        request: &Request,
        at: u64,
        most: usize,
        pulled: &mut Pulled,
    ) -> Option<Vec<u8>> {
        let begun = Instant::now();
        let mut answer = ComingAnswer::new(self.identity, at, most);
        carrier.ask(&self.robot, request, &mut |piece| answer.take(piece, pulled));
        self.window = match begun.elapsed() {
            took if took > LONG || !answer.is_whole => (self.window / 2).max(LEAST_WINDOW),
            took if took < SHORT => self.window.saturating_mul(2).min(MOST_WINDOW),
            _ => self.window,
        };
        // Of a small file a part is of no use.
        let is_of_use = answer.is_whole || !matches!(request, Request::Small { .. });
        is_of_use.then_some(answer.bytes)
    }
}

fn whole(n: u64) -> usize {
    usize::try_from(n).unwrap_or(usize::MAX)
}

/// The surfaces of a stream that can be used, of these keyframes; the others are refused.
fn surfaces_in(
    stream: &[u8],
    grid: Grid,
    wanted: &[u32],
    refused: &mut BTreeSet<u32>,
    pulled: &mut Pulled,
) -> Vec<TravelledSurface> {
    let mut found = Vec::new();
    for (keyframe, framed) in wanted.iter().copied().zip(frames(stream)) {
        let problem = match framed {
            Framed::Whole(bytes) => match check_surface(grid, bytes) {
                Ok(()) => {
                    found.push(TravelledSurface { keyframe, bytes: bytes.to_vec() });
                    continue;
                }
                Err(words) => (PieceRefusal::Nonsense, words),
            },
            Framed::Spoilt => (PieceRefusal::Checksum, "not the bytes that were sent".into()),
            Framed::Gone => (PieceRefusal::Gone, "damaged or given up at the robot".into()),
        };
        pulled.refuse(problem.0, format!("the surface of keyframe {keyframe}: {}", problem.1));
        refused.insert(keyframe);
    }
    found
}
