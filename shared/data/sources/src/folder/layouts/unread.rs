//! Folders that are known for what they are and not read.

use super::files::names;
use crate::SourceError;
use crate::unread;
use std::path::Path;

/// What the folder is, if it is known; a single recording inside is named too.
pub(super) fn folder(folder: &Path) -> Option<SourceError> {
    if folder.join("rgbd").is_dir() && folder.join("metadata").is_file() {
        return Some(SourceError::NotRead {
            path: folder.to_owned(),
            what: "a recording of Record3D, whose depth is compressed by LZFSE",
            remedy: "write its depth as 16-bit PNG first (pip install pyliblzfse; docs/own_camera.md has the script)".to_owned(),
        });
    }
    let inside = names(folder).into_iter().map(|name| folder.join(name)).filter(|path| path.is_file());
    inside.filter_map(|path| unread::file(&path)).next()
}
