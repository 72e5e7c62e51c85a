//! Files that are known for what they are and not read, each with what to do about it.

use crate::SourceError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes that tell a file's kind.
const HEAD_BYTES: u64 = 64;

/// What a file is: by its first bytes, and by its name where those say too little.
struct UnreadKind {
    begins: &'static [u8],
    /// Ends of the name; an empty one: any.
    ends: &'static [&'static str],
    what: &'static str,
    remedy: &'static str,
}

/// `{in}` and `{stem}` stand for the file and its name without its end. The first that fits is it.
const KINDS: [UnreadKind; 6] = [
    UnreadKind {
        begins: b"PK\x03\x04",
        ends: &[""],
        what: "a zip file",
        remedy: "unpack it: unzip {in} -d {stem}, then run the folder {stem}",
    },
    UnreadKind {
        begins: b"\x1f\x8b",
        ends: &[""],
        what: "a compressed archive",
        remedy: "unpack it: tar -xzf {in}, then run the folder",
    },
    UnreadKind {
        begins: b"\x1a\x45\xdf\xa3",
        ends: &[""],
        what: "a Matroska video, as of Azure Kinect",
        remedy: "convert it to images: python azure_kinect_mkv_reader.py --input {in} --output {stem} (of Open3D's examples), \
                 then run the folder {stem}",
    },
    UnreadKind {
        begins: b"",
        ends: &[".tar"],
        what: "an archive",
        remedy: "unpack it: tar -xf {in}, then run the folder",
    },
    UnreadKind {
        begins: b"",
        ends: &[".oni"],
        what: "a recording of OpenNI",
        remedy: "play it into ROS 2 or write its frames as PNG images, then run the folder",
    },
    UnreadKind {
        begins: b"",
        ends: &[".svo", ".svo2"],
        what: "a recording of a ZED camera",
        remedy: "export it: python svo_export.py --mode 4 --input_svo_file {in} --output_path_dir {stem} (of ZED's \
                 samples; depth as 16-bit PNG), then run the folder {stem}",
    },
];

/// Whether the first bytes of a file are of some kind.
pub(crate) fn begins(path: &Path, is_kind: fn(&[u8]) -> bool) -> bool {
    head(path).is_some_and(|head| is_kind(&head))
}

fn head(path: &Path) -> Option<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path).ok()?.take(HEAD_BYTES).read_to_end(&mut head).ok()?;
    Some(head)
}

/// The file for what it is; `None`: not known, or a kind that is read.
pub(crate) fn file(path: &Path) -> Option<SourceError> {
    let head = head(path)?;
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    let kind = KINDS
        .iter()
        .find(|kind| head.starts_with(kind.begins) && kind.ends.iter().any(|end| name.ends_with(end)))?;
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let remedy = kind.remedy.replace("{stem}", &stem).replace("{in}", &path.display().to_string());
    Some(SourceError::NotRead { path: path.to_owned(), what: kind.what, remedy })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_named_with_its_command() {
        let folder = tempfile::tempdir().unwrap();
        let table: [(&str, &[u8], &str, &str); 6] = [
            ("a.zip", b"PK\x03\x04", "a zip file", "unzip"),
            ("a.tgz", b"\x1f\x8b\x08", "a compressed archive", "tar -xzf"),
            ("a.mkv", b"\x1a\x45\xdf\xa3", "Azure Kinect", "azure_kinect_mkv_reader.py"),
            ("a.oni", b"NI10", "OpenNI", "PNG"),
            ("a.svo", b"SVO", "ZED", "svo_export.py"),
            ("a.SVO2", b"\x89MCAP", "ZED", "svo_export.py"),
        ];
        for (name, head, what, command) in table {
            let path = folder.path().join(name);
            std::fs::write(&path, head).unwrap();
            let message = file(&path).unwrap().to_string();
            assert!(message.contains(what) && message.contains(command), "{message}");
            assert!(message.contains("which is not read"), "{message}");
        }
        let other = folder.path().join("a.txt");
        std::fs::write(&other, "words").unwrap();
        assert!(file(&other).is_none() && file(&folder.path().join("none")).is_none());
    }
}
