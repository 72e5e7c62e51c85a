//! A kind of records whose form has changed twice.

use super::*;
use crate::{
    Ending, Follower, Journal, JournalError, OnDamage, Opening, decode, inspect, sealed_record,
    unsealed_record,
};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;

/// Its first form: words.
#[derive(Serialize, Deserialize)]
struct FormOne(String);

/// Its second form, with a length that is now a number of metres.
#[derive(Debug, Serialize, Deserialize)]
struct FormTwo {
    word: String,
    length_mm: u32,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct FormThree {
    length_m: Option<f64>,
    word: String,
}

const ONE: RecordKind<FormOne> = RecordKind::only("test", 1);
const TWO: RecordKind<FormTwo> = RecordKind::only("test", 2);
const THREE: RecordKind<FormThree> = RecordKind {
    name: "test",
    version: 3,
    oldest: 1,
    earlier: |version, payload| match version {
        1 => Ok(FormThree { length_m: None, word: decode::<FormOne>(payload)?.0 }),
        _ => from_two(payload),
    },
};

fn from_two(payload: &[u8]) -> Result<FormThree, String> {
    let FormTwo { word, length_mm } = decode(payload)?;
    if length_mm > 1_000_000 {
        return Err(format!("a length of {length_mm} mm, expected at most 1 km"));
    }
    Ok(FormThree { length_m: Some(f64::from(length_mm) / 1000.0), word })
}

fn append<T: Serialize + DeserializeOwned>(path: &Path, kind: RecordKind<T>, record: &T) {
    let (mut journal, _) = Journal::open(path, kind, Duration::ZERO, |_| Ok(())).unwrap();
    journal.append(record, false).unwrap();
}

fn three(length_m: Option<f64>, word: &str) -> FormThree {
    FormThree { length_m, word: word.into() }
}

#[test]
fn a_journal_of_three_versions_is_read_followed_inspected_and_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    append(&path, ONE, &FormOne("a".into()));
    // The second program reads what the first wrote, as the third does.
    let two = RecordKind {
        oldest: 1,
        earlier: |_, payload| Ok(FormTwo { word: decode::<FormOne>(payload)?.0, length_mm: 0 }),
        ..TWO
    };
    append(&path, two, &FormTwo { word: "b".into(), length_mm: 1250 });
    append(&path, THREE, &three(Some(0.5), "c"));
    let expected = [three(None, "a"), three(Some(1.25), "b"), three(Some(0.5), "c")];

    let mut read = Vec::new();
    let take = |record| {
        read.push(record);
        Ok(())
    };
    let (journal, recovered) = Journal::open(&path, THREE, Duration::ZERO, take).unwrap();
    assert_eq!((recovered.n_records, recovered.dropped_bytes), (3, 0));
    assert_eq!(read, expected);
    assert!(journal.mark().fits(&path, "test").unwrap());
    let mut follower = Follower::open(&path, THREE).unwrap();
    for record in expected {
        assert_eq!(follower.next().unwrap(), Some(record));
    }
    let found = inspect(&path, THREE, |_| Ok(())).unwrap();
    assert_eq!((found.n_records, found.ending), (3, Ending::Whole));
}

#[test]
fn a_record_of_a_newer_program_is_no_damage_and_is_never_cut() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    append(&path, TWO, &FormTwo { word: "b".into(), length_mm: 1 });
    append(&path, THREE, &three(None, "c"));
    let whole = std::fs::read(&path).unwrap();
    let words = "has format version 3, this program reads version 2";
    for on_damage in [OnDamage::Refuse, OnDamage::SetAside] {
        let opening = Opening { on_damage, ..Opening::new(Duration::ZERO) };
        let error = Journal::open_as(&path, TWO, opening, |_| Ok(())).unwrap_err();
        assert!(matches!(error, JournalError::Version { found: 3, .. }) && error.to_string().contains(words));
    }
    let mut follower = Follower::open(&path, TWO).unwrap();
    assert!(follower.next().unwrap().is_some());
    assert!(follower.next().err().unwrap().to_string().contains(words));
    assert!(inspect(&path, TWO, |_| Ok(())).unwrap_err().to_string().contains(words));
    assert_eq!(std::fs::read(&path).unwrap(), whole, "nothing is cut and nothing is set aside");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn what_an_earlier_form_refuses_is_damage_like_any_other() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    append(&path, TWO, &FormTwo { word: "b".into(), length_mm: 2_000_000 });
    let error = Journal::open(&path, THREE, Duration::ZERO, |_| Ok(())).unwrap_err();
    assert!(matches!(error, JournalError::Damaged { n_lost: 1, .. }), "{error}");
    assert!(error.to_string().contains("expected at most 1 km"), "{error}");
}

#[test]
fn a_sealed_record_of_an_earlier_version_is_read_and_one_of_a_newer_is_refused() {
    let two = sealed_record(Path::new("a"), TWO, &FormTwo { word: "b".into(), length_mm: 40 }).unwrap();
    assert_eq!(unsealed_record(THREE, &two), Ok(three(Some(0.04), "b")));
    let newest = sealed_record(Path::new("a"), THREE, &three(None, "c")).unwrap();
    let words = unsealed_record(TWO, &newest).err().unwrap();
    assert_eq!(words, "a record of version 3, this program reads version 2");
}
