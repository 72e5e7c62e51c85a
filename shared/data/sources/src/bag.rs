//! The folder of a bag of ROS 2: `metadata.yaml` and one or several files of MCAP or SQLite. Bags of
//! ROS 1 that were split lie in a folder too.

use crate::folder::is_inside;
use crate::joined::JoinedSource;
use crate::{RecordingOptions, RecordingSource, Source, SourceError};
use std::path::{Path, PathBuf};
use tessera_evaluation::plain_text;

const METADATA: &str = "metadata.yaml";
/// Ends of names of the files of a bag.
const ENDS: [&str; 3] = ["mcap", "db3", "bag"];
/// Behind these, of files that were compressed as a whole.
const PACKED_ENDS: [&str; 2] = ["zstd", "zst"];

/// The files of a bag in their order; `None`: the folder is no bag.
///
/// # Errors
/// It is a bag whose files are not read.
pub(crate) fn files(folder: &Path) -> Result<Option<Vec<PathBuf>>, SourceError> {
    let metadata = folder.join(METADATA);
    let mut files = match std::fs::read(&metadata) {
        Ok(bytes) => listed(&plain_text(&bytes)),
        Err(_) => Vec::new(),
    };
    if files.is_empty() && !crate::folder::is_known(folder) {
        files = files_inside(folder);
    }
    if files.is_empty() && !metadata.is_file() {
        return Ok(None);
    }
    let paths: Vec<PathBuf> = files.iter().map(|file| in_folder(folder, file)).collect();
    let there: Vec<String> = files_inside(folder).iter().map(|file| file.display().to_string()).collect();
    if let Some(gone) = paths.iter().find(|path| !path.exists() && !there.is_empty()) {
        let reason = format!(
            "metadata.yaml lists {}, which is not there; expected one of its files (there are: {}): run the file itself, or write the list again with: ros2 bag reindex {}",
            gone.file_name().unwrap_or_default().to_string_lossy(),
            there.join(", "),
            folder.display()
        );
        return Err(SourceError::Layout { path: folder.to_owned(), reason });
    }
    if let Some(other) = paths.iter().find(|path| !ENDS.iter().any(|end| has_end(path, end))) {
        let reason = "is listed in metadata.yaml, expected files that end in .mcap or .db3".to_owned();
        return Err(SourceError::Layout { path: other.clone(), reason });
    }
    match paths.is_empty() {
        true => Err(SourceError::Layout { path: metadata, reason: "names no files of the bag".to_owned() }),
        false => Ok(Some(paths)),
    }
}

/// `relative_file_paths` of `metadata.yaml`: a list of one name a line, as rosbag2 writes it.
fn listed(metadata: &str) -> Vec<PathBuf> {
    let mut lines = metadata.lines().skip_while(|line| line.trim() != "relative_file_paths:").skip(1);
    let mut files = Vec::new();
    while let Some(name) = lines.next().and_then(|line| line.trim().strip_prefix("- ")) {
        let file = PathBuf::from(name.trim_matches(['"', '\'']));
        // A bag that was moved may have lost the folder of its files; one that leads out is no part of it.
        match file.file_name() {
            _ if is_inside(&file) => files.push(file),
            // An absolute path of the machine that recorded it.
            Some(name) if file.is_absolute() => files.push(PathBuf::from(name)),
            _ => {}
        }
    }
    files
}

/// A file of the list: its path may begin with the folder of the bag, which is this one.
fn in_folder(folder: &Path, file: &Path) -> PathBuf {
    let path = folder.join(file);
    let by_name = file.file_name().map(|name| folder.join(name));
    by_name.filter(|by_name| !path.is_file() && by_name.is_file()).unwrap_or(path)
}

/// Whether a name has that end, before that of a compression as a whole.
fn has_end(path: &Path, end: &str) -> bool {
    let has = |path: &Path, end: &str| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(end));
    let is_compressed = PACKED_ENDS.iter().any(|packed| has(path, packed));
    has(path, end) || is_compressed && path.file_stem().is_some_and(|stem| has(Path::new(stem), end))
}

/// All files of one kind, of the first kind that is there, in the order of the numbers in their names.
fn files_inside(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).map(|entries| entries.flatten().collect::<Vec<_>>());
    let mut files: Vec<PathBuf> = entries.unwrap_or_default().iter().map(|e| e.file_name().into()).collect();
    let end = ENDS.iter().find(|end| files.iter().any(|file| has_end(file, end)));
    files.retain(|file| end.is_some_and(|end| has_end(file, end)));
    files.sort_by_key(|file| in_order_of_numbers(&file.to_string_lossy()));
    files
}

/// A key by which `b_2` stands before `b_10`: text, then the number behind it, and so on.
fn in_order_of_numbers(name: &str) -> Vec<(String, u64)> {
    let mut parts = vec![(String::new(), 0_u64)];
    let mut was_digit = false;
    for character in name.chars() {
        let digit = character.to_digit(10).map(u64::from);
        if was_digit && digit.is_none() {
            parts.push((String::new(), 0));
        }
        if let Some((text, number)) = parts.last_mut() {
            match digit {
                Some(digit) => *number = number.saturating_mul(10).saturating_add(digit),
                None => text.push(character),
            }
        }
        was_digit = digit.is_some();
    }
    parts
}

/// Opens a bag; topics, camera and where the cameras stand are those of its first file with images.
pub(crate) fn open(
    folder: &Path,
    files: &[PathBuf],
    options: &RecordingOptions<'_>,
    frames: Option<u64>,
) -> Result<Box<dyn Source>, SourceError> {
    let mut first_error = None;
    let mut n_passed = 0;
    let first = files.iter().find_map(|file| {
        n_passed = usize::saturating_add(n_passed, 1);
        match RecordingSource::open(file, options, if files.len() == 1 { frames } else { None }) {
            Ok(source) => Some(source),
            Err(error) => {
                // A recorder may begin a file before the camera does.
                first_error = first_error.take().or(Some(error));
                None
            }
        }
    });
    let Some(first) = first else {
        return Err(first_error.unwrap_or_else(|| SourceError::NoFolder { path: folder.to_owned() }));
    };
    if files.len() == 1 {
        return Ok(Box::new(first));
    }
    let mut joined = JoinedSource::new(first);
    if let Some(error) = first_error {
        joined.leave_out(&error);
    }
    for file in files.iter().skip(n_passed) {
        let first = Some(joined.first());
        match RecordingSource::open(file, &RecordingOptions { first, ..*options }, None) {
            Ok(part) => joined.add(part),
            // The last file of a bag may have been begun and hold no image.
            Err(error) => joined.leave_out(&error),
        }
    }
    joined.limit(frames);
    Ok(Box::new(joined))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const METADATA_TEXT: &str = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: STORAGE\n  \
        relative_file_paths:\n    - bag_0.END\n    - bag_1.END\n  duration:\n    nanoseconds: 3\n";

    fn metadata(storage: &str, end: &str) -> String {
        METADATA_TEXT.replace("STORAGE", storage).replace("END", end)
    }

    #[test]
    fn the_files_are_those_of_the_metadata_or_all_of_mcap() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        assert!(files(at).unwrap().is_none());
        fs::write(at.join("b.mcap"), "").unwrap();
        fs::write(at.join("a.MCAP"), "").unwrap();
        assert_eq!(files(at).unwrap().unwrap(), [at.join("a.MCAP"), at.join("b.mcap")]);
        fs::write(at.join(METADATA), metadata("mcap", "mcap")).unwrap();
        let renamed = files(at).unwrap_err().to_string();
        assert!(renamed.contains("lists bag_0.mcap, which is not there"), "{renamed}");
        assert!(renamed.contains("there are: a.MCAP, b.mcap") && renamed.contains("reindex"), "{renamed}");
        fs::write(at.join("bag_0.mcap"), "").unwrap();
        fs::write(at.join("bag_1.mcap"), "").unwrap();
        assert_eq!(files(at).unwrap().unwrap(), [at.join("bag_0.mcap"), at.join("bag_1.mcap")]);
        assert_eq!(
            listed("relative_file_paths:\n  - ../../etc/passwd\n  - 'x.mcap'\n"),
            [PathBuf::from("x.mcap")]
        );
    }

    #[test]
    fn paths_of_the_list_may_begin_with_the_folder_of_the_bag() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let list = "relative_file_paths:\n  - my_bag/bag_0.mcap\n  - /home/me/my_bag/bag_1.mcap\n";
        fs::write(at.join(METADATA), list).unwrap();
        fs::write(at.join("bag_0.mcap"), "").unwrap();
        fs::write(at.join("bag_1.mcap"), "").unwrap();
        assert_eq!(files(at).unwrap().unwrap(), [at.join("bag_0.mcap"), at.join("bag_1.mcap")]);
    }

    #[test]
    fn files_of_a_bag_that_are_not_read_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        fs::write(at.join(METADATA), metadata("sqlite3", "db3")).unwrap();
        assert_eq!(files(at).unwrap().unwrap(), [at.join("bag_0.db3"), at.join("bag_1.db3")]);
        fs::write(at.join(METADATA), metadata("mcap", "mcap.zstd")).unwrap();
        assert_eq!(files(at).unwrap().unwrap(), [at.join("bag_0.mcap.zstd"), at.join("bag_1.mcap.zstd")]);
        fs::write(at.join(METADATA), metadata("other", "txt")).unwrap();
        assert!(files(at).unwrap_err().to_string().contains("expected files that end in .mcap or .db3"));
        fs::write(at.join(METADATA), "nothing").unwrap();
        assert!(files(at).unwrap_err().to_string().contains("names no files of the bag"));
    }

    #[test]
    fn files_without_a_list_stand_in_the_order_of_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        for name in ["b_10.db3", "b_2.db3", "b_0.db3", "other.bag"] {
            fs::write(at.join(name), "").unwrap();
        }
        let expected = ["b_0.db3", "b_2.db3", "b_10.db3"].map(|name| at.join(name));
        assert_eq!(files(at).unwrap().unwrap(), expected);
    }
}
