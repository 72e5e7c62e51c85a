//! Copies without a network: whatever a way does to pieces, the copy is the run.

use crate::processes::map_files;
use crate::run::{GrowingRun, assert_same};
use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;
use tessera_fleet::copies::arrivals::{Arrival, CopyForm, Mapped};
use tessera_fleet::copies::replica::{Pulled, Replica, ask_offer};
use tessera_fleet::map::joint::{KnownMap, make_map};
use tessera_fleet::robot::served::Served;
use tessera_fleet::wire::carrier::RobotCarrier;
use tessera_fleet::wire::piece::{Piece, PieceKind};
use tessera_fleet::wire::request::{PieceRefusal, Request};
use tessera_numerics::SplitMix64;
use tessera_outputs::{CheckedFile, FileState};
use tessera_slam::StoreSlot;

/// A way that cuts, loses, repeats, swaps and spoils pieces, and brings some that were not asked for.
struct Faulty {
    served: Served,
    random: SplitMix64,
    /// One piece in so many has a fault; 0: none.
    one_in: usize,
    /// A piece of long ago.
    old: Option<Piece>,
}

impl Faulty {
    fn new(folder: &Path, seed: u64, one_in: usize) -> Self {
        let served = Served::open(folder).unwrap();
        Self { served, random: SplitMix64::for_frame(seed, 1), one_in, old: None }
    }

    /// What becomes of a piece.
    fn fate(&mut self, piece: Piece) -> Vec<Result<Piece, PieceRefusal>> {
        let fault = if self.one_in == 0 { 1 } else { self.random.below(self.one_in) };
        if fault > 0 {
            return vec![Ok(piece)];
        }
        let other = Piece { identity: piece.identity ^ 1, ..piece.clone() };
        let spoilt = {
            let mut bytes = piece.bytes.clone();
            bytes.push(1);
            Piece::read(&piece.label(), &bytes)
        };
        let flood = Piece::data(piece.identity, piece.at, vec![0; 1 << 20]);
        let lie = Piece::data(piece.identity, piece.at, piece.bytes.iter().map(|b| b ^ 0x55).collect());
        let old = self.old.replace(piece.clone()).map(Ok);
        match self.random.below(8) {
            0 => vec![],
            1 => vec![Ok(piece.clone()), Ok(piece)],
            2 => vec![Ok(other), Ok(piece)],
            3 => vec![spoilt],
            4 => vec![Ok(lie)],
            5 => vec![Ok(flood); 40],
            6 => vec![Err(PieceRefusal::Foreign), Ok(piece)],
            _ => old.into_iter().chain([Ok(piece)]).collect(),
        }
    }
}

impl RobotCarrier for Faulty {
    fn robots(&mut self) -> Vec<String> {
        vec!["a".into()]
    }

    fn ask(&mut self, _: &str, request: &Request, take: &mut dyn FnMut(Result<Piece, PieceRefusal>) -> bool) {
        let mut pieces = Vec::new();
        self.served.answer(request, &mut |piece| {
            pieces.push(piece);
            true
        });
        let is_cut = self.one_in > 0 && self.random.below(4) == 0;
        let n = if is_cut { self.random.below(pieces.len() + 1) } else { pieces.len() };
        pieces.truncate(n);
        for piece in pieces {
            for piece in self.fate(piece) {
                if !take(piece) {
                    return;
                }
            }
        }
    }
}

fn visit(carrier: &mut Faulty, replica: &mut Replica) -> Pulled {
    let mut asked = Pulled::default();
    let Some(offer) = ask_offer(carrier, "a", &mut asked) else { return asked };
    let mut pulled = replica.pull(carrier, &offer, &|| false).unwrap();
    pulled.refused.extend(asked.refused);
    pulled
}

fn identity(folder: &Path) -> u64 {
    tessera_fleet::robot::served::identity_of(&std::fs::read(folder.join("run.json")).unwrap())
}

#[test]
fn a_copy_is_the_run_whatever_happens_on_the_way() {
    let mut refused = BTreeSet::new();
    for seed in 0..12 {
        let form = if seed % 2 == 0 { CopyForm::Kept } else { CopyForm::Whole };
        let dir = tempfile::tempdir().unwrap();
        let (from, to) = (dir.path().join("run"), dir.path().join("copy"));
        let mut run = GrowingRun::begin(&from, "run", seed);
        let mut faulty = Faulty::new(&from, seed, 6);
        let mut replica = Replica::open(&to, "a", identity(&from), form).unwrap();
        for step in 0..60u64 {
            (0..4).for_each(|_| run.grow());
            refused.extend(visit(&mut faulty, &mut replica).refused.into_iter().map(|(what, _)| what));
            if step % 5 == 4 {
                // The base dies, and what it was writing is torn.
                drop(replica);
                tear(&to, form, &mut faulty.random);
                replica = Replica::open(&to, "a", identity(&from), form).unwrap();
            }
        }
        run.end();
        faulty.one_in = 0;
        (0..3).for_each(|_| drop(visit(&mut faulty, &mut replica)));
        assert!(replica.facts().is_ended && replica.is_complete());
        assert_eq!(replica.facts().n_frames, 240, "each once");
        assert_same(&from, &to);
        let again = visit(&mut faulty, &mut replica);
        assert_eq!((again.taken_bytes, again.refused.len()), (0, 0));
        // As `tessera verify` reads it.
        let verified = tessera_outputs::verify(&to).unwrap();
        let is_whole = |file: &CheckedFile| file.state == FileState::Whole;
        assert!(verified.is_whole && verified.files.iter().all(is_whole), "{form:?}: {verified:?}");
        let surfaces = if form == CopyForm::Whole { "keyframes.store" } else { "surfaces.journal" };
        assert!(verified.files.iter().any(|file| file.name == surfaces), "{verified:?}");
    }
    let expected = [
        PieceRefusal::Foreign,
        PieceRefusal::TooLarge,
        PieceRefusal::Checksum,
        PieceRefusal::OtherRun,
        PieceRefusal::OtherPlace,
        PieceRefusal::Nonsense,
    ];
    assert!(expected.iter().all(|what| refused.contains(what)), "{refused:?}");
}

/// Leaves behind what a death in the middle of a write does.
fn tear(folder: &Path, form: CopyForm, random: &mut SplitMix64) {
    let surfaces = if form == CopyForm::Whole { "keyframes.store" } else { "surfaces.journal" };
    for name in ["align.journal", "optimise.journal", surfaces] {
        let path = folder.join(name);
        let mut file = OpenOptions::new().read(true).append(true).open(&path).unwrap();
        let len = file.metadata().unwrap().len();
        if random.below(2) == 0 {
            file.set_len(len - (random.below(200) as u64).min(len)).unwrap();
        } else {
            file.write_all(&vec![7; random.below(200)]).unwrap();
        }
    }
}

/// A way without faults that takes down which surfaces were asked for.
struct Watched {
    way: Faulty,
    asked: Vec<StoreSlot>,
}

impl RobotCarrier for Watched {
    fn robots(&mut self) -> Vec<String> {
        self.way.robots()
    }

    fn ask(
        &mut self,
        robot: &str,
        request: &Request,
        take: &mut dyn FnMut(Result<Piece, PieceRefusal>) -> bool,
    ) {
        if let Request::Surfaces { wanted, .. } = request {
            self.asked.extend(wanted.slots());
        }
        self.way.ask(robot, request, take);
    }
}

#[test]
fn surfaces_come_the_newest_first_and_culled_ones_not_at_all() {
    let dir = tempfile::tempdir().unwrap();
    let (from, to) = (dir.path().join("run"), dir.path().join("copy"));
    let mut run = GrowingRun::begin(&from, "run", 1);
    // Keyframes 0 to 12, of which the last one culls two.
    (0..84).for_each(|_| run.grow());
    run.culls = vec![2, 5];
    (0..6).for_each(|_| run.grow());
    let mut way = Watched { way: Faulty::new(&from, 1, 0), asked: Vec::new() };
    let mut replica = Replica::open(&to, "a", identity(&from), CopyForm::Kept).unwrap();
    let mut asked = |replica: &mut Replica| {
        for _ in 0..4 {
            let offer = ask_offer(&mut way, "a", &mut Pulled::default()).unwrap();
            assert_eq!(replica.pull(&mut way, &offer, &|| false).unwrap().refused, []);
        }
        let slots = &replica.facts().slots;
        let id = |slot: StoreSlot| slots.iter().position(|known| *known == slot).unwrap();
        std::mem::take(&mut way.asked).into_iter().map(id).collect::<Vec<_>>()
    };
    // The five newest may be culled still.
    assert_eq!(asked(&mut replica), [7, 6, 4, 3, 1, 0]);
    assert_eq!(replica.n_surfaces(), (6, 5));
    run.culls = vec![8];
    (0..7).for_each(|_| run.grow());
    assert_eq!(asked(&mut replica), [0; 0], "nine is one of the five newest");
    run.end();
    assert_eq!(asked(&mut replica), [13, 12, 11, 10, 9]);
    assert_eq!(replica.n_surfaces(), (11, 0));
    assert_same(&from, &to);
}

#[test]
fn a_map_is_the_same_whichever_surfaces_had_come_before_they_were_culled() {
    let dir = tempfile::tempdir().unwrap();
    let from = dir.path().join("run");
    let mut run = GrowingRun::begin(&from, "run", 1);
    let arrival = |base: &Path| Arrival {
        robot: "a".into(),
        run: base.file_name().unwrap().to_string_lossy().into_owned(),
        identity: 7,
        origin: None,
        form: CopyForm::Kept,
    };
    let [early, late] = ["early", "late"].map(|name| dir.path().join(name));
    let map = |base: &Path| {
        let arrival = Arrival { run: "run".into(), ..arrival(base) };
        let folder = arrival.folder(base);
        let mut way = Faulty::new(&from, 1, 0);
        let mut replica = Replica::open(&folder, "a", identity(&from), CopyForm::Kept).unwrap();
        (0..4).for_each(|_| drop(visit(&mut way, &mut replica)));
        let mapped = Mapped { number: 1, extents: vec![replica.extent().unwrap()] };
        make_map(base, &[arrival], &mapped, KnownMap::default()).unwrap();
        (map_files(base), mapped)
    };
    (0..90).for_each(|_| run.grow());
    let (before, part) = map(&early);
    run.culls = vec![2, 5];
    (0..30).for_each(|_| run.grow());
    run.end();
    let (after, whole) = map(&early);
    assert!(before["map.ply"] != after["map.ply"]);
    assert_eq!(map(&late).0, after);
    // What was journaled of a map says which surfaces it is made of.
    let remake = |mapped: &Mapped| {
        let arrival = Arrival { run: "run".into(), ..arrival(&early) };
        make_map(&early, &[arrival], mapped, KnownMap::default()).unwrap();
        map_files(&early)
    };
    assert!(remake(&part) == before && remake(&whole) == after);
}

#[test]
fn a_journal_that_was_replaced_is_refused_and_nothing_is_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let (from, to) = (dir.path().join("run"), dir.path().join("copy"));
    let mut run = GrowingRun::begin(&from, "run", 1);
    (0..30).for_each(|_| run.grow());
    let mut way = Faulty::new(&from, 1, 0);
    let mut replica = Replica::open(&to, "a", identity(&from), CopyForm::Whole).unwrap();
    visit(&mut way, &mut replica);
    assert_same(&from, &to);
    let before = std::fs::read(to.join("align.journal")).unwrap();
    drop(run);
    std::fs::remove_file(from.join("align.journal")).unwrap();
    let mut other = GrowingRun::begin(&from, "run", 2);
    (0..60).for_each(|_| other.grow());
    let pulled = visit(&mut way, &mut replica);
    assert!(pulled.refused.iter().any(|(what, _)| *what == PieceRefusal::Replaced), "{pulled:?}");
    assert_eq!(std::fs::read(to.join("align.journal")).unwrap(), before);
}

#[test]
fn another_run_in_the_same_folder_is_another_run() {
    let dir = tempfile::tempdir().unwrap();
    let (from, to) = (dir.path().join("run"), dir.path().join("copy"));
    let mut run = GrowingRun::begin(&from, "first", 1);
    (0..10).for_each(|_| run.grow());
    let mut way = Faulty::new(&from, 1, 0);
    let first = identity(&from);
    let mut replica = Replica::open(&to, "a", first, CopyForm::Kept).unwrap();
    visit(&mut way, &mut replica);
    let bytes = replica.align_bytes();
    drop(run);
    std::fs::remove_dir_all(&from).unwrap();
    let mut run = GrowingRun::begin(&from, "second", 2);
    (0..20).for_each(|_| run.grow());
    assert_ne!(identity(&from), first);
    let mut asked = Pulled::default();
    let offer = ask_offer(&mut way, "a", &mut asked).unwrap();
    assert_eq!((offer.identity, offer.run.as_str()), (identity(&from), "second"));
    // Asked for the first one's bytes, it has none.
    let pulled = replica.pull(&mut way, &offer, &|| false).unwrap();
    assert!(pulled.refused.iter().all(|(what, _)| *what == PieceRefusal::OtherRun), "{pulled:?}");
    assert_eq!(replica.align_bytes(), bytes);
}

#[test]
fn records_that_none_can_have_stop_a_copy_before_them() {
    use tessera_journal::{Follower, Journal};
    use tessera_slam::AlignRecord;
    use tessera_stage::ALIGN_JOURNAL;
    let dir = tempfile::tempdir().unwrap();
    let (from, to) = (dir.path().join("run"), dir.path().join("copy"));
    let mut run = GrowingRun::begin(&from, "run", 1);
    (0..10).for_each(|_| run.grow());
    let mut bad: Vec<AlignRecord> = Vec::new();
    let journal = from.join("align.journal");
    let mut follower = Follower::open(&journal, ALIGN_JOURNAL).unwrap();
    while let Some(record) = follower.next().unwrap() {
        if let AlignRecord::Frame(mut frame) = record {
            frame.submap = u32::MAX;
            bad.push(AlignRecord::Frame(frame.clone()));
            frame.submap = 0;
            frame.pose.world_from_camera.translation_m[0] = f64::NAN;
            bad.push(AlignRecord::Frame(frame));
        }
    }
    drop(run);
    let whole = std::fs::read(&journal).unwrap();
    for record in [bad[0].clone(), bad[1].clone()] {
        std::fs::write(&journal, &whole).unwrap();
        let wait = std::time::Duration::ZERO;
        let (mut writer, _) = Journal::open(&journal, ALIGN_JOURNAL, wait, |_| Ok(())).unwrap();
        writer.append(&record, false).unwrap();
        let _ = std::fs::remove_dir_all(&to);
        let mut replica = Replica::open(&to, "a", identity(&from), CopyForm::Whole).unwrap();
        let pulled = visit(&mut Faulty::new(&from, 1, 0), &mut replica);
        assert!(pulled.refused.iter().any(|(what, _)| *what == PieceRefusal::Nonsense), "{pulled:?}");
        assert_eq!(replica.align_bytes(), whole.len() as u64);
    }
}

#[test]
fn a_request_that_is_nonsense_is_refused_in_words() {
    let dir = tempfile::tempdir().unwrap();
    let mut run = GrowingRun::begin(dir.path(), "run", 1);
    (0..10).for_each(|_| run.grow());
    let mut served = Served::open(dir.path()).unwrap();
    let file = tessera_fleet::wire::request::Growing::Align;
    let identity = identity(dir.path());
    let mut answer = |request: Request| {
        let mut pieces = Vec::new();
        served.answer(&request, &mut |piece| {
            pieces.push(piece);
            true
        });
        pieces
    };
    let ask = |identity, from, checksum| Request::Bytes { file, identity, from, checksum, max: 1 };
    for request in
        [ask(identity, 1, 0), ask(identity, u64::MAX, 0), ask(identity, 32, 1), ask(identity ^ 1, 0, 0)]
    {
        let pieces = answer(request.clone());
        assert_eq!(pieces.len(), 1, "{request:?}");
        assert_eq!(pieces[0].kind, PieceKind::Refused, "{request:?}");
    }
    let pieces = answer(ask(identity, 0, 0));
    assert_eq!(pieces.last().map(|piece| piece.kind), Some(PieceKind::End));
}

#[test]
fn what_is_cut_off_a_damaged_copy_is_set_aside_first() {
    let dir = tempfile::tempdir().unwrap();
    let (from, to) = (dir.path().join("run"), dir.path().join("copy"));
    let mut run = GrowingRun::begin(&from, "run", 1);
    (0..30).for_each(|_| run.grow());
    drop(run);
    let open = || Replica::open(&to, "a", identity(&from), CopyForm::Whole).unwrap();
    visit(&mut Faulty::new(&from, 1, 0), &mut open());
    // Behind its first page the store has the first surface.
    for (name, first) in [("align.journal", 1000), ("keyframes.store", 4100)] {
        let path = to.join(name);
        let whole = std::fs::read(&path).unwrap();
        let mut damaged = whole.clone();
        damaged[first..first + 4].iter_mut().for_each(|byte| *byte ^= 0x55);
        std::fs::write(&path, &damaged).unwrap();
        let mut replica = open();
        assert!(std::fs::read(&path).unwrap().len() < whole.len(), "{name} was not cut");
        let aside = to.join(format!("{name}.damaged-1"));
        assert_eq!(std::fs::read(&aside).unwrap(), damaged, "{name} is not set aside");
        visit(&mut Faulty::new(&from, 1, 0), &mut replica);
        assert_eq!(std::fs::read(&path).unwrap(), whole, "{name} did not come again");
        // A torn end, as a death leaves it, is no damage.
        std::fs::write(&path, &whole[..whole.len() - 3]).unwrap();
        drop(open());
        assert!(!to.join(format!("{name}.damaged-2")).exists(), "{name}: a torn end is set aside");
        visit(&mut Faulty::new(&from, 1, 0), &mut open());
    }
}
