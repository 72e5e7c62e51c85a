//! Journals that are torn, damaged, shortened or absent.

use super::*;
use crate::Follower;

type Record = (u64, Vec<f64>, String);

const TEST: RecordKind<Record> = RecordKind::only("test", 7);

fn record(n: u64) -> Record {
    (n, (0..n % 7).map(|k| k as f64 * 0.1).collect(), "word ".repeat((n % 90) as usize))
}

fn written(path: &Path, n: u64) {
    let (mut journal, _) = Journal::<Record>::open(path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
    for k in 0..n {
        journal.append(&record(k), false).unwrap();
    }
}

fn read(path: &Path) -> (Vec<Record>, Recovered) {
    let mut records = Vec::new();
    let (_, recovered) = Journal::<Record>::open(path, TEST, Duration::ZERO, |r| {
        records.push(r);
        Ok(())
    })
    .unwrap();
    (records, recovered)
}

#[test]
fn a_file_cut_anywhere_gives_a_prefix_and_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    written(&path, 40);
    let whole = std::fs::read(&path).unwrap();
    let mut seen = 0;
    for cut in 0..=whole.len() {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let (records, recovered) = read(&path);
        assert!(records.iter().enumerate().all(|(k, r)| *r == record(k as u64)), "cut at {cut}");
        assert!(records.len() >= seen);
        seen = records.len();
        let kept = std::fs::metadata(&path).unwrap().len();
        if cut >= FILE_HEADER_BYTES {
            assert_eq!(kept + recovered.dropped_bytes, cut as u64);
        }
    }
    assert_eq!(seen, 40);
}

fn set_aside(path: &Path) -> (Vec<Record>, Recovered) {
    let mut records = Vec::new();
    let opening = Opening { on_damage: OnDamage::SetAside, ..Opening::new(Duration::ZERO) };
    let (_, recovered) = Journal::<Record>::open_as(path, TEST, opening, |r| {
        records.push(r);
        Ok(())
    })
    .unwrap();
    (records, recovered)
}

fn refusal(path: &Path) -> JournalError {
    Journal::<Record>::open(path, TEST, Duration::ZERO, |_| Ok(())).unwrap_err()
}

#[test]
fn a_zeroed_page_is_refused_and_nothing_is_cut() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    written(&path, 200);
    let whole = std::fs::read(&path).unwrap();
    let n_pages = whole.len() / 4096;
    assert!(n_pages > 5 && !whole.len().is_multiple_of(4096));
    for page in 0..n_pages {
        let mut bytes = whole.clone();
        bytes[page * 4096..(page + 1) * 4096].fill(0);
        std::fs::write(&path, &bytes).unwrap();
        let JournalError::Damaged { offset, n_before, n_lost, .. } = refusal(&path) else {
            panic!("page {page} is not called damage")
        };
        assert!(offset / 4096 <= page as u64 && n_lost > 0 && n_before + n_lost < 200, "page {page}");
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        let (records, recovered) = set_aside(&path);
        assert_eq!(records.len() as u64, n_before);
        assert!(records.iter().enumerate().all(|(k, r)| *r == record(k as u64)));
        let copy = recovered.set_aside.unwrap();
        assert_eq!(std::fs::read(copy).unwrap(), bytes);
        // Written again from there, the file has the same bytes as if nothing had happened.
        let (mut journal, _) = Journal::<Record>::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
        for k in n_before..200 {
            journal.append(&record(k), false).unwrap();
        }
        drop(journal);
        assert_eq!(std::fs::read(&path).unwrap(), whole);
    }
}

#[test]
fn a_flipped_bit_is_refused_but_in_the_last_record() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    written(&path, 8);
    let last = std::fs::metadata(&path).unwrap().len() as usize;
    written_from(&path, 8, 9);
    let whole = std::fs::read(&path).unwrap();
    for at in FILE_HEADER_BYTES..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        if at < last {
            let error = refusal(&path).to_string();
            assert!(error.contains("is damaged at byte") && error.contains("would be lost"), "{error}");
            assert_eq!(std::fs::read(&path).unwrap(), bytes, "byte {at}");
        } else {
            // No different from a record that was torn.
            assert_eq!(read(&path).0.len(), 8, "byte {at}");
        }
    }
}

fn written_from(path: &Path, from: u64, to: u64) {
    let (mut journal, _) = Journal::<Record>::open(path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
    (from..to).for_each(|k| journal.append(&record(k), false).unwrap());
}

#[test]
fn a_journal_that_was_begun_is_neither_absent_nor_empty() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    let begun = Opening { is_begun: true, ..Opening::new(Duration::ZERO) };
    let open = |opening| Journal::<Record>::open_as(&path, TEST, opening, |_| Ok(()));
    assert!(matches!(open(begun), Err(JournalError::Absent { .. })));
    assert!(!path.exists());
    for bytes in [&[][..], &[0; 10], &[0; 5000]] {
        std::fs::write(&path, bytes).unwrap();
        assert!(matches!(open(begun), Err(JournalError::Damaged { offset: 0, .. })));
        assert_eq!(std::fs::read(&path).unwrap(), bytes);
        let (_, recovered) = open(Opening { on_damage: OnDamage::SetAside, ..begun }).unwrap();
        assert_eq!((recovered.n_records, recovered.set_aside.is_some()), (0, !bytes.is_empty()));
    }
}

#[test]
fn a_refused_record_is_damage() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    written(&path, 9);
    let whole = std::fs::read(&path).unwrap();
    let refuse = |r: Record| if r.0 < 5 { Ok(()) } else { Err("its keyframe is gone".to_string()) };
    let error = Journal::open(&path, TEST, Duration::ZERO, refuse).unwrap_err();
    let JournalError::Damaged { n_before, n_lost, ref reason, .. } = error else { panic!("{error}") };
    assert_eq!((n_before, n_lost, reason.as_str()), (5, 4, "its keyframe is gone"));
    assert_eq!(std::fs::read(&path).unwrap(), whole);
    let opening = Opening { on_damage: OnDamage::SetAside, ..Opening::new(Duration::ZERO) };
    let (_, recovered) = Journal::open_as(&path, TEST, opening, refuse).unwrap();
    assert_eq!((recovered.n_records, recovered.reason.as_deref()), (5, Some("its keyframe is gone")));
    assert_eq!(read(&path).0.len(), 5);
}

#[test]
fn what_was_forced_to_disk_is_missed_where_the_file_is_shorter() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    let (mut journal, _) = Journal::<Record>::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
    (0..20).for_each(|k| journal.append(&record(k), k == 9).unwrap());
    drop(journal);
    let whole = std::fs::read(&path).unwrap();
    let synced = std::fs::read_to_string(path.with_extension("synced")).unwrap();
    let (len, boot) = synced.trim_end().split_once(' ').unwrap();
    let (len, boot) = (len.parse::<usize>().unwrap(), boot.to_owned());
    std::fs::write(&path, &whole[..len - 1]).unwrap();
    let error = refusal(&path).to_string();
    assert!(error.contains("bytes that were on disk are not there any more"), "{error}");
    std::fs::write(&path, &whole[..len + 1]).unwrap();
    assert_eq!(read(&path).0.len(), 10);
    // A hole behind that: damage in the boot that wrote it, what a power cut leaves in another one.
    let mut holed = whole.clone();
    holed[len..len + 30].fill(0);
    std::fs::write(&path, &holed).unwrap();
    assert!(matches!(refusal(&path), JournalError::Damaged { n_before: 10, .. }));
    let other = synced.replace(&boot, &"0".repeat(boot.len()));
    std::fs::write(path.with_extension("synced"), other).unwrap();
    let (records, recovered) = read(&path);
    assert_eq!(records.len(), 10);
    assert_eq!(std::fs::read(recovered.set_aside.unwrap()).unwrap(), holed);
}

#[test]
fn there_is_one_writer() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    let (held, _) = Journal::<Record>::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
    let second = Journal::<Record>::open(&path, TEST, Duration::ZERO, |_| Ok(()));
    let message = second.unwrap_err().to_string();
    assert!(message.contains("written by another process"), "{message}");
    drop(held);
    Journal::<Record>::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
}

#[test]
fn a_follower_sees_each_record_once_it_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("j");
    let (mut journal, _) = Journal::<Record>::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
    let mut follower = Follower::<Record>::open(&path, TEST).unwrap();
    assert_eq!(follower.next().unwrap(), None);
    for k in 0..30 {
        journal.append(&record(k), false).unwrap();
        assert_eq!(follower.next().unwrap(), Some(record(k)));
        assert_eq!(follower.next().unwrap(), None);
    }
    let whole = std::fs::read(&path).unwrap();
    journal.append(&record(30), false).unwrap();
    let longer = std::fs::read(&path).unwrap();
    // A record that arrives byte by byte is not seen before its last byte.
    for cut in whole.len()..longer.len() {
        std::fs::write(&path, &longer[..cut]).unwrap();
        assert_eq!(follower.next().unwrap(), None);
    }
    std::fs::write(&path, &longer).unwrap();
    assert_eq!(follower.next().unwrap(), Some(record(30)));
}
