//! Folders that are known for what they are and not read.

use super::files::names;
use crate::SourceError;
use crate::unread;
use std::path::Path;

/// What the folder is, if it is known; a single recording inside is named too.
pub(super) fn folder(folder: &Path) -> Option<SourceError> {
    if let Some(recording) = names(folder).iter().find(|name| name.to_lowercase().ends_with(".r3d")) {
        return Some(SourceError::NotRead {
            path: folder.to_owned(),
            what: "a folder of a recording of Record3D",
            remedy: format!("run the file: {}", folder.join(recording).display()),
        });
    }
    let inside = names(folder).into_iter().map(|name| folder.join(name)).filter(|path| path.is_file());
    inside.filter_map(|path| unread::file(&path)).next()
}
