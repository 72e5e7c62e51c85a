//! The folder of a bag of ROS 2: `metadata.yaml` and one or several files of MCAP.

use crate::joined::JoinedSource;
use crate::unread;
use crate::{RecordingOptions, RecordingSource, Source, SourceError};
use std::path::{Component, Path, PathBuf};

const METADATA: &str = "metadata.yaml";

/// The MCAP files of a bag in their order; `None`: the folder is no bag.
///
/// # Errors
/// It is a bag whose files are not read.
pub(crate) fn files(folder: &Path) -> Result<Option<Vec<PathBuf>>, SourceError> {
    let metadata = folder.join(METADATA);
    let mut files = match std::fs::read(&metadata) {
        Ok(bytes) => listed(&String::from_utf8_lossy(&bytes)),
        Err(_) => Vec::new(),
    };
    if files.is_empty() && !crate::folder::is_known(folder) {
        files = mcap_files(folder);
    }
    if files.is_empty() && !metadata.is_file() {
        return Ok(None);
    }
    let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(file)).collect();
    if let Some(error) = paths.iter().find_map(|path| unread::file(path)) {
        return Err(in_words_of_the_folder(folder, error));
    }
    let is_mcap = |path: &PathBuf| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("mcap"));
    if let Some(other) = paths.iter().find(|path| !is_mcap(path)) {
        let is_compressed = other.extension().is_some_and(|end| end == "zstd");
        let reason = match is_compressed {
            true => {
                "is compressed as a whole; decompress it first (zstd -d) and take .zstd off its name in metadata.yaml"
            }
            false => "is listed in metadata.yaml, expected files that end in .mcap",
        };
        return Err(SourceError::Layout { path: other.clone(), reason: reason.to_owned() });
    }
    match paths.is_empty() {
        true => Err(SourceError::Layout { path: metadata, reason: "names no files of the bag".to_owned() }),
        false => Ok(Some(paths)),
    }
}

/// The command of a file converts its whole bag, where that is the folder.
fn in_words_of_the_folder(folder: &Path, error: SourceError) -> SourceError {
    match error {
        SourceError::NotRead { what, .. } if what.contains("SQLite") => {
            let (name, what) = (folder.display(), "the folder of a bag of ROS 2 in SQLite (.db3)");
            let remedy = format!(
                "convert it: pip install rosbags; rosbags-convert --src {name} --dst {name}_mcap --dst-storage mcap; \
                 then run {name}_mcap"
            );
            SourceError::NotRead { path: folder.to_owned(), what, remedy }
        }
        error => error,
    }
}

/// `relative_file_paths` of `metadata.yaml`: a list of one name a line, as rosbag2 writes it.
fn listed(metadata: &str) -> Vec<PathBuf> {
    let mut lines = metadata.lines().skip_while(|line| line.trim() != "relative_file_paths:").skip(1);
    let mut files = Vec::new();
    while let Some(name) = lines.next().and_then(|line| line.trim().strip_prefix("- ")) {
        let file = PathBuf::from(name.trim_matches(['"', '\'']));
        // A bag that was moved may have lost the folder of its files; one that leads out is no part of it.
        let is_inside =
            file.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if is_inside {
            files.push(file);
        }
    }
    files
}

fn mcap_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).map(|entries| entries.flatten().collect::<Vec<_>>());
    let mut files: Vec<PathBuf> = entries.unwrap_or_default().iter().map(|e| e.file_name().into()).collect();
    files.retain(|file| file.extension().is_some_and(|end| end.eq_ignore_ascii_case("mcap")));
    files.sort();
    files
}

/// Opens a bag; topics, camera and where the cameras stand are those of its first file.
pub(crate) fn open(
    folder: &Path,
    files: &[PathBuf],
    options: &RecordingOptions<'_>,
    frames: Option<u64>,
) -> Result<Box<dyn Source>, SourceError> {
    let (Some(first), rest) = (files.first(), files.get(1..).unwrap_or_default()) else {
        return Err(SourceError::NoFolder { path: folder.to_owned() });
    };
    let first = RecordingSource::open(first, options, frames)?;
    if rest.is_empty() {
        return Ok(Box::new(first));
    }
    let mut joined = JoinedSource::new(first);
    for file in rest {
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
        assert_eq!(files(at).unwrap().unwrap(), [at.join("bag_0.mcap"), at.join("bag_1.mcap")]);
        assert_eq!(
            listed("relative_file_paths:\n  - ../../etc/passwd\n  - 'x.mcap'\n"),
            [PathBuf::from("x.mcap")]
        );
    }

    #[test]
    fn a_bag_in_sqlite_is_answered_with_the_command_that_converts_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        fs::write(at.join(METADATA), metadata("sqlite3", "db3")).unwrap();
        fs::write(at.join("bag_0.db3"), b"SQLite format 3\0").unwrap();
        let message = files(at).unwrap_err().to_string();
        assert!(message.contains("the folder of a bag of ROS 2 in SQLite"), "{message}");
        assert!(
            message.contains("rosbags-convert --src") && message.contains("--dst-storage mcap"),
            "{message}"
        );
        fs::write(at.join(METADATA), metadata("mcap", "mcap.zstd")).unwrap();
        assert!(files(at).unwrap_err().to_string().contains("compressed as a whole"));
        fs::write(at.join(METADATA), "nothing").unwrap();
        assert!(files(at).unwrap_err().to_string().contains("names no files of the bag"));
    }
}
