//! The run and the network together: one loop that looks at both.

use crate::arguments::Arguments;
use crate::carrier::{Carrier, NodeName};
use crate::error::Ros2Error;
use crate::input::Input;
use crate::map::MapSide;
use crate::network::Network;
use crate::open::open;
use crate::output::Output;
use crate::report::{Event, Report};
use crate::run::{Run, Started};
use crate::save::SaveMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tessera_messages::PoseMessage;
use tessera_transport::Subscriber;

/// Time between two looks at what came.
const POLL: Duration = Duration::from_millis(2);
/// Time between two looks whether a run is there.
const RUN_POLL: Duration = Duration::from_millis(50);
/// Time between two looks whether it goes on.
const ALIVE: Duration = Duration::from_millis(500);
/// Time between two messages of path and diagnostics.
const SLOW: Duration = Duration::from_secs(1);
/// Depth images that do not come for so long are missed.
const SILENCE: Duration = Duration::from_secs(2);
/// What was written last is on its way for so long.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// Joins run and network until the run is over, or until it is ended.
///
/// # Errors
/// Where either cannot be joined, or breaks.
pub(crate) fn bridge(arguments: &Arguments, is_stopped: &AtomicBool) -> Result<(), Ros2Error> {
    let report = Report::new(arguments.quiet);
    let network = Network::choose(arguments.domain, arguments.network, |name| std::env::var(name).ok())
        .map_err(Ros2Error::Arguments)?;
    let name = NodeName { path: arguments.namespace.clone(), is_humble: arguments.is_humble() };
    let mut carrier = open(arguments.carrier, &network, name)?;
    let carrier = &mut *carrier;
    for words in carrier.words().into_iter().chain(network.warning) {
        report.say(&words);
    }
    let input = Input::new(arguments, carrier)?;
    let map = MapSide::new(carrier, (&arguments.namespace, &arguments.grid_topic()), arguments.map())?;
    let save = SaveMap::new(carrier, &arguments.namespace)?;
    let output = Output::new(carrier, &arguments.namespace, !arguments.no_tf)?;
    carrier.introduce()?;
    let mut started =
        arguments.run.then(|| Started::start(&arguments.name, &arguments.run_arguments)).transpose()?;
    if let Some(run) = await_run(&arguments.name, started.as_mut(), is_stopped, &report)? {
        let mut bridge = Bridge {
            carrier,
            run,
            input,
            output,
            map,
            save,
            poses: None,
            report,
            n_dropped: 0,
            last_index: None,
            latency: None,
        };
        bridge.go(is_stopped)?;
        std::thread::sleep(LAST_WORDS);
    }
    started.map_or(Ok(()), |started| started.finish(is_stopped.load(Ordering::Relaxed)))
}

/// The run, once it is there; `None` where it is not waited for any more.
fn await_run(
    name: &str,
    mut started: Option<&mut Started>,
    is_stopped: &AtomicBool,
    report: &Report,
) -> Result<Option<Run>, Ros2Error> {
    let mut is_told = started.is_some();
    while !is_stopped.load(Ordering::Relaxed) {
        if let Some(run) = Run::join(name)? {
            report.say(&format!("joined the run {name}"));
            return Ok(Some(run));
        }
        if let Some(started) = &mut started
            && started.has_ended()?
        {
            return Ok(None);
        }
        if !is_told {
            report.say(&format!("waiting for the run {name}: tessera run external --name {name}"));
            is_told = true;
        }
        std::thread::sleep(RUN_POLL);
    }
    Ok(None)
}

struct Bridge<'a> {
    carrier: &'a mut dyn Carrier,
    input: Input,
    output: Output,
    map: MapSide,
    save: SaveMap,
    poses: Option<Subscriber<PoseMessage>>,
    report: Report,
    /// Frames that the run left out, as the gaps between its poses tell.
    n_dropped: u64,
    last_index: Option<u64>,
    /// From an image handed to the run to its pose, of the newest one.
    latency: Option<Duration>,
    /// Last: ports go before the node.
    run: Run,
}

impl Bridge<'_> {
    fn go(&mut self, is_stopped: &AtomicBool) -> Result<(), Ros2Error> {
        let (mut looked, mut slow) = (Instant::now(), Instant::now());
        while !is_stopped.load(Ordering::Relaxed) {
            match self.step() {
                // A run that ends takes its shared memory with it.
                Err(Ros2Error::Transport(_)) if !self.run.is_current()? => break,
                stepped => stepped?,
            }
            if looked.elapsed() >= ALIVE {
                looked = Instant::now();
                if !self.run.is_current()? {
                    break;
                }
                if let Err(error) = self.carrier.introduce() {
                    self.report.note(Event::Carrier, || error.to_string());
                }
                self.map.look(self.carrier, &self.run.entry, self.input.base());
                if self.poses.is_none() {
                    self.poses = self.run.guest.pose_subscriber()?;
                }
            }
            if slow.elapsed() >= SLOW {
                slow = Instant::now();
                self.tell()?;
            }
            std::thread::sleep(POLL);
        }
        if self.run.is_current()? {
            self.take_poses()?;
        }
        if !is_stopped.load(Ordering::Relaxed) {
            self.map.finish(&self.input.clock, &mut self.report)?;
        }
        self.report.say(&format!("the run {} is over", self.run.entry.name));
        self.tell()
    }

    fn step(&mut self) -> Result<(), Ros2Error> {
        self.take_poses()?;
        self.map.step(&self.input.clock, &mut self.report)?;
        self.save.step(&self.run.entry.run_dir, &mut self.report)?;
        self.input.step(self.carrier, &self.run.guest, &mut self.report)
    }

    /// Publishes all poses that came.
    fn take_poses(&mut self) -> Result<(), Ros2Error> {
        let Some(poses) = &self.poses else { return Ok(()) };
        while let Some(pose) = poses.receive()? {
            if let Err(refusal) = pose.validate() {
                self.report.note(Event::Malformed, || format!("pose: {refusal}"));
                continue;
            }
            // Published again after a death in the run.
            if self.last_index.is_some_and(|last| pose.index <= last) {
                continue;
            }
            self.input.clock.begin_after(pose.stamp_nanos);
            let gap = self.last_index.map_or(0, |last| pose.index.saturating_sub(last.saturating_add(1)));
            self.n_dropped += gap;
            self.last_index = Some(pose.index);
            if let Some(sender) = self.input.sender()
                && let Some(received_at) = sender.received_at(pose.stamp_nanos)
            {
                self.latency = Some(received_at.elapsed());
            }
            let Some(base) = self.input.base() else { continue };
            let stamp_nanos = self.input.clock.camera_nanos(pose.stamp_nanos);
            match self.output.publish_pose(&pose, base, stamp_nanos) {
                Err(Ros2Error::Carrier(error)) => self.report.note(Event::Carrier, || error.to_string()),
                other => other?,
            }
        }
        Ok(())
    }

    /// What is told now and then: path, diagnostics, and what cannot be joined.
    fn tell(&mut self) -> Result<(), Ros2Error> {
        for words in self.carrier.unmatched() {
            self.report.note(Event::Unmatched, || words);
        }
        let silent = match self.input.last_depth_at {
            Some(at) if at.elapsed() >= SILENCE => {
                Some(format!("no depth image for {:.0} s", at.elapsed().as_secs_f64()))
            }
            None => Some("waiting for the camera".to_owned()),
            Some(_) => None,
        };
        let values = self.values();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let now_nanos = i64::try_from(now.as_nanos()).unwrap_or(i64::MAX);
        let name = &self.run.entry.name;
        let told = self
            .output
            .publish_path()
            .and_then(|()| self.output.publish_diagnostics(name, silent, &values, now_nanos));
        match told {
            Err(Ros2Error::Carrier(error)) => {
                self.report.note(Event::Carrier, || error.to_string());
                Ok(())
            }
            other => other,
        }
    }

    fn values(&mut self) -> Vec<(String, String)> {
        let n_sent = self.input.sender().map_or(0, |sender| sender.n_sent());
        let mut values = vec![
            ("images received".to_owned(), self.input.n_depth.to_string()),
            ("images sent".to_owned(), n_sent.to_string()),
            ("poses".to_owned(), self.output.n_poses.to_string()),
            ("frames dropped by the run".to_owned(), self.n_dropped.to_string()),
        ];
        if let Some(latency) = self.latency {
            values.push(("latency ms".to_owned(), format!("{:.1}", latency.as_secs_f64() * 1e3)));
        }
        values.extend(self.report.totals().map(|(event, total)| (event.key().to_owned(), total.to_string())));
        values
    }
}
