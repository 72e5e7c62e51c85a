//! The whole reconstruction of one frame: cloud, mesh, normals, filter, vertices.

use crate::cloud::CloudMaker;
use crate::filter;
use crate::mesh::{self, EdgeTest};
use crate::normals::{self, From};
use crate::planes::{PlaneLayout, PlaneRun, Workspace};
use crate::rings::RingWalk;
use crate::settings::SurfaceSettings;
use crate::vertex::{Grid, Vertex};
use tessera_geometry::Camera;
use tessera_numerics::{SettingError, Step, Steps};

/// Counts of one reconstruction.
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
    n_measured: usize,
    arch: pulp::Arch,
    /// Observer of the steps; none by default.
    pub steps: Steps,
}

impl Reconstructor {
    /// The steps of a reconstruction in their order.
    pub const STEPS: [Step; 5] = [Step::Cloud, Step::Mesh, Step::Normals, Step::Filter, Step::Vertices];

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
        Ok(Self {
            settings: settings.clone(),
            cloud: CloudMaker::new(camera, settings),
            test: EdgeTest::new(settings),
            workspace: Workspace::new(grid),
            walk: (settings.filter_rings > 1).then(|| RingWalk::new(PlaneLayout::new(grid))),
            n_measured: 0,
            arch: settings.isa.arch(),
            steps: Steps::default(),
        })
    }

    /// The shape of every surface that [`Self::reconstruct`] makes.
    pub fn grid(&self) -> Grid {
        self.workspace.layout.grid
    }

    /// Makes the surface of one frame.
    ///
    /// `depth` holds raw units, row by row; `colour` red, green, blue per pixel, registered to
    /// depth; `out` exactly [`Grid::len`] vertices, each of which is written.
    ///
    /// # Panics
    /// When a slice is shorter than the camera's image or grid, which the caller checks on entry.
    pub fn reconstruct(&mut self, depth: &[u16], colour: Option<&[u8]>, out: &mut [Vertex]) -> SurfaceStats {
        let arch = self.arch;
        arch.dispatch(OneFrame { reconstructor: self, steps: &Self::STEPS, depth, colour, out })
    }

    /// Runs one of [`Self::STEPS`] alone, on what the steps before it left in the buffers: for
    /// benchmarks. All of them in order are [`Self::reconstruct`]; any other step does nothing.
    ///
    /// # Panics
    /// As [`Self::reconstruct`].
    pub fn run_step(
        &mut self,
        step: Step,
        depth: &[u16],
        colour: Option<&[u8]>,
        out: &mut [Vertex],
    ) -> SurfaceStats {
        let arch = self.arch;
        arch.dispatch(OneFrame { reconstructor: self, steps: &[step], depth, colour, out })
    }

    #[inline(always)]
    fn run(&mut self, step: Step, depth: &[u16], colour: Option<&[u8]>, out: &mut [Vertex]) -> SurfaceStats {
        let w = &mut self.workspace;
        self.steps.enter(step);
        match step {
            Step::Cloud => self.n_measured = self.cloud.fill(depth, colour, w),
            Step::Mesh => mesh::build(self.test, w),
            Step::Normals => normals::fill(w, From::Raw),
            Step::Filter => self.filter(),
            Step::Vertices => {
                let stats = write_vertices(w, self.n_measured, out);
                self.steps.leave();
                return stats;
            }
            _ => {}
        }
        SurfaceStats { n_measured: self.n_measured, ..SurfaceStats::default() }
    }

    #[inline(always)]
    fn filter(&mut self) {
        let w = &mut self.workspace;
        if self.settings.filter_rings == 0 {
            return;
        }
        self.steps.enter(Step::Filter);
        filter::pass(&self.settings, w, self.walk.as_mut());
        // The paper's Fig. 2: eq. 8 again, on the filtered points.
        if self.settings.variant.is_paper() {
            self.steps.enter(Step::Normals);
            normals::fill(w, From::Filtered);
        }
        std::mem::swap(&mut w.points, &mut w.filtered_points);
        std::mem::swap(&mut w.normals, &mut w.filtered_normals);
    }
}

/// A reconstruction compiled for each instruction set and run on the widest that the machine has:
/// plain arithmetic in a fixed order, so the bits are the same on all.
struct OneFrame<'a> {
    reconstructor: &'a mut Reconstructor,
    steps: &'a [Step],
    depth: &'a [u16],
    colour: Option<&'a [u8]>,
    out: &'a mut [Vertex],
}

impl pulp::WithSimd for OneFrame<'_> {
    type Output = SurfaceStats;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> SurfaceStats {
        let mut stats = SurfaceStats::default();
        for &step in self.steps {
            stats = self.reconstructor.run(step, self.depth, self.colour, self.out);
        }
        stats
    }
}

#[inline(always)]
fn write_vertices(w: &mut Workspace, n_measured: usize, out: &mut [Vertex]) -> SurfaceStats {
    let mut stats = SurfaceStats { n_measured, ..SurfaceStats::default() };
    let n = w.layout.grid.width;
    for (row, line) in out.chunks_exact_mut(n).enumerate().take(w.layout.grid.height) {
        let start = w.layout.row(row);
        let (p, u) = (w.points.run(start, n), w.normals.run(start, n));
        let colours = &w.colour_row[row * n..(row + 1) * n];
        let flags = &mut w.flags_rgb[..n];
        let [n_valid, n_inner] = flag_row(u, &w.mesh.n_quads[start..start + n], colours, flags);
        stats.n_valid += n_valid as usize;
        stats.n_inner += n_inner as usize;
        for (c, vertex) in line.iter_mut().enumerate() {
            *vertex = Vertex { position: p.at(c), flags_rgb: flags[c], normal: u.at(c), reserved: 0 };
        }
    }
    stats
}

/// Flags, row offset and colour of each vertex of a row; the numbers of valid and of inner vertices.
#[inline(always)]
fn flag_row(u: PlaneRun<'_>, n_quads: &[f32], colours: &[[u8; 4]], out: &mut [u32]) -> [u32; 2] {
    let n = out.len();
    let (u, n_quads, colours) = (u.first(n), &n_quads[..n], &colours[..n]);
    let (mut n_valid, mut n_inner) = (0, 0);
    for c in 0..n {
        let has_normal = (u.x[c] != 0.0) | (u.y[c] != 0.0) | (u.z[c] != 0.0);
        let is_valid = (n_quads[c] > 0.0) & has_normal;
        let is_inner = is_valid & (n_quads[c] == 4.0);
        n_valid += u32::from(is_valid);
        n_inner += u32::from(is_inner);
        let flags = u32::from(is_valid) * Vertex::VALID + u32::from(!is_inner) * Vertex::BOUNDARY;
        out[c] = Vertex::with_colour(flags, u32::from_le_bytes(colours[c]));
    }
    [n_valid, n_inner]
}
