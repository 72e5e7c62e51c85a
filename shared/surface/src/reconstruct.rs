//! The whole reconstruction of one frame: cloud, mesh, normals, filter, vertices.

use crate::cloud::CloudMaker;
use crate::filter;
use crate::mesh::{self, EdgeTest};
use crate::normals::{self, From};
use crate::planes::Workspace;
use crate::rings::RingWalk;
use crate::settings::{NormalsAfterFilter, SettingError, SurfaceSettings};
use crate::vertex::{Grid, Vertex};
use tessera_geometry::{Camera, DepthNoise};

/// What came out of one frame, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceStats {
    /// Cells with a measurement.
    pub n_measured: usize,
    /// Vertices that may be aligned to.
    pub n_valid: usize,
    /// Valid vertices away from depth edges.
    pub n_inner: usize,
}

/// Turns depth images into surfaces; holds its buffers, so nothing is allocated per frame.
///
/// A surface is a pure function of its frame: nothing is carried from one to the next.
pub struct Reconstructor {
    settings: SurfaceSettings,
    cloud: CloudMaker,
    test: EdgeTest,
    workspace: Workspace,
    walk: Option<RingWalk>,
}

impl Reconstructor {
    /// Prepares ray tables and buffers for one camera.
    ///
    /// # Errors
    /// A setting out of range, by its key.
    pub fn new(camera: &Camera, settings: &SurfaceSettings) -> Result<Self, SettingError> {
        settings.check()?;
        let step = settings.step as usize;
        let grid = Grid {
            width: (camera.width as usize).div_ceil(step),
            height: (camera.height as usize).div_ceil(step),
            step,
        };
        let noise = DepthNoise { model: settings.noise };
        Ok(Self {
            settings: settings.clone(),
            cloud: CloudMaker::new(camera, step, settings.cell_sample, settings.max_depth_m, noise),
            test: EdgeTest::new(settings),
            workspace: Workspace::new(grid),
            walk: (settings.filter_rings > 1).then(|| RingWalk::new(grid)),
        })
    }

    /// The shape of every surface that [`Self::reconstruct`] makes.
    pub fn grid(&self) -> Grid {
        self.workspace.grid
    }

    /// Makes the surface of one frame.
    ///
    /// `depth` holds raw units, row by row; `colour` red, green, blue per pixel, registered to
    /// depth; `out` exactly [`Grid::len`] vertices, each of which is written.
    ///
    /// # Panics
    /// When a slice is shorter than the camera's image or grid, which the caller checks on entry.
    pub fn reconstruct(&mut self, depth: &[u16], colour: Option<&[u8]>, out: &mut [Vertex]) -> SurfaceStats {
        let w = &mut self.workspace;
        let n_measured = self.cloud.fill(depth, colour, w);
        mesh::build(&self.test, w);
        normals::fill(w, From::Raw, self.settings.min_view_cosine);
        if self.settings.filter_rings > 0 {
            for _ in 0..self.settings.filter_passes {
                filter::pass(&self.settings, w, self.walk.as_mut());
                if self.settings.normals_after_filter == NormalsAfterFilter::Recompute {
                    normals::fill(w, From::Filtered, self.settings.min_view_cosine);
                }
                std::mem::swap(&mut w.points, &mut w.filtered_points);
                std::mem::swap(&mut w.normals, &mut w.filtered_normals);
            }
        }
        write_vertices(w, n_measured, out)
    }
}

fn write_vertices(w: &Workspace, n_measured: usize, out: &mut [Vertex]) -> SurfaceStats {
    let mut stats = SurfaceStats { n_measured, ..SurfaceStats::default() };
    for (i, vertex) in out.iter_mut().enumerate().take(w.grid.len()) {
        let normal = w.normals.at(i);
        let is_valid = w.quads[i] > 0 && normal != [0.0; 3];
        let is_inner = is_valid && w.quads[i] == 4;
        stats.n_valid += usize::from(is_valid);
        stats.n_inner += usize::from(is_inner);
        let [r, g, b, row_offset] = w.colour_row[i];
        let boundary = if is_inner { 0 } else { Vertex::BOUNDARY };
        let flags = if is_valid { Vertex::VALID | boundary } else { boundary };
        *vertex = Vertex {
            position: w.points.at(i),
            flags_rgb: Vertex::pack(flags, u32::from(row_offset), [r, g, b]),
            normal,
            intensity: w.intensity[i],
        };
    }
    stats
}
