//! A camera's program that is none of ours: it keeps some frames, dies, asks, or sends nonsense, as it is told.

use crate::common::{Run, process_of, signal, wait_for};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;
use tessera_geometry::Camera;
use tessera_messages::{CameraFlow, CameraFrame, FrameShape};
use tessera_sources::{FrameBuffers, Source, SourceOptions, SourceSpec};
use tessera_surface::Grid;
use tessera_transport::{Layout, Link, Loan, SlicePublisher, registered_runs};

/// Frames of the room that it sends.
pub(super) const FRAMES: u64 = 40;
/// The frame with which relocalisation is asked for, by a camera that asks.
pub(super) const ASKED_AT: u64 = 12;

/// The first image behind the pause of a camera that jumps.
pub(super) const AFTER_PAUSE: u64 = 2020;

/// Tells [`a_camera`] that it is one: `run ring mode camera-file`.
const CAMERA_VARIABLE: &str = "TESSERA_TEST_CAMERA";

struct Publisher {
    port: SlicePublisher<CameraFrame, u16>,
    source: Box<dyn Source>,
    header: CameraFrame,
}

impl Publisher {
    fn send(&mut self, index: u64) {
        self.loaned(index, 0).send().unwrap();
    }

    /// Asks for relocalisation with that frame.
    fn ask(&mut self, index: u64) {
        self.loaned(index, CameraFrame::RELOCALISE).send().unwrap();
    }

    /// An image that is ready to be sent.
    fn loaned(&mut self, index: u64, kind: u32) -> Loan<CameraFrame, u16> {
        let Camera { width, height, .. } = *self.source.camera();
        let shape = FrameShape { width, height };
        let mut loan = self.port.loan(shape.payload_len()).unwrap();
        let (depth, colour) = shape.split_mut(loan.payload_mut()).unwrap();
        let info = self.source.read(index % FRAMES, &mut FrameBuffers { depth, colour }).unwrap();
        let has_colour = info.has_colour.into();
        // Ten seconds for each round through the room, which takes less.
        let stamp_nanos = info.stamp_nanos + (index / FRAMES) as i64 * 10_000_000_000;
        *loan.header_mut() = CameraFrame { index, stamp_nanos, kind, has_colour, ..self.header };
        loan
    }

    fn end(&mut self, n: u64) {
        let mut loan = self.port.loan(1).unwrap();
        *loan.header_mut() = CameraFrame { index: n, kind: 1, ..self.header };
        loan.send().unwrap();
    }
}

fn room_of(camera: &str) -> Box<dyn Source> {
    let options =
        SourceOptions { camera: Some(camera.into()), frames: Some(FRAMES), ..SourceOptions::default() };
    tessera_sources::open(&SourceSpec::parse("room"), &options).unwrap()
}

fn kill_self() {
    signal(std::process::id(), "KILL");
    std::thread::sleep(Duration::from_secs(60));
}

/// Not a test of its own: the process that other tests start.
#[test]
fn a_camera() {
    let Ok(words) = std::env::var(CAMERA_VARIABLE) else { return };
    let words: Vec<&str> = words.split(' ').collect();
    let [name, ring, mode, camera_file] = words[..] else { panic!("{words:?}") };
    let source = room_of(camera_file);
    let camera = source.camera().clone();
    let mut identity = None;
    wait_for("the run", || {
        let run = registered_runs().unwrap().into_iter().find(|run| run.entry.name == name);
        identity = run.filter(|run| run.is_alive).map(|run| run.entry.identity);
        identity.as_ref().is_some_and(|identity| identity.config_file.exists())
    });
    let layout = Layout {
        frame: FrameShape { width: camera.width, height: camera.height },
        grid: Grid { width: 1, height: 1, step: 1 },
        window: 4,
        recent: 0,
        ahead: 4,
        live: false,
        external: true,
    };
    let link = Link::open(&identity.unwrap(), &layout, "camera").unwrap();
    let flows = link.camera_flow_subscriber().unwrap();
    let header = CameraFrame {
        session: std::process::id().into(),
        width: camera.width,
        height: camera.height,
        ring_frames: ring.parse().unwrap(),
        colour_registered: 1,
        fx: camera.fx,
        fy: camera.fy,
        cx: camera.cx,
        cy: camera.cy,
        units_per_metre: camera.units_per_metre,
        ..CameraFrame::default()
    };
    let mut publisher = Publisher { port: link.camera_publisher().unwrap(), source, header };
    let (kind, at) = mode.split_once('=').unwrap_or((mode, ""));
    let at: Option<u64> = at.parse().ok();
    let mut flow = CameraFlow::default();
    let mut newest = || {
        flow = flows.newest().unwrap().unwrap_or(flow);
        flow
    };
    match kind {
        // Keeps everything, sends what is asked for, may die at a frame, and may ask at one.
        "ring" | "asking" => {
            let (mut epoch, mut next) = (0, 0);
            loop {
                let flow = newest();
                if flow.finished == 1 {
                    return;
                }
                if flow.epoch != epoch {
                    (epoch, next) = (flow.epoch, flow.send_from);
                }
                if next < flow.send_below && next <= FRAMES {
                    if next == FRAMES {
                        publisher.end(next);
                    } else if kind == "asking" && next == ASKED_AT {
                        publisher.ask(next);
                    } else {
                        publisher.send(next);
                    }
                    if Some(next) == at {
                        kill_self();
                    }
                    next += 1;
                } else {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
        }
        // Says that it keeps frames, and never sends one again.
        "forgetful" => {
            for index in 0.. {
                publisher.send(index);
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        // Sends each frame at its time, and never ends.
        "endless" => {
            for index in 0.. {
                publisher.send(index);
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        // Sends ten frames from `at`, each at its time, and says that it is over.
        "live" => {
            let first = at.unwrap_or(0);
            for index in first..first + 10 {
                publisher.send(index);
                std::thread::sleep(Duration::from_millis(20));
            }
            while newest().finished == 0 {
                publisher.end(first + 10);
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        // Asks with an image that others follow at once, while the sensor takes none; the test says when it
        // does not, and with which image.
        "overtaken" => {
            let beside = |name: &str| Path::new(camera_file).with_file_name(name);
            let mut next = 0;
            while !beside("ask").exists() {
                publisher.send(next);
                next += 1;
                std::thread::sleep(Duration::from_millis(20));
            }
            let asks: u64 = std::fs::read_to_string(beside("ask")).unwrap().parse().unwrap();
            publisher.ask(asks);
            (1..4).for_each(|k| publisher.send(asks + k));
            std::fs::write(beside("asked"), "").unwrap();
            // Further images would drive these out of the sensor's queue as long as it stands still.
            while !beside("go_on").exists() {
                std::thread::sleep(Duration::from_millis(5));
            }
            next = asks + 4;
            while newest().finished == 0 {
                std::thread::sleep(Duration::from_millis(20));
                if beside("enough").exists() {
                    publisher.end(next);
                } else {
                    publisher.send(next);
                    next += 1;
                }
            }
        }
        // Frames, and then all that a header can get wrong.
        "nonsense" => {
            for index in 0..10 {
                publisher.send(index);
                std::thread::sleep(Duration::from_millis(20));
            }
            let good = publisher.header;
            let bad = [
                CameraFrame { width: 1, ..good },
                CameraFrame { fx: good.fx + 1.0, ..good },
                CameraFrame { kind: 99, ..good },
                CameraFrame { has_colour: 7, ..good },
            ];
            for turn in 0.. {
                publisher.header = bad[turn % bad.len()];
                let Camera { width, height, .. } = *publisher.source.camera();
                let len = [1, FrameShape { width, height }.payload_len()][turn % 2];
                let mut loan = publisher.port.loan(len).unwrap();
                loan.payload_mut().fill(0x5a5a);
                *loan.header_mut() = CameraFrame { index: 10 + turn as u64, ..publisher.header };
                loan.send().unwrap();
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        // Frames, indices and stamps that were misread, a pause of the camera, and an end; all of it is sent until it
        // was heard.
        "jumping" => {
            let pause = Duration::from_millis(20);
            let send_as = |publisher: &mut Publisher, of: u64, index: u64, kind: u32| {
                let mut loan = publisher.loaned(of, kind);
                loan.header_mut().index = index;
                loan.send().unwrap();
                std::thread::sleep(pause);
            };
            // The sensor counts from the first that it hears; on a busy machine all would be over before.
            let mut first = 0;
            while newest().send_below != u64::MAX {
                send_as(&mut publisher, first, first, 0);
                first += 1;
            }
            for index in first..first + 10 {
                send_as(&mut publisher, index, index, 0);
            }
            for (index, kind) in [(1 << 40, 0), (900_000, 0), (1 << 62, 1), (u64::MAX, 1), (u64::MAX, 0)] {
                send_as(&mut publisher, first + 10, index, kind);
            }
            // Stamps that were misread, each between others.
            for index in first + 10..first + 20 {
                if let Some(stamp_nanos) = [i64::MAX, i64::MIN, 1 << 60].get((index - first - 10) as usize) {
                    let mut loan = publisher.loaned(index, 0);
                    loan.header_mut().stamp_nanos = *stamp_nanos;
                    loan.send().unwrap();
                    std::thread::sleep(pause);
                }
                send_as(&mut publisher, index, index, 0);
            }
            for index in first + AFTER_PAUSE..first + AFTER_PAUSE + 10 {
                send_as(&mut publisher, index, index, 0);
            }
            while newest().finished == 0 {
                publisher.end(first + AFTER_PAUSE + 10);
                std::thread::sleep(pause);
            }
        }
        other => panic!("{other}"),
    }
}

/// A camera's program, killed at the end of the test.
pub(super) struct Foreign(pub(super) Child);

impl Foreign {
    pub(super) fn start(run: &Run, ring: u32, mode: &str) -> Self {
        let camera = run.dir.path().join("camera.toml");
        let child = process_of(module_path!(), "a_camera")
            .env(CAMERA_VARIABLE, format!("{} {ring} {mode} {}", run.name, camera.display()))
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        Self(child)
    }
}

impl Drop for Foreign {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
