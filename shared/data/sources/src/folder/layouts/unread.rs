//! Folders that are known for what they are and not read.

use super::files::names;
use crate::SourceError;
use crate::unread;
use std::path::Path;

/// What the folder is, if it is known; a single recording inside is named too.
pub(super) fn folder(folder: &Path) -> Option<SourceError> {
    let is_exr = |name: &String| name.ends_with(".exr");
    if names(&folder.join("depth")).iter().any(is_exr) {
        return Some(SourceError::NotRead {
            path: folder.join("depth"),
            what: "depth as OpenEXR",
            remedy: "write it as TIFF of floats in metres beside: in Python cv2.imwrite(\"0.tif\", cv2.imread(\"0.exr\", -1)) \
                     with OPENCV_IO_ENABLE_OPENEXR=1, then run the folder"
                .to_owned(),
        });
    }
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
