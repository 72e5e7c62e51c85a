//! A run that leaves its optimisations to the base of a fleet: without one it goes on as ever, and an answer
//! is used only where it fits. The base itself is in `fleet/tests/fleet/corrections.rs`.

use crate::common::{Run, room};
use std::process::Child;
use std::time::{Duration, Instant};
use tessera_journal::Follower;
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, Context, Correction, KeyframeSurfaces, Optimiser, PairChanges};
use tessera_stage::{
    ALIGN_JOURNAL, BaseAnswer, BaseContactWriter, MAX_ANSWER_BYTES, OPTIMISE_JOURNAL, RunFile, RunFiles,
    StoredKeyframes, identity_of,
};

const ASKING: [&str; 2] = ["--set", "run.base_wait_s=3600"];

fn alone() -> Run {
    let run = room();
    assert!(run.finish().success());
    run
}

fn summary(run: &Run) -> serde_json::Value {
    serde_json::from_slice(&run.output("summary.json")).unwrap()
}

#[test]
fn a_run_that_asks_a_base_needs_none() {
    let (alone, run) = (alone(), room().with(&["--optimise", "remote"]));
    assert!(run.finish().success());
    let config = String::from_utf8(run.output("config.toml")).unwrap();
    assert!(config.lines().any(|line| line == "base_wait_s = 5.0"), "{config}");
    run.assert_same_bytes(&alone, "no base is there");
    assert_eq!(run.output("optimise.journal"), alone.output("optimise.journal"));
    assert_eq!(summary(&run)["corrections_from_base"], 0);
    assert!(summary(&alone)["corrections_from_base"].is_null());
}

/// What an uplink and a base do, in a run directory.
struct StandIn {
    files: RunFiles,
    contact: BaseContactWriter,
    identity: u64,
}

impl StandIn {
    /// Is there from the beginning of the run on.
    fn of(run: &Run, child: &mut Child) -> Self {
        let files = RunFiles::new(&run.out());
        let mut found = Self { files, contact: BaseContactWriter::default(), identity: 0 };
        found.wait_for("the run", child, |files| files.run_file().is_file());
        found.identity = identity_of(&std::fs::read(found.files.run_file()).unwrap());
        found
    }

    /// Stays in contact until something holds.
    fn wait_for(&mut self, what: &str, child: &mut Child, holds: impl Fn(&RunFiles) -> bool) {
        let deadline = Instant::now() + Duration::from_secs(300);
        while !holds(&self.files) {
            assert!(Instant::now() < deadline, "waited in vain for {what}");
            assert!(child.try_wait().unwrap().is_none(), "the run ended before {what}");
            if self.files.run_file().is_file() {
                self.contact.heard(&self.files).unwrap();
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Replaces the answer as an uplink does.
    fn put(&self, bytes: &[u8]) {
        let beside = self.files.dir.join(".base.answer.new");
        std::fs::write(&beside, bytes).unwrap();
        std::fs::rename(beside, self.files.base_answer()).unwrap();
    }

    fn bytes(&self, correction: &Correction) -> Vec<u8> {
        bytes_for(self.identity, correction)
    }

    /// The answer to the final request, as a base would compute it for this run alone; `None` before it.
    fn answer(&self) -> Option<Correction> {
        let text = std::fs::read_to_string(self.files.config()).unwrap();
        let settings = Settings::from_toml(&text, "config.toml").unwrap();
        let run = RunFile::read(&self.files).unwrap();
        let context = Context::new(&run.camera, &settings.surface, &settings.registration, &settings.mapping);
        let mut optimiser = Optimiser::new(context);
        let mut surfaces = StoredKeyframes::open(&self.files.store(), run.layout(&settings).grid).unwrap();
        let mut journal = Follower::open(&self.files.align_journal(), ALIGN_JOURNAL).unwrap();
        let mut records = Vec::new();
        while let Some(record) = journal.next().unwrap() {
            surfaces.take(&record).unwrap();
            optimiser.apply(&record);
            records.push(record);
        }
        let request = optimiser.next_request().filter(|request| request.is_final)?;
        let surfaces: &dyn KeyframeSurfaces = &surfaces;
        let correction = optimiser.solve(&request, surfaces, &records.as_slice(), &mut || ()).unwrap();
        let correction = correction.into_correction();
        Some(Correction { frames: Vec::new(), ..correction })
    }
}

/// An answer to the final request, as it stands in its file.
fn bytes_for(identity: u64, correction: &Correction) -> Vec<u8> {
    let changes = PairChanges::default();
    BaseAnswer { identity, correction: correction.clone(), changes }.to_bytes().unwrap()
}

#[test]
fn an_answer_is_used_where_it_fits_and_refused_in_words_where_not() {
    let (alone, run) = (alone(), room().with(&ASKING));
    let mut child = run.start();
    let mut base = StandIn::of(&run, &mut child);
    base.wait_for("the end", &mut child, |files| {
        let Ok(mut journal) = Follower::open(&files.align_journal(), ALIGN_JOURNAL) else {
            return false;
        };
        let mut records = std::iter::from_fn(|| journal.next().ok().flatten());
        records.any(|record| matches!(record, AlignRecord::End { .. }))
    });
    let answer = base.answer().unwrap();
    let changed = |change: &dyn Fn(&mut Correction)| {
        let mut correction = answer.clone();
        change(&mut correction);
        base.bytes(&correction)
    };
    let other_run = bytes_for(1, &answer);
    let forged = [
        (b"nonsense of some length, and no answer".to_vec(), "not a Tessera answer"),
        (vec![0; MAX_ANSWER_BYTES + 1], "expected at most"),
        (other_run, "an answer to run"),
        (changed(&|a| a.request += 1), "an answer to request"),
        (changed(&|a| a.input_hash ^= 1), "other keyframes"),
        (changed(&|a| a.keyframes[1].id = 9), "keyframes, by id"),
        (changed(&|a| a.keyframes[1].world_from_camera.translation_m[0] = f64::NAN), "cannot have"),
        (changed(&|a| a.keyframes[0].world_from_camera.translation_m[0] += 0.1), "keyframe 0 moves"),
    ];
    for (n_before, (bytes, words)) in forged.into_iter().enumerate() {
        base.put(&bytes);
        let said = format!("n_refused={}", n_before + 1);
        base.wait_for(words, &mut child, |_| run.log().contains(&said));
        let log = run.log();
        assert!(log.lines().any(|line| line.contains(&said) && line.contains(words)), "{words}: {log}");
    }
    let right = base.bytes(&answer);
    base.put(&right);
    assert!(child.wait().unwrap().success(), "{}", run.log());
    assert!(run.log().contains("answered by the base"), "{}", run.log());
    run.assert_same_bytes(&alone, "the answer has the bits of the run's own");
    assert_eq!(summary(&run)["corrections_from_base"], 1);
    let path = run.out().join("optimise.journal");
    let mut journal = Follower::open(&path, OPTIMISE_JOURNAL).unwrap();
    let records = std::iter::from_fn(|| journal.next().unwrap());
    assert_eq!(records.filter(|record| record.is_from_base()).count(), 1);
}
