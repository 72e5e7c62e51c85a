//! Camera, grid and settings, shared by aligner and optimiser.

use crate::estimation::colour_model::{ColourModel, ColourState};
use crate::estimation::motion_filter::MotionState;
use crate::estimation::noise_scales::{NoiseScales, NoiseState};
use crate::map::cameras::{SessionCamera, SessionCameras};
use crate::settings::MappingSettings;
use std::borrow::Cow;
use tessera_geometry::{Camera, DepthNoise, Twist};
use tessera_numerics::Steps;
use tessera_registration::{GridCamera, KdTree, Matcher, RegistrationSettings, ShutterTable};
use tessera_surface::{Grid, SurfaceSettings, SurfaceView};

/// Camera, grid and settings of one run.
#[derive(Clone, Debug)]
pub struct Context {
    /// The camera.
    pub camera: Camera,
    /// Shape of every surface.
    pub grid: Grid,
    /// Settings of the registration.
    pub registration: RegistrationSettings,
    /// Settings of mapping.
    pub mapping: MappingSettings,
    /// Noise of the depth.
    pub noise: DepthNoise,
    /// Standard deviation of a frame's time, seconds; 0 where exposures are stamped.
    pub stamp_sigma_s: f64,
    /// Where the measurement of a cell lies relative to the cell's first pixel.
    pub offset_px: f64,
    /// How colour lies against depth, as far as it is certain.
    pub(crate) colour: ColourModel,
    /// The same of this run's own camera.
    own_colour: ColourModel,
    /// Cameras of the runs that keyframes are of, where these differ.
    pub(crate) cameras: SessionCameras,
    /// Factors of the covariances that the sensors' models state.
    pub(crate) scales: NoiseScales,
    /// Factors of the alignment's covariance against the motion, of translation and rotation (method 6.1).
    pub(crate) motion_scale: [f64; 2],
    /// Whether features may lead.
    pub(crate) is_colour_trusted: bool,
    /// Observer of the steps of aligner and optimiser; none by default.
    pub steps: Steps,
}

impl Context {
    /// Collects what a run's aligner and optimiser share.
    pub fn new(
        camera: &Camera,
        surface: &SurfaceSettings,
        registration: &RegistrationSettings,
        mapping: &MappingSettings,
    ) -> Self {
        let step = surface.step as usize;
        let grid = Grid {
            width: (camera.width as usize).div_ceil(step),
            height: (camera.height as usize).div_ceil(step),
            step,
        };
        let offset_px = if surface.variant.is_paper() { 0.0 } else { (f64::from(surface.step) - 1.0) / 2.0 };
        Self {
            camera: camera.clone(),
            grid,
            registration: registration.clone(),
            mapping: mapping.clone(),
            steps: Steps::default(),
            noise: DepthNoise::default(),
            stamp_sigma_s: 0.0,
            offset_px,
            colour: ColourModel::default(),
            own_colour: ColourModel::default(),
            cameras: SessionCameras::default(),
            scales: NoiseState::default().scales(),
            motion_scale: MotionState::default().scale(),
            is_colour_trusted: true,
        }
    }

    /// The same with what is known of colour.
    pub(crate) fn with_colour(&self, colour: &ColourState, noise: &NoiseState) -> Self {
        let readout_s = colour.model.readout_s;
        let uncorrected = ColourModel { readout_s, ..ColourModel::default() };
        let model = if self.mapping.features.correct { colour.model } else { uncorrected };
        let camera = Camera { readout_s, ..self.camera.clone() };
        Self {
            camera,
            colour: model,
            own_colour: model,
            scales: noise.scales(),
            is_colour_trusted: colour.is_trusted(),
            ..self.clone()
        }
    }

    /// Factor of the features' metric information beside that of the surfaces' blocks in units of their model;
    /// 0 where colour is not trusted.
    pub(crate) fn feature_weight(&self) -> f64 {
        if self.is_colour_trusted { self.scales.surfaces / self.scales.features } else { 0.0 }
    }

    /// The same with colour registered to depth by this model.
    #[must_use]
    pub fn with_colour_model(self, colour: ColourModel) -> Self {
        let camera = Camera { readout_s: colour.readout_s, ..self.camera };
        Self { camera, colour, own_colour: colour, ..self }
    }

    /// The same with what is known of the motion.
    pub(crate) fn with_motion(self, motion: &MotionState) -> Self {
        Self { motion_scale: motion.scale(), ..self }
    }

    /// The same with keyframes of runs that had other cameras.
    #[must_use]
    pub fn with_cameras(self, cameras: SessionCameras) -> Self {
        Self { cameras, ..self }
    }

    /// What was seen by the camera of a run among those that keyframes are of: this, unless that run had
    /// another camera.
    pub(crate) fn of(&self, session: u32) -> Cow<'_, Self> {
        let Some(seen_by) = self.cameras.of(session) else { return Cow::Borrowed(self) };
        let SessionCamera { camera, grid, offset_px, colour } = seen_by;
        let readout_s = colour.unwrap_or(self.own_colour).readout_s;
        Cow::Owned(Self {
            camera: Camera { readout_s, ..camera.clone() },
            grid: *grid,
            offset_px: *offset_px,
            colour: colour.filter(|_| self.mapping.features.correct).unwrap_or(self.own_colour),
            ..self.clone()
        })
    }

    /// The camera of this run, as one among several.
    pub fn session_camera(&self) -> SessionCamera {
        let (camera, grid, offset_px) = (self.camera.clone(), self.grid, self.offset_px);
        SessionCamera { camera, grid, offset_px, colour: None }
    }

    /// The cameras of this run and of those in whose map it began, by session.
    pub fn session_cameras(&self) -> Vec<SessionCamera> {
        if self.cameras.is_empty() { vec![self.session_camera()] } else { self.cameras.all().to_vec() }
    }

    /// The same in a map that runs with these cameras made, one after the other.
    #[must_use]
    pub fn in_map_of(self, earlier: &[Camera]) -> Self {
        let own = self.session_camera();
        let of = |camera: &Camera| SessionCamera {
            camera: camera.clone(),
            colour: Some(ColourModel::of_camera(camera)),
            ..own.clone()
        };
        let all: Vec<SessionCamera> = earlier.iter().map(of).chain([own.clone()]).collect();
        self.with_cameras(SessionCameras::new(&all))
    }

    /// A matcher with buffers of its own.
    pub fn matcher(&self) -> Matcher {
        Matcher::new(self.grid_camera(), self.noise, &self.registration)
    }

    /// The tree of a surface, where partners are the nearest anywhere, as the paper has it.
    pub(crate) fn tree(&self, surface: &SurfaceView<'_>, shutter: &ShutterTable) -> Option<KdTree> {
        self.registration.variant.is_paper().then(|| KdTree::new(surface, shutter))
    }

    fn grid_camera(&self) -> GridCamera {
        GridCamera::new(&self.camera, self.grid, self.offset_px)
    }

    /// Motion during the readout of a frame with this velocity.
    pub fn shutter(&self, velocity: &Twist) -> ShutterTable {
        let table =
            ShutterTable::new(&self.camera, velocity, self.grid.height, self.grid.step, self.offset_px);
        // A matcher knows one camera, and takes another one from here.
        if self.cameras.is_empty() { table } else { table.of_camera(self.grid_camera()) }
    }

    /// As [`Self::shutter`], into a table that exists.
    pub fn fill_shutter(&self, velocity: &Twist, table: &mut ShutterTable) {
        *table = self.shutter(velocity);
    }
}
