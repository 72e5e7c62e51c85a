//! A thread beside the images: it follows the run's directory and makes what is published of the map,
//! as long as something reads it.

use super::cloud::Packed;
use super::follow::{Follow, FollowError, Scene};
use super::pace::Pace;
use super::points::{Point, Thinner};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SendError, SyncSender};
use std::time::{Duration, Instant};
use tessera_geometry::Pose;
use tessera_transport::RunEntry;

/// Time between two looks into the journal.
const POLL: Duration = Duration::from_millis(100);
/// Time after which a directory that could not be read is tried again.
const AGAIN: Duration = Duration::from_secs(5);

/// Which topics are read, and whether the run is over; set by the network's side.
#[derive(Debug, Default)]
pub(crate) struct Wanted {
    pub(crate) points: AtomicBool,
    pub(crate) cloud: AtomicBool,
    pub(crate) is_over: AtomicBool,
}

/// What is to be published, with the time in the run.
pub(crate) enum Update {
    /// Points of a new keyframe.
    Points(i64, Packed),
    /// The whole map.
    Cloud(i64, Packed),
    /// The directory cannot be read: why.
    Trouble(String),
}

/// How the map is published.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MapOptions {
    /// Edge of the voxels that thin points, metres.
    pub(crate) spacing_m: f64,
}

/// What the thread has.
pub(crate) struct Worker {
    pub(crate) entry: RunEntry,
    pub(crate) options: MapOptions,
    /// The base of the robot as seen from its camera: the frame `map` is that of the base at the start.
    pub(crate) base_from_camera: Pose,
    pub(crate) wanted: std::sync::Arc<Wanted>,
    pub(crate) to: SyncSender<Update>,
}

/// Why the thread stops to follow.
enum End {
    Trouble(FollowError),
    /// Nothing takes what it makes.
    NotWanted,
}

impl From<FollowError> for End {
    fn from(error: FollowError) -> Self {
        Self::Trouble(error)
    }
}

impl From<SendError<Update>> for End {
    fn from(_: SendError<Update>) -> Self {
        Self::NotWanted
    }
}

impl Worker {
    /// Follows the run until it is over or nothing takes what is made.
    pub(crate) fn work(&self) {
        while let Err(End::Trouble(error)) = self.follow() {
            if self.to.send(Update::Trouble(error.to_string())).is_err() || self.is_over() {
                return;
            }
            std::thread::sleep(AGAIN);
        }
    }

    fn is_over(&self) -> bool {
        self.wanted.is_over.load(Ordering::Acquire)
    }

    fn follow(&self) -> Result<(), End> {
        let mut making = loop {
            if let Some(follow) = Follow::open(&self.entry)? {
                break Making::new(self, follow);
            }
            if self.is_over() {
                return Ok(());
            }
            std::thread::sleep(POLL);
        };
        loop {
            // Asked before the journal is read: what it has then is the end.
            let is_last = self.is_over();
            making.step(is_last)?;
            if is_last {
                return Ok(());
            }
            std::thread::sleep(POLL);
        }
    }
}

/// What is made of one journal.
struct Making<'a> {
    worker: &'a Worker,
    follow: Follow,
    /// Points of keyframes in their cameras' axes, by id; read once something is wanted.
    held: Vec<Vec<Point>>,
    /// Keyframes that are not new any more.
    n_known: u32,
    cloud: Pace,
}

impl<'a> Making<'a> {
    fn new(worker: &'a Worker, follow: Follow) -> Self {
        Self { worker, follow, held: Vec::new(), n_known: 0, cloud: Pace::default() }
    }

    fn step(&mut self, is_last: bool) -> Result<(), End> {
        self.follow.drain()?;
        let wants = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        let wanted = &self.worker.wanted;
        let (points, cloud) = (wants(&wanted.points), wants(&wanted.cloud));
        if points || cloud {
            self.hold()?;
            let scene = self.scene();
            if points {
                self.send_points(&scene)?;
            }
            if cloud && self.cloud.is_due(&scene, Instant::now(), is_last) {
                self.send_cloud(scene)?;
            }
        }
        self.n_known = self.follow.n_keyframes();
        Ok(())
    }

    /// Reads the points of keyframes that are not held yet.
    fn hold(&mut self) -> Result<(), FollowError> {
        for id in self.held.len() as u32..self.follow.n_keyframes() {
            self.held.push(self.follow.points(id, self.worker.options.spacing_m)?);
        }
        Ok(())
    }

    /// The keyframes, each with the pose that takes its points to the frame `map`.
    fn scene(&self) -> Scene {
        let base_from_camera = self.worker.base_from_camera;
        let placed = |(id, world_from_camera)| (id, base_from_camera * world_from_camera);
        self.follow.scene().into_iter().map(placed).collect()
    }

    /// The points of these keyframes in `map`, one a voxel.
    fn thinned<'s>(&self, keyframes: impl Iterator<Item = &'s (u32, Pose)>) -> Packed {
        let mut thinner = Thinner::new(self.worker.options.spacing_m);
        for (id, map_from_camera) in keyframes {
            let held = self.held.get(*id as usize).into_iter().flatten();
            held.for_each(|point| thinner.add(&point.moved(map_from_camera)));
        }
        Packed::new(&thinner.points())
    }

    fn send_points(&self, scene: &Scene) -> Result<(), End> {
        for keyframe in scene.iter().filter(|(id, _)| *id >= self.n_known) {
            let packed = self.thinned(std::iter::once(keyframe));
            self.worker.to.send(Update::Points(self.follow.stamp_nanos(keyframe.0), packed))?;
        }
        Ok(())
    }

    fn send_cloud(&mut self, scene: Scene) -> Result<(), End> {
        let packed = self.thinned(scene.iter());
        let n_bytes = packed.len();
        self.worker.to.send(Update::Cloud(self.follow.newest_nanos(), packed))?;
        self.cloud.show(scene, Instant::now(), n_bytes);
        Ok(())
    }
}
