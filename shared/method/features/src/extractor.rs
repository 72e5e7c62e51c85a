//! Extraction from the frames of one camera, with buffers kept from frame to frame.

use crate::extract::{ExtractWorkspace, extract};
use crate::feature::Feature;
use crate::picture::Picture;
use crate::settings::FeatureSettings;

/// Extracts the features of colour images of one size, or of none where they are not wanted.
pub struct Extractor {
    settings: Option<FeatureSettings>,
    /// Columns and rows.
    size_px: [usize; 2],
    workspace: ExtractWorkspace,
}

impl Extractor {
    /// An extractor for images of `size_px` columns and rows; without settings it finds nothing.
    pub fn new(settings: Option<FeatureSettings>, size_px: [usize; 2], arch: pulp::Arch) -> Self {
        Self { settings, size_px, workspace: ExtractWorkspace::new(arch) }
    }

    /// Features of an image of red, green and blue bytes, row by row; none without an image, or of
    /// one of another size.
    pub fn extract(&mut self, colour: Option<&[u8]>) -> Vec<Feature> {
        let (Some(settings), Some(colour)) = (&self.settings, colour) else { return Vec::new() };
        let [width, height] = self.size_px;
        let picture = Picture::rgb(width, height, colour);
        picture.map_or(Vec::new(), |picture| extract(&picture, settings, &mut self.workspace))
    }
}
