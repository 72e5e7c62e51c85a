//! What is made of one journal for those who read it.

use super::cloud::Packed;
use super::follow::{Follow, FollowedKeyframes};
use super::mapper::GridMapper;
use super::pace::MapPace;
use super::worker::{MapOptions, MapUpdate, Worker, WorkerEnd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tessera_geometry::Pose;
use tessera_occupancy::{CellLattice, ColouredPoint, PointThinner};
use tessera_outputs::ToolError;

/// Least time between two clouds of the whole map.
const CLOUD: Duration = Duration::from_secs(5);
/// Least time between two verdicts.
const VERDICT: Duration = Duration::from_secs(1);

/// What is made of one journal.
pub(crate) struct Making<'a> {
    worker: &'a Worker,
    follow: Follow,
    /// Points of keyframes in their cameras' axes, by id; read once something is wanted.
    held: Vec<Vec<ColouredPoint>>,
    /// Keyframes that are not new any more; `None` before the first look: what is there then is not new.
    n_known: Option<u32>,
    /// The keyframes as the last cloud shows them.
    shown: FollowedKeyframes,
    cloud: MapPace,
    mapper: GridMapper,
    /// The last verdict.
    said: Option<String>,
    verdict: MapPace,
}

impl<'a> Making<'a> {
    pub(crate) fn new(worker: &'a Worker, follow: Follow) -> Self {
        let (shown, cloud) = (FollowedKeyframes::new(), MapPace::new(CLOUD));
        let mapper = mapper(&worker.options);
        let (said, verdict) = (None, MapPace::new(VERDICT));
        Self { worker, follow, held: Vec::new(), n_known: None, shown, cloud, mapper, said, verdict }
    }

    /// Takes in what the run wrote, and makes what is wanted; `is_last` waits for nothing.
    ///
    /// # Errors
    /// Where the directory cannot be read, or nothing takes what is made.
    pub(crate) fn step(&mut self, is_last: bool) -> Result<(), WorkerEnd> {
        self.follow.drain()?;
        self.judge(is_last)?;
        let wants = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        let wanted = &self.worker.wanted;
        let (points, cloud, grid) = (wants(&wanted.points), wants(&wanted.cloud), wants(&wanted.grid));
        if points || cloud || grid {
            self.hold()?;
            let scene = self.scene();
            if points {
                self.send_points(&scene)?;
            }
            if grid && let Some(update) = self.mapper.step(&scene, &self.held, Instant::now(), is_last) {
                self.worker.to.send(MapUpdate::Grid(self.follow.newest_nanos(), update))?;
            }
            if cloud && scene != self.shown && (is_last || self.cloud.is_open(Instant::now())) {
                self.send_cloud(scene)?;
            }
        } else if !self.held.is_empty() {
            self.release();
        }
        self.n_known = Some(self.follow.n_keyframes());
        Ok(())
    }

    /// Sends the verdict where it has changed.
    fn judge(&mut self, is_last: bool) -> Result<(), WorkerEnd> {
        let now = Instant::now();
        if !is_last && !self.verdict.is_open(now) {
            return Ok(());
        }
        let verdict = self.follow.verdict();
        self.verdict.close(now, Instant::now(), 0);
        if let Some(words) = verdict.clone().filter(|_| verdict != self.said) {
            self.worker.to.send(MapUpdate::Verdict(words))?;
            self.said = verdict;
        }
        Ok(())
    }

    /// Reads the points of keyframes that are not held yet.
    fn hold(&mut self) -> Result<(), ToolError> {
        // Half a cell: of a closed surface no cell is left without a point.
        let edge_m = self.worker.options.spacing_m.min(0.5 * self.worker.options.cell_m);
        for id in self.held.len() as u32..self.follow.n_keyframes() {
            self.held.push(self.follow.points(id, edge_m)?);
        }
        Ok(())
    }

    /// Gives back what the keyframes need while nothing is wanted; it is made again when something is.
    fn release(&mut self) {
        (self.held, self.shown) = (Vec::new(), FollowedKeyframes::new());
        self.mapper = mapper(&self.worker.options);
    }

    /// The keyframes, each with the pose that takes its points to the frame `map`.
    fn scene(&self) -> FollowedKeyframes {
        let map_from_world = self.worker.base.map_from_world(self.follow.world_up());
        let placed = |(id, world_from_camera)| (id, map_from_world * world_from_camera);
        self.follow.scene().into_iter().map(placed).collect()
    }

    /// The points of these keyframes in `map`, one a voxel.
    fn thinned<'s>(&self, keyframes: impl Iterator<Item = &'s (u32, Pose)>) -> Packed {
        let mut thinner = PointThinner::new(self.worker.options.spacing_m);
        for (id, map_from_camera) in keyframes {
            let held = self.held.get(*id as usize).into_iter().flatten();
            held.for_each(|point| thinner.add(&point.moved(map_from_camera)));
        }
        Packed::new(&thinner.points())
    }

    fn send_points(&self, scene: &FollowedKeyframes) -> Result<(), WorkerEnd> {
        let Some(n_known) = self.n_known else { return Ok(()) };
        for keyframe in scene.iter().filter(|(id, _)| *id >= n_known) {
            let packed = self.thinned(std::iter::once(keyframe));
            self.worker.to.send(MapUpdate::Points(self.follow.stamp_nanos(keyframe.0), packed))?;
        }
        Ok(())
    }

    fn send_cloud(&mut self, scene: FollowedKeyframes) -> Result<(), WorkerEnd> {
        let began = Instant::now();
        let packed = self.thinned(scene.iter());
        self.cloud.close(began, Instant::now(), packed.len());
        self.worker.to.send(MapUpdate::Cloud(self.follow.newest_nanos(), packed))?;
        self.shown = scene;
        Ok(())
    }
}

fn mapper(options: &MapOptions) -> GridMapper {
    GridMapper::new(CellLattice::new(options.cell_m, options.heights_m))
}
