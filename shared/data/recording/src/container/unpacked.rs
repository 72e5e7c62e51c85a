//! Files that a recorder compressed as a whole (rosbag2's `compression_mode: file`): they are read from place
//! to place, and so are unpacked into a file without a name, which goes with the process.

use crate::compression::decompress;
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Names that are tried: others may be taken by processes of before.
const TRIES: u64 = 100;

/// What a file of zstd holds.
///
/// # Errors
/// It is damaged, or the folder for temporary files has too little room.
pub(super) fn unpacked(file: &File) -> io::Result<File> {
    unpacked_in(file, &std::env::temp_dir())
}

fn unpacked_in(file: &File, folder: &Path) -> io::Result<File> {
    let wrong = |action: &str, error: &io::Error| {
        let reason = format!(
            "it is compressed as a whole; {action} {} (the variable TMPDIR gives another folder): {error}",
            folder.display()
        );
        io::Error::new(error.kind(), reason)
    };
    let mut to = nameless(folder).map_err(|error| wrong("it cannot be unpacked into", &error))?;
    let Some(mut from) = decompress("zstd", BufReader::new(file)) else { return Ok(to) };
    io::copy(&mut from, &mut to).map_err(|error| wrong("unpacking it failed in", &error))?;
    Ok(to)
}

/// A new file whose name is gone already.
fn nameless(folder: &Path) -> io::Result<File> {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let mut error = io::Error::other("no name is free");
    for _ in 0..TRIES {
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("tessera-unpacked-{}-{number}", std::process::id()));
        match OpenOptions::new().read(true).write(true).create_new(true).mode(0o600).open(&path) {
            Ok(file) => {
                std::fs::remove_file(&path)?;
                return Ok(file);
            }
            Err(taken) if taken.kind() == io::ErrorKind::AlreadyExists => error = taken,
            Err(other) => return Err(other),
        }
    }
    Err(error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    use std::os::unix::fs::FileExt;

    #[test]
    fn a_file_is_unpacked_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (packed, room) = (folder.path().join("a.zstd"), folder.path().join("room"));
        std::fs::create_dir(&room).unwrap();
        let bytes: Vec<u8> = (0..300_000_u32).flat_map(|k| (k / 7).to_le_bytes()).collect();
        std::fs::write(&packed, compress_to_vec(&bytes[..], CompressionLevel::Fastest)).unwrap();
        let file = unpacked_in(&File::open(&packed).unwrap(), &room).unwrap();
        assert_eq!(file.metadata().unwrap().len(), bytes.len() as u64);
        let mut some = [0; 4];
        file.read_exact_at(&mut some, 4 * 70_000).unwrap();
        assert_eq!(u32::from_le_bytes(some), 10_000);
        assert_eq!(std::fs::read_dir(&room).unwrap().count(), 0);
    }

    #[test]
    fn damage_and_a_folder_that_is_not_there_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let packed = folder.path().join("a.zstd");
        let whole = compress_to_vec(&[7_u8; 100_000][..], CompressionLevel::Fastest);
        std::fs::write(&packed, &whole[..whole.len() - 9]).unwrap();
        let words = |room: &Path| unpacked_in(&File::open(&packed).unwrap(), room).unwrap_err().to_string();
        assert!(words(folder.path()).contains("unpacking it failed in"), "{}", words(folder.path()));
        let words = words(&folder.path().join("none"));
        assert!(words.contains("cannot be unpacked into") && words.contains("TMPDIR"), "{words}");
    }
}
