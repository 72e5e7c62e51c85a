//! Keyframes in front of a painted wall, for tests: geometry leaves its plane degenerate.

use crate::map::context::Context;
use crate::map::records::StoreSlot;
use crate::map::state::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::settings::MappingSettings;
use tessera_geometry::{Camera, Pose, PoseBits};
use tessera_registration::RegistrationSettings;
use tessera_surface::{Grid, SurfaceSettings, Vertex};

const DEPTH_M: f64 = 2.0;

/// A context of the default settings.
pub(crate) fn context() -> Context {
    let camera = Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0);
    let (surface, registration) = (SurfaceSettings::default(), RegistrationSettings::default());
    Context::new(&camera, &surface, &registration, &MappingSettings::default())
}

pub(crate) fn keyframe(id: u32, session: u32, x_m: f64) -> KeyframeState {
    KeyframeState {
        id,
        session,
        submap: 0,
        frame_index: 10 * u64::from(id),
        stamp_nanos: 1_000_000_000 * i64::from(id),
        world_from_camera: PoseBits::from(&Pose::translation(x_m, 0.0, 0.0)),
        velocity: [0.0; 6],
        slot: StoreSlot::default(),
        edges: Vec::new(),
        covariance: Vec::new(),
        up: None,
        place: vec![1],
        alike: Vec::new(),
        anchored_to: None,
    }
}

/// Surfaces by keyframe id.
pub(crate) struct Walls(Vec<Vec<Vertex>>);

impl Walls {
    /// The wall as each keyframe sees it.
    pub(crate) fn seen_by(context: &Context, keyframes: &[KeyframeState]) -> Self {
        Self(keyframes.iter().map(|_| wall(context.grid)).collect())
    }
}

impl KeyframeSurfaces for Walls {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }
}

fn wall(grid: Grid) -> Vec<Vertex> {
    let step = grid.step as f64;
    let vertex = |i: usize| {
        let (row, column) = (i / grid.width, i % grid.width);
        let x = (column as f64 * step - 319.5) / 525.0 * DEPTH_M;
        let y = (row as f64 * step - 239.5) / 525.0 * DEPTH_M;
        let is_border = row == 0 || column == 0 || row + 1 == grid.height || column + 1 == grid.width;
        Vertex {
            position: [x as f32, y as f32, DEPTH_M as f32],
            normal: [0.0, 0.0, -1.0],
            reserved: 0,
            flags_rgb: Vertex::pack(
                Vertex::VALID | if is_border { Vertex::BOUNDARY } else { 0 },
                0,
                [128; 3],
            ),
        }
    };
    (0..grid.len()).map(vertex).collect()
}
