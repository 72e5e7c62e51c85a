//! One run of one robot at the base: a run directory that becomes the robot's, byte for byte.

use crate::carrier::Carrier;
use crate::checked::{AnswerFacts, RunFacts};
use crate::error::FleetError;
use crate::journal_copy::JournalCopy;
use crate::served::{REPLACED, identity_of};
use crate::store_copy::StoreCopy;
use crate::wire::{Growing, Kind, MAX_SMALL_BYTES, Offer, Piece, Refusal, Request, SMALL_FILES};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tessera_journal::{Durability, MAX_FRAMED_BYTES, write_atomically};

/// Bytes of a request, at first, at least and at most: it grows while answers take less than
/// [`SHORT`], and shrinks where they take more than [`LONG`] or are cut.
const FIRST_WINDOW: u64 = 256 << 10;
const LEAST_WINDOW: u64 = 16 << 10;
const MOST_WINDOW: u64 = 8 << 20;
const SHORT: Duration = Duration::from_millis(300);
const LONG: Duration = Duration::from_secs(2);

/// What came of asking.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pulled {
    /// Bytes of files that were taken in.
    pub taken_bytes: u64,
    /// Bytes that came, those of refused pieces and those that came twice included.
    pub received_bytes: u64,
    /// What was refused, with words where there are some.
    pub refused: Vec<(Refusal, String)>,
}

impl Pulled {
    fn refuse(&mut self, refusal: Refusal, words: impl Into<String>) {
        self.refused.push((refusal, words.into()));
    }
}

/// The copy of a run.
pub struct Replica {
    folder: PathBuf,
    robot: String,
    identity: u64,
    align: JournalCopy,
    optimise: JournalCopy,
    store: StoreCopy,
    facts: RunFacts,
    answers: AnswerFacts,
    window: u64,
}

impl Replica {
    /// Opens or creates the copy in a folder and goes on from what is durable in it.
    ///
    /// # Errors
    /// Where its files cannot be read or written.
    pub fn open(folder: &Path, robot: &str, identity: u64) -> Result<Self, FleetError> {
        std::fs::create_dir_all(folder).map_err(FleetError::io("make", folder))?;
        let (mut facts, mut answers) = (RunFacts::default(), AnswerFacts::default());
        let align = JournalCopy::open(folder, Growing::Align, |payload| facts.take(payload))?;
        let optimise = JournalCopy::open(folder, Growing::Optimise, |payload| answers.take(payload))?;
        let store = StoreCopy::open(folder, &facts.slots)?;
        let (folder, robot) = (folder.to_owned(), robot.to_owned());
        let window = FIRST_WINDOW;
        Ok(Self { folder, robot, identity, align, optimise, store, facts, answers, window })
    }

    /// What the records say of the run.
    pub fn facts(&self) -> &RunFacts {
        &self.facts
    }

    /// Bytes of the aligner's journal.
    pub fn align_bytes(&self) -> u64 {
        self.align.len_bytes()
    }

    /// Bytes of both journals and the store.
    pub fn len_bytes(&self) -> u64 {
        self.align.len_bytes() + self.optimise.len_bytes() + self.store.len_bytes()
    }

    /// Whether the surface of every keyframe in the journal is here: a map can be made.
    pub fn is_complete(&self) -> bool {
        self.store.n_whole() == self.facts.slots.len()
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

    /// Bytes that the robot has and the base has not.
    pub fn lag_bytes(&self, offer: &Offer) -> u64 {
        let journals = offer.align_bytes.saturating_sub(self.align.len_bytes())
            + offer.optimise_bytes.saturating_sub(self.optimise.len_bytes());
        journals + self.facts.store_bytes().saturating_sub(self.store.len_bytes())
    }

    /// Asks for everything that the offer has and the base has not, until it is here or an answer
    /// brings nothing.
    ///
    /// # Errors
    /// Where the copy cannot be written; what the robot does wrong is in the answer.
    pub fn pull(
        &mut self,
        carrier: &mut dyn Carrier,
        offer: &Offer,
        stop: &dyn Fn() -> bool,
    ) -> Result<Pulled, FleetError> {
        let mut pulled = Pulled::default();
        let journals = [(&self.align, offer.align_bytes), (&self.optimise, offer.optimise_bytes)];
        for (copy, bytes) in journals {
            if bytes < copy.len_bytes() {
                let words = format!("a journal has {bytes} bytes, {} were copied", copy.len_bytes());
                pulled.refuse(Refusal::Replaced, words);
                return Ok(pulled);
            }
        }
        self.pull_small(carrier, offer, &mut pulled)?;
        while !stop() {
            let before = pulled.taken_bytes;
            if self.align.len_bytes() < offer.align_bytes {
                self.pull_journal(carrier, Growing::Align, &mut pulled)?;
            }
            if self.store.len_bytes() < self.facts.store_bytes() {
                self.pull_store(carrier, &mut pulled)?;
            }
            if self.optimise.len_bytes() < offer.optimise_bytes {
                self.pull_journal(carrier, Growing::Optimise, &mut pulled)?;
            }
            if pulled.taken_bytes == before {
                break;
            }
        }
        Ok(pulled)
    }

    fn pull_small(
        &mut self,
        carrier: &mut dyn Carrier,
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
                pulled.refuse(Refusal::OtherRun, "run.json is of another run");
                continue;
            }
            write_atomically(&path, Durability::RunState, |writer| writer.write_all(&bytes))
                .map_err(FleetError::io("write", &path))?;
            pulled.taken_bytes += bytes.len() as u64;
        }
        Ok(())
    }

    fn pull_journal(
        &mut self,
        carrier: &mut dyn Carrier,
        file: Growing,
        pulled: &mut Pulled,
    ) -> Result<(), FleetError> {
        let copy = if file == Growing::Align { &self.align } else { &self.optimise };
        let (from, checksum) = (copy.len_bytes(), copy.checksum());
        let request = Request::Bytes { file, identity: self.identity, from, checksum, max: self.window };
        let most = self.window as usize + MAX_FRAMED_BYTES;
        let Some(bytes) = self.ask(carrier, &request, from, most, pulled) else { return Ok(()) };
        let (used, problem) = match file {
            Growing::Align => {
                let facts = &mut self.facts;
                self.align.append(&bytes, |payload| facts.take(payload))?
            }
            _ => {
                let answers = &mut self.answers;
                self.optimise.append(&bytes, |payload| answers.take(payload))?
            }
        };
        pulled.taken_bytes += used as u64;
        if let Some((refusal, words)) = problem {
            pulled.refuse(refusal, words);
        }
        Ok(())
    }

    fn pull_store(&mut self, carrier: &mut dyn Carrier, pulled: &mut Pulled) -> Result<(), FleetError> {
        let from = self.store.len_bytes();
        let max = self.window.min(self.facts.store_bytes() - from);
        let request =
            Request::Bytes { file: Growing::Store, identity: self.identity, from, checksum: 0, max };
        let Some(bytes) = self.ask(carrier, &request, from, max as usize, pulled) else { return Ok(()) };
        if bytes.is_empty() {
            return Ok(());
        }
        if self.store.append(&bytes, &self.facts.slots)? {
            pulled.taken_bytes += bytes.len() as u64;
        } else {
            pulled.refuse(Refusal::Checksum, "a surface is not what its record says");
        }
        Ok(())
    }

    /// The bytes of an answer from `at` on, as far as its pieces continue each other; `None` where
    /// nothing of use came.
    fn ask(
        &mut self,
        carrier: &mut dyn Carrier,
        request: &Request,
        at: u64,
        most: usize,
        pulled: &mut Pulled,
    ) -> Option<Vec<u8>> {
        let begun = Instant::now();
        let mut answer = Answer { identity: self.identity, at, most, bytes: Vec::new(), is_whole: false };
        carrier.ask(&self.robot, request, &mut |piece| answer.take(piece, pulled));
        self.window = match begun.elapsed() {
            took if took > LONG || !answer.is_whole => (self.window / 2).max(LEAST_WINDOW),
            took if took < SHORT => (self.window * 2).min(MOST_WINDOW),
            _ => self.window,
        };
        // Of a small file a part is of no use.
        let is_of_use = answer.is_whole || !matches!(request, Request::Small { .. });
        is_of_use.then_some(answer.bytes)
    }
}

/// An answer as it comes.
struct Answer {
    identity: u64,
    /// Offset of the first byte that is wanted.
    at: u64,
    most: usize,
    bytes: Vec<u8>,
    is_whole: bool,
}

impl Answer {
    /// Takes a piece; `false`: enough.
    fn take(&mut self, piece: Result<Piece, Refusal>, pulled: &mut Pulled) -> bool {
        let piece = match piece {
            Ok(piece) => piece,
            Err(refusal) => {
                pulled.refuse(refusal, "");
                // What comes behind it does not continue what is here.
                return true;
            }
        };
        pulled.received_bytes += piece.bytes.len() as u64;
        if piece.kind == Kind::Refused {
            let words = refusal_words(&piece);
            let refusal = if words.starts_with(REPLACED) { Refusal::Replaced } else { Refusal::OtherRun };
            pulled.refuse(refusal, words);
            return false;
        }
        if piece.identity != self.identity {
            pulled.refuse(Refusal::OtherRun, format!("a piece of run {:016x}", piece.identity));
            return true;
        }
        let next = self.at + self.bytes.len() as u64;
        if piece.at != next {
            pulled.refuse(Refusal::OtherPlace, format!("a piece at {}, expected {next}", piece.at));
            return true;
        }
        if piece.kind == Kind::End {
            self.is_whole = true;
            return false;
        }
        if self.bytes.len() + piece.bytes.len() > self.most {
            pulled.refuse(Refusal::TooLarge, format!("more than {} bytes", self.most));
            return false;
        }
        self.bytes.extend(piece.bytes);
        true
    }
}

/// Why a robot has nothing to give.
fn refusal_words(piece: &Piece) -> String {
    String::from_utf8_lossy(&piece.bytes).chars().take(200).collect()
}

/// Asks a robot which run it has.
pub fn ask_offer(carrier: &mut dyn Carrier, robot: &str, pulled: &mut Pulled) -> Option<Offer> {
    let mut found = None;
    carrier.ask(robot, &Request::Offer, &mut |piece| {
        let piece = match piece {
            Ok(piece) => piece,
            Err(refusal) => {
                pulled.refuse(refusal, "");
                return true;
            }
        };
        pulled.received_bytes += piece.bytes.len() as u64;
        if piece.kind != Kind::Data {
            pulled.refuse(Refusal::Offer, refusal_words(&piece));
            return false;
        }
        match read_offer(&piece) {
            Ok(offer) => found = Some(offer),
            Err((refusal, words)) => pulled.refuse(refusal, words),
        }
        false
    });
    found
}

fn read_offer(piece: &Piece) -> Result<Offer, (Refusal, String)> {
    let offer: Offer =
        serde_json::from_slice(&piece.bytes).map_err(|e| (Refusal::Offer, format!("no offer: {e}")))?;
    let own = env!("CARGO_PKG_VERSION");
    if offer.protocol != crate::wire::PROTOCOL || offer.version != own {
        let Offer { protocol, version, .. } = offer;
        let expected = crate::wire::PROTOCOL;
        let words = format!("protocol {protocol} of version {version:?}, expected {expected} of {own}");
        return Err((Refusal::Offer, words));
    }
    if offer.identity != piece.identity {
        return Err((Refusal::OtherRun, "an offer of another run than its label says".into()));
    }
    if tessera_transport::check_name(&offer.run).is_err() {
        return Err((Refusal::Name, format!("a run {:?}", offer.run.chars().take(80).collect::<String>())));
    }
    if offer.small.keys().any(|name| !SMALL_FILES.contains(&name.as_str())) {
        return Err((Refusal::Offer, "a file that no run has".into()));
    }
    Ok(offer)
}
