//! Colour as a video beside the depth images: `depth/` and one file such as `rgb.mp4`.

use super::super::list::ListEntry;
use super::super::video::Video;
use super::files::names;
use super::{Asked, FoundLayout};
use std::path::Path;

/// Ends of the names of what is read as a video: MP4 and QuickTime.
const ENDS: [&str; 3] = ["mp4", "m4v", "mov"];

/// The video of a folder that has one alone.
fn file_of(folder: &Path) -> Option<String> {
    let is_video = |name: &String| {
        name.rsplit_once('.').is_some_and(|(_, end)| ENDS.contains(&end.to_lowercase().as_str()))
    };
    let mut videos = names(folder).into_iter().filter(is_video);
    videos.next().filter(|_| videos.next().is_none())
}

impl FoundLayout {
    /// Takes the frames of a video that lies in the folder, where there are as many as depth images: each is of the
    /// image at its place. Else states why colour is not there.
    pub(super) fn take_video_beside(&mut self, folder: &Path, asked: &Asked) {
        let Some(file) = file_of(folder).filter(|_| !asked.is_without_colour) else { return };
        let n_depth = self.depth.len();
        let reason = match Video::open(folder, &file) {
            Ok(video) if video.n_frames == n_depth as u64 => {
                let entry = |(depth, number): (&ListEntry, u64)| ListEntry {
                    stamp_nanos: depth.stamp_nanos,
                    file: video.name_of(number),
                };
                self.colour = self.depth.iter().zip(0..).map(entry).collect();
                self.notes
                    .push(("video", format!("{file}, a frame for each depth image, decoded by ffmpeg")));
                self.video = Some(video);
                self.no_colour = None;
                return;
            }
            Ok(video) => {
                format!("has {} frames, expected one for each of {n_depth} depth images", video.n_frames)
            }
            Err(reason) => reason,
        };
        self.no_colour = Some(format!("it is a video ({file}): {reason}"));
    }
}
