//! The fuzz targets on their corpora: what fuzzing once found stays fixed, with any compiler.
//!
//! Beside each input come some changed ones, the same in every run; `TESSERA_TEST_MUTATIONS` sets
//! how many (100 by default).

#[path = "../../../../fuzz/targets.rs"]
#[allow(unreachable_pub, reason = "the executables of fuzz/ use it too")]
mod targets;

use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_journal::Journal;
use tessera_numerics::SplitMix64;
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Mutations that a seed repeats.
struct Random(SplitMix64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        (self.0.next_u64() % n.max(1) as u64) as usize
    }

    /// The input with a few places changed; its first byte, which chooses the kind, mostly kept.
    fn mutate(&mut self, input: &[u8]) -> Vec<u8> {
        let mut bytes = input.to_vec();
        for _ in 0..1 + self.below(4) {
            let at = 1 + self.below(bytes.len());
            let at = at.min(bytes.len());
            match self.below(5) {
                0 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
                1 if at < bytes.len() => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][self.below(5)],
                // The largest number, as a journal writes it.
                2 if at < bytes.len() => {
                    bytes.splice(at..=at, [0xfd, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]);
                }
                3 => bytes.truncate(at),
                _ => {
                    let from = self.below(bytes.len());
                    let part = bytes[from..bytes.len().min(from + 1 + self.below(16))].to_vec();
                    bytes.splice(at..at, part);
                }
            }
        }
        bytes
    }
}

/// Replays a corpus, each input whole, cut at some places, and changed.
fn replay(name: &str) {
    let (_, target) = targets::TARGETS.iter().find(|(other, _)| *other == name).unwrap();
    let inputs = files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(name));
    assert!(!inputs.is_empty(), "{name} has no corpus");
    let asked = std::env::var("TESSERA_TEST_MUTATIONS").ok();
    let n_mutations: u32 = asked.and_then(|n| n.parse().ok()).unwrap_or(100);
    for path in inputs {
        let bytes = std::fs::read(&path).unwrap();
        // A panic below names the input.
        eprintln!("{}", path.display());
        target(&bytes);
        (0..8).for_each(|eighth| target(&bytes[..bytes.len() * eighth / 8]));
        let mut random = Random(SplitMix64::new(bytes.len() as u64));
        for k in 0..n_mutations {
            let changed = random.mutate(&bytes);
            if let Err(panic) = std::panic::catch_unwind(|| target(&changed)) {
                let kept = std::env::temp_dir().join(format!("tessera-fuzz-{name}-{k}"));
                let _ = std::fs::write(&kept, &changed);
                eprintln!("mutation {k} is kept in {}", kept.display());
                std::panic::resume_unwind(panic);
            }
        }
    }
}

#[test]
fn every_target_has_a_corpus_and_an_executable() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let mut names: Vec<&str> = targets::TARGETS.iter().map(|(name, _)| *name).collect();
    names.sort_unstable();
    let stems = |folder: &str| -> Vec<String> {
        let stem = |path: PathBuf| path.file_stem().unwrap().to_string_lossy().into_owned();
        files(&fuzz.join(folder)).into_iter().map(stem).collect()
    };
    assert_eq!(stems("corpus"), names);
    assert_eq!(stems("fuzz_targets"), names);
    let script = std::fs::read_to_string(fuzz.join("../scripts/fuzz.sh")).unwrap();
    names.iter().for_each(|name| assert!(script.contains(name), "scripts/fuzz.sh does not run {name}"));
}

#[test]
fn lists() {
    replay("lists");
}

#[test]
fn camera() {
    replay("camera");
}

#[test]
fn configuration() {
    replay("configuration");
}

#[test]
fn images() {
    replay("images");
}

#[test]
fn journal() {
    replay("journal");
}

#[test]
fn messages() {
    replay("messages");
}

#[test]
fn recording() {
    replay("recording");
}

/// Payloads of a journal's records.
fn payloads(journal: &[u8]) -> Vec<&[u8]> {
    let mut rest = &journal[32..];
    let mut payloads = Vec::new();
    while let Some((header, behind)) = rest.split_at_checked(12) {
        let len = u32::from_le_bytes(header[..4].try_into().unwrap()) as usize;
        payloads.push(&behind[..len]);
        rest = &behind[len..];
    }
    payloads
}

/// Writes real records into the corpus: those of a run, and of one that starts in its map.
fn renew(corpus: &Path) {
    let first = crate::common::room();
    assert!(first.finish().success());
    let map = first.out();
    let second = crate::common::room().frames(20).with(&["--map", map.to_str().unwrap()]);
    // Whether it finds itself there does not matter: the map is its first record.
    second.finish();
    let write = |name: &str, which: u8, bytes: &[u8]| {
        std::fs::write(corpus.join(name), [&[which], bytes].concat()).unwrap();
    };
    let align = first.output("align.journal");
    let records = payloads(&align);
    let of_kind = |kind: u8| records.iter().find(|record| record[0] == kind).unwrap();
    write("first_frame", 1, records[0]);
    write("frame", 1, records[5]);
    write("correction", 1, of_kind(2));
    write("end", 1, of_kind(3));
    let whole: usize = records[..3].iter().map(|record| 12 + record.len()).sum();
    write("whole_prefix", 0, &align[..32 + whole + 100]);
    write("optimise", 2, payloads(&first.output("optimise.journal"))[0]);
    write("map", 1, payloads(&second.output("align.journal"))[0]);
}

/// With another layout of records its inputs would end at their first bytes: `TESSERA_UPDATE=1`
/// makes them anew.
#[test]
fn the_corpus_of_journals_holds_records_of_this_version() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/journal");
    if std::env::var_os("TESSERA_UPDATE").is_some() {
        renew(&corpus);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("journal");
    for name in ["first_frame", "frame", "correction", "end", "map", "optimise", "whole_prefix"] {
        let bytes = std::fs::read(corpus.join(name)).unwrap();
        let _ = std::fs::remove_file(&path);
        let n_records = match bytes[0] {
            0 => {
                std::fs::write(&path, &bytes[1..]).unwrap();
                let opened = Journal::open(&path, ALIGN_JOURNAL, Duration::ZERO, |_| Ok(()));
                opened.unwrap().1.n_records
            }
            1 => {
                targets::sealed(&path, ALIGN_JOURNAL, &bytes[1..]);
                let opened = Journal::open(&path, ALIGN_JOURNAL, Duration::ZERO, |_| Ok(()));
                opened.unwrap().1.n_records
            }
            _ => {
                targets::sealed(&path, OPTIMISE_JOURNAL, &bytes[1..]);
                let opened = Journal::open(&path, OPTIMISE_JOURNAL, Duration::ZERO, |_| Ok(()));
                opened.unwrap().1.n_records
            }
        };
        assert!(n_records > 0, "{name} is of another version");
    }
}
