//! Power cuts: what was synced survives them, whatever becomes of the writes after that.
//!
//! The writes and syncs of a live run are written down by a library that is preloaded into it. A power cut
//! is then replayed at many places: what was synced before it is there, every other page by itself there or
//! not, as a disk that orders its writes as it likes leaves it.

use crate::common::{Run, room};
use crate::requirements::missing;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use tessera_numerics::SplitMix64;

/// Places at which the power is cut; `TESSERA_POWER_CUTS` for more.
const CUTS: usize = 12;
const PAGE: usize = 4096;

/// Compiles the library; `None`, with the reason printed, without a compiler.
fn shim(folder: &Path) -> Option<PathBuf> {
    let source =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/end_to_end/promises/durability/power_shim.c");
    let library = folder.join("power_shim.so");
    let compiled = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"])
        .args([&library, &source])
        .arg("-ldl")
        .status();
    match compiled {
        Ok(status) => {
            assert!(status.success());
            Some(library)
        }
        Err(error) => {
            missing("cc", format_args!("no cc: {error}"));
            None
        }
    }
}

#[derive(Clone, Debug)]
enum Event {
    Write { offset: usize, bytes: Vec<u8> },
    Sync,
    Truncate { len: usize },
}

/// Writes and syncs in their order, each with the name of its file.
fn events(log: &Path) -> Vec<(String, Event)> {
    let bytes = std::fs::read(log).unwrap();
    let mut rest = &bytes[..];
    let mut events = Vec::new();
    while let Some((what, after)) = rest.split_first() {
        let number = |k: usize| u64::from_le_bytes(after[8 * k..8 * k + 8].try_into().unwrap()) as usize;
        let (path_len, offset, len) = (number(0), number(1), number(2));
        let (path, behind) = after[24..].split_at(path_len);
        let name = Path::new(std::str::from_utf8(path).unwrap()).file_name().unwrap();
        let (bytes, behind) = behind.split_at(len);
        let event = match what {
            b'w' => Event::Write { offset, bytes: bytes.to_vec() },
            b's' => Event::Sync,
            b't' => Event::Truncate { len: offset },
            other => panic!("{other}"),
        };
        events.push((name.to_str().unwrap().to_owned(), event));
        rest = behind;
    }
    events
}

/// A file on a disk that keeps what was synced, and of the rest what it likes.
#[derive(Clone, Default)]
struct OnDisk {
    /// As it was when it was last synced.
    synced: Vec<u8>,
    /// As the processes see it.
    cached: Vec<u8>,
}

impl OnDisk {
    fn apply(&mut self, event: &Event) {
        match event {
            Event::Write { offset, bytes } => {
                let end = offset + bytes.len();
                self.cached.resize(self.cached.len().max(end), 0);
                self.cached[*offset..end].copy_from_slice(bytes);
            }
            Event::Sync => self.synced.clone_from(&self.cached),
            Event::Truncate { len } => self.cached.resize(*len, 0),
        }
    }

    /// What a power cut leaves: each page that was not synced by itself, or those up to some place; the
    /// file as long as it was synced, as it was seen, or something in between.
    fn after_cut(&self, random: &mut SplitMix64) -> Vec<u8> {
        let (old, new) = (&self.synced, &self.cached);
        let is_prefix = random.below(2) == 0;
        let n_pages = new.len().max(old.len()).div_ceil(PAGE);
        let kept = random.below(n_pages + 1);
        let mut left = vec![0; n_pages * PAGE];
        for page in 0..n_pages {
            let is_new = if is_prefix { page < kept } else { random.below(2) == 0 };
            let from = if is_new { new } else { old };
            let range = page * PAGE..((page + 1) * PAGE).min(from.len());
            if let Some(bytes) = from.get(range.clone()) {
                left[range].copy_from_slice(bytes);
            }
        }
        let (shorter, longer) = (new.len().min(old.len()), new.len().max(old.len()));
        let len = match random.below(3) {
            0 => longer,
            1 => old.len(),
            _ => shorter + random.below(longer - shorter + 1),
        };
        left.resize(len, 0);
        left
    }
}

fn begins_with(file: &[u8], synced: &[u8]) -> bool {
    file.get(..synced.len()) == Some(synced)
}

#[test]
fn a_power_cut_takes_nothing_that_was_synced() {
    let folder = tempfile::tempdir().unwrap();
    let Some(library) = shim(folder.path()) else { return };
    let log = folder.path().join("writes");
    let many = ["--set", "mapping.keyframe.translation_m=0.05", "--set", "mapping.keyframe.rotation_deg=4"];
    let run = room().frames(40).with(&["--live"]).with(&many);
    let status = run.command().env("LD_PRELOAD", &library).env("TESSERA_TEST_WRITES", &log).status().unwrap();
    assert!(status.success(), "{}", run.log());
    let events = events(&log);
    let n_syncs = events.iter().filter(|(_, event)| matches!(event, Event::Sync)).count();
    assert!(n_syncs > 20, "{n_syncs} syncs");
    let files = [("run.json", run.output("run.json")), ("config.toml", run.output("config.toml"))];
    // The supervisor's own syncs, of which the optimiser's journal is the last: before them the run has no run.json.
    let is_last =
        |(name, event): &(String, Event)| name == "optimise.journal" && matches!(event, Event::Sync);
    let begin = 1 + events.iter().position(is_last).unwrap();
    let n_cuts = std::env::var("TESSERA_POWER_CUTS").map_or(CUTS, |n| n.parse().unwrap());
    let (mut n_torn, mut n_records) = (0, 0);
    for cut in 0..n_cuts {
        let mut random = SplitMix64::new(cut as u64);
        let at = begin + random.below(events.len() - begin);
        let mut disk: BTreeMap<&str, OnDisk> = BTreeMap::new();
        for (name, event) in &events[..at] {
            disk.entry(name).or_default().apply(event);
        }
        let after = Run::in_folder(&run);
        std::fs::create_dir(after.out()).unwrap();
        for (name, bytes) in &files {
            std::fs::write(after.out().join(name), bytes).unwrap();
        }
        for (name, file) in &disk {
            let mut bytes = file.after_cut(&mut random);
            if name.ends_with(".synced") {
                // Never synced itself, and the machine has started again since.
                let text = String::from_utf8_lossy(&bytes).into_owned();
                bytes = text.chars().map(|c| if c == '-' { '0' } else { c }).collect::<String>().into_bytes();
            }
            std::fs::write(after.out().join(name), bytes).unwrap();
        }
        let output = after.tessera(&["resume", "--quiet"]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "cut {cut}, behind event {at}: {text}\n{}", after.log());
        for name in ["align.journal", "optimise.journal"] {
            let (synced, now) = (&disk[name].synced, after.output(name));
            assert!(begins_with(&now, synced), "cut {cut}, behind event {at}: {name} lost what was synced");
            n_records += usize::from(now.len() > synced.len());
        }
        n_torn += usize::from(after.log().contains("bytes behind them are dropped"));
        let verified = after.tessera(&["verify"]);
        assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
    }
    assert!(n_records > 0);
    eprintln!("{n_cuts} power cuts among {} writes and syncs: {n_torn} left a torn end", events.len());
}

#[test]
fn a_sync_that_fails_ends_the_run_in_words_and_resume_goes_on() {
    let run =
        room().frames(40).with(&["--set", "flow.fsync=keyframe"]).with_faults("align=computed:12:sync-fails");
    let output = run.command().output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{text}");
    assert!(text.contains("was not forced to disk") && text.contains("Input/output error"), "{text}");
    assert_eq!(run.n_deaths(), 1, "it is not tried again\n{}", run.log());
    let resumed = run.tessera(&["resume", "--quiet"]);
    assert!(resumed.status.success(), "{}", run.log());
    let undisturbed = room().frames(40);
    assert!(undisturbed.finish().success());
    run.assert_same_bytes(&undisturbed, "after a sync that failed");
}

#[test]
fn a_live_run_is_synced_and_one_of_a_recording_is_not() {
    for (arguments, is_synced) in [(&["--live"][..], true), (&[], false)] {
        let run = room().frames(20).with(arguments);
        assert!(run.finish().success());
        assert_eq!(run.out().join("align.synced").exists(), is_synced, "{arguments:?}");
    }
}
