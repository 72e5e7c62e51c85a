//! Zip files as other programs write them.

use super::*;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use std::io::Write;

/// A zip file of some files, each stored or deflated; with `is_64` all sizes are 64-bit.
pub(in crate::folder) fn zipped(files: &[(&str, &[u8])], is_deflated: bool, is_64: bool) -> Vec<u8> {
    let (mut zip, mut list) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let mut crc = Crc::new();
        crc.update(bytes);
        let mut deflated = DeflateEncoder::new(Vec::new(), Compression::fast());
        deflated.write_all(bytes).unwrap();
        let stored = if is_deflated { deflated.finish().unwrap() } else { bytes.to_vec() };
        let sizes = [bytes.len() as u64, stored.len() as u64, zip.len() as u64];
        let mut head = [20u16, 0, if is_deflated { 8 } else { 0 }, 0, 0].map(u16::to_le_bytes).concat();
        head.extend(crc.sum().to_le_bytes());
        let n_in_32 = |n: u64| if is_64 { u32::MAX } else { n as u32 }.to_le_bytes();
        head.extend([n_in_32(sizes[1]), n_in_32(sizes[0])].concat());
        head.extend((name.len() as u16).to_le_bytes());
        let more = if is_64 {
            [&[9, 9, 1, 0, 7, 1, 0, 24, 0][..], &sizes.map(u64::to_le_bytes).concat()].concat()
        } else {
            Vec::new()
        };
        list.extend([ENTRY, &[20, 0], &head, &(more.len() as u16).to_le_bytes(), &[0; 10]].concat());
        list.extend([&n_in_32(sizes[2])[..], name.as_bytes(), &more].concat());
        zip.extend([FILE, &head, &0u16.to_le_bytes(), name.as_bytes(), &stored].concat());
    }
    let (at, n) = (zip.len() as u64, list.len() as u64);
    zip.extend(&list);
    if is_64 {
        let end = zip.len() as u64;
        zip.extend([END_64, &[0; 36], &n.to_le_bytes(), &at.to_le_bytes()].concat());
        zip.extend([LOCATOR_64, &[0; 4], &end.to_le_bytes(), &[1, 0, 0, 0]].concat());
        zip.extend([END, &[0; 8], &[0xff; 8], &[0; 2]].concat());
    } else {
        zip.extend([END, &[0; 8], &(n as u32).to_le_bytes(), &(at as u32).to_le_bytes(), &[2, 0]].concat());
        zip.extend(b"ok");
    }
    zip
}

fn open(bytes: &[u8]) -> Result<ZipFile, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.zip");
    std::fs::write(&path, bytes).unwrap();
    ZipFile::open(&path).map_err(|error| error.to_string())
}

#[test]
fn files_are_found_by_name_stored_or_deflated_with_or_without_64_bits() {
    let large = [7; 5000];
    for (is_deflated, is_64) in [(false, false), (true, false), (false, true), (true, true)] {
        let zip = open(&zipped(&[("b/2", &large), ("a", b"x"), ("b/1", b"")], is_deflated, is_64)).unwrap();
        assert_eq!(zip.read(Path::new("b/2")).unwrap(), large);
        assert_eq!(
            (zip.read(Path::new("a")).unwrap(), zip.read(Path::new("b/1")).unwrap()),
            (vec![b'x'], vec![])
        );
        assert_eq!(
            (zip.names("b"), zip.names("")),
            (vec!["1".to_owned(), "2".to_owned()], vec!["a".to_owned()])
        );
        assert!(zip.is_file(Path::new("a")) && !zip.is_file(Path::new("b")));
        assert!(matches!(zip.read(Path::new("c")), Err(ImageError::Io(_))));
    }
    // A folder that was zipped from outside.
    let zip =
        open(&zipped(&[("my scan/", b""), ("my scan/a", b"x"), ("my scan/b/1", b"y")], true, false)).unwrap();
    assert_eq!((zip.names(""), zip.read(Path::new("b/1")).unwrap()), (vec!["a".to_owned()], vec![b'y']));
}

#[test]
fn damage_is_named() {
    let whole = zipped(&[("a", &[7; 500]), ("b", &[8; 500])], false, false);
    for (bytes, expected) in [
        (&whole[..whole.len() / 2], "without a whole list of files"),
        (&whole[..0], "0 bytes without a whole list"),
    ] {
        let message = open(bytes).unwrap_err();
        assert!(message.contains(expected) && message.contains("a.zip"), "{message}");
    }
    let read = |change: fn(&mut Vec<u8>)| {
        let mut bytes = whole.clone();
        change(&mut bytes);
        open(&bytes).unwrap().read(Path::new("a")).unwrap_err().to_string()
    };
    let list = 2 * (FILE_BYTES + 1 + 500);
    assert_eq!(list, 1062);
    for (message, expected) in [
        (read(|bytes| bytes[40] = 1), "another checksum"),
        (read(|bytes| bytes[1] = b'Q'), "no file begins at byte 0"),
        (read(|bytes| bytes[1062 + 8] = 1), "encrypted"),
        (read(|bytes| bytes[1062 + 10] = 12), "compression 12, expected 0 (stored) or 8"),
        (read(|bytes| bytes[1062 + 10] = 8), "expected a whole file in a zip file"),
        (read(|bytes| bytes[1062 + 22] = 1), "beyond the end of the file"),
    ] {
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn changed_files_are_read_or_refused() {
    let whole = zipped(&[("a", &[7; 500]), ("b", &[8; 500])], true, true);
    let mut n_refused = 0;
    for at in 0..whole.len() {
        for change in [1, 0x80, 0xff] {
            let mut bytes = whole.clone();
            bytes[at] ^= change;
            match open(&bytes) {
                Ok(zip) => n_refused += usize::from(zip.read(Path::new("a")).is_err()),
                Err(_) => n_refused += 1,
            }
        }
    }
    assert!(n_refused > whole.len(), "{n_refused} of {} refused", 3 * whole.len());
}
