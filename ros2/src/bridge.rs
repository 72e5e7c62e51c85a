//! The run and the network together: one loop that looks at both.

use crate::arguments::Ros2Arguments;
use crate::camera::input::CameraInput;
use crate::carrier::{Carrier, NodeName};
use crate::error::Ros2Error;
use crate::joined::Joined;
use crate::map::MapSide;
use crate::network::open::{Waiting, open};
use crate::network::reach::Ros2Network;
use crate::network::remap::Remapped;
use crate::network::ros_time::RosTime;
use crate::poses::output::Output;
use crate::report::{Report, ReportEvent};
use crate::run::again::begin_anew;
use crate::run::owned::Started;
use crate::run::{JoinedRun, next_run};
use crate::services::initial_pose::InitialPose;
use crate::services::parameters::NodeParameters;
use crate::services::relocalise::Relocalise;
use crate::services::save::SaveMap;
use crate::services::trigger::{Response, Trigger};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two looks for a pose that is expected: a run has no event for its readers.
const POSE_POLL: Duration = Duration::from_micros(300);
/// Longest time between two looks at everything.
const POLL: Duration = Duration::from_millis(10);
/// Time between two looks whether a run is there.
const RUN_POLL: Duration = Duration::from_millis(50);
/// Time between two looks whether it goes on.
const ALIVE: Duration = Duration::from_millis(500);
/// Depth images that do not come for so many nanoseconds are missed.
const SILENCE_NANOS: i64 = 2_000_000_000;
/// Time in which a run takes notice that its camera has ended.
const MOST_TO_TELL: Duration = Duration::from_secs(10);
/// What was written last is on its way for so long.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// Joins run and network until the run is over, or until it is ended.
///
/// # Errors
/// Where either cannot be joined, or breaks.
pub(crate) fn bridge(arguments: &Ros2Arguments, is_stopped: &AtomicBool) -> Result<(), Ros2Error> {
    let report = Report::new(arguments.quiet);
    let network = Ros2Network::choose(arguments.domain, arguments.network, |name| std::env::var(name).ok())
        .map_err(Ros2Error::Arguments)?;
    let name = NodeName { path: arguments.namespace.clone(), is_humble: arguments.is_humble() };
    let carrier = open(arguments.carrier, &network, name, &Waiting { is_stopped, report: &report })?;
    let mut carrier = Remapped { carrier, names: arguments.remap.clone() };
    for words in carrier.words().into_iter().chain(network.warning) {
        report.say(&words);
    }
    let mut bridge = Bridge::new(arguments, &mut carrier, is_stopped, report)?;
    let mut started =
        arguments.run.then(|| Started::begin(&arguments.name, &arguments.run_arguments)).transpose()?;
    let mut name = started.as_ref().map_or(&arguments.name, |started| &started.name).clone();
    if started.as_ref().is_some_and(Started::is_taken) {
        bridge.report.say(&format!("the run {name} goes on: it is taken over"));
    }
    if let Some(folder) = started.as_ref().and_then(Started::resumed) {
        let folder = folder.display();
        bridge
            .report
            .say(&format!("the run {name} in {folder} was cut off: it goes on, by its own settings"));
    }
    // What a reset came to, once the run after it is there.
    let mut begun = Response { success: true, message: String::new() };
    loop {
        let run = bridge.await_run(&name, started.as_mut());
        bridge.answer_reset(&run, &begun)?;
        let Some(run) = run? else { break };
        let run_dir = run.entry.run_dir.clone();
        let is_over = bridge.follow(run, started.is_some())?;
        if let Some(started) = started.as_mut().filter(|_| !is_over || is_stopped.load(Ordering::Relaxed)) {
            started.begin_end(bridge.end_camera()?);
        }
        std::thread::sleep(LAST_WORDS);
        if is_over && started.is_some() && !is_stopped.load(Ordering::Relaxed) {
            // Ended, or another supervisor has taken the name: one that was cut off was still registered when its
            // successor began. The process that was started tells.
            continue;
        }
        let Some(ending) = started.take_if(|_| !is_over) else { break };
        let (next, run_arguments) = next_run(&arguments.name, &run_dir, &arguments.run_arguments);
        let before = format!("{name} is in {}", run_dir.display());
        begun = match bridge.await_end(ending) {
            Ok(()) => Response { success: true, message: format!("the run {next} has begun; {before}") },
            Err(error) => Response::refused(format!("the run {next} has begun; {before}, {error}")),
        };
        if is_stopped.load(Ordering::Relaxed) {
            bridge.answer_reset(&Ok(None), &begun)?;
            break;
        }
        started = Some(Started::start(&next, &run_arguments, &arguments.name)?);
        name = next;
    }
    let Some(mut started) = started else { return Ok(()) };
    if is_stopped.load(Ordering::Relaxed) && !started.is_ending() {
        started.begin_end(false);
    }
    started.finish()
}

struct Bridge<'a> {
    carrier: &'a mut dyn Carrier,
    is_stopped: &'a AtomicBool,
    input: CameraInput,
    output: Output,
    map: MapSide,
    save: SaveMap,
    reset: Trigger,
    relocalise: Relocalise,
    initial_pose: InitialPose,
    parameters: NodeParameters,
    time: RosTime,
    /// Time of the last depth image.
    last_depth_nanos: Option<i64>,
    report: Report,
}

impl<'a> Bridge<'a> {
    fn new(
        arguments: &Ros2Arguments,
        carrier: &'a mut dyn Carrier,
        is_stopped: &'a AtomicBool,
        report: Report,
    ) -> Result<Self, Ros2Error> {
        let namespace = &arguments.namespace;
        let input = CameraInput::new(arguments, carrier)?;
        let map = MapSide::new(carrier, (namespace, &arguments.grid_topic()), arguments.map())?;
        let save = SaveMap::new(carrier, namespace, arguments.map())?;
        let reset = Trigger::new(carrier, namespace, "reset")?;
        let relocalise = Relocalise::new(carrier, namespace)?;
        let initial_pose = InitialPose::new(carrier)?;
        let parameters = NodeParameters::new(carrier, arguments)?;
        let output = Output::new(carrier, namespace, !arguments.no_tf)?;
        let time = RosTime::new(carrier, arguments.use_sim_time)?;
        carrier.introduce()?;
        let last_depth_nanos = None;
        Ok(Self {
            carrier,
            is_stopped,
            input,
            output,
            map,
            save,
            reset,
            relocalise,
            initial_pose,
            parameters,
            time,
            last_depth_nanos,
            report,
        })
    }

    /// The run, once it is there; `None` where it is not waited for any more.
    fn await_run(
        &mut self,
        name: &str,
        mut started: Option<&mut Started>,
    ) -> Result<Option<JoinedRun>, Ros2Error> {
        let mut is_told = started.is_some();
        while !self.is_stopped.load(Ordering::Relaxed) {
            if let Some(run) = JoinedRun::join(name)? {
                self.report.say(&format!("joined the run {name}"));
                return Ok(Some(run));
            }
            if let Some(started) = &mut started
                && started.has_ended()?
            {
                return Ok(None);
            }
            if !is_told {
                self.report.say(&format!("waiting for the run {name}: tessera run external --name {name}"));
                is_told = true;
            }
            self.idle(name, &format!("waiting for the run {name}"))?;
        }
        Ok(None)
    }

    /// Answers those who asked for a reset: with what came of it, or with why there is no other run.
    fn answer_reset(
        &mut self,
        run: &Result<Option<JoinedRun>, Ros2Error>,
        begun: &Response,
    ) -> Result<(), Ros2Error> {
        match run {
            Ok(Some(_)) => self.reset.answer_all(begun, &mut self.report),
            Ok(None) => {
                self.reset.answer_all(&Response::refused("it was ended".to_owned()), &mut self.report)
            }
            Err(error) => {
                self.reset.answer_all(&Response::refused(error.to_string()), &mut self.report)?;
                std::thread::sleep(LAST_WORDS);
                Ok(())
            }
        }
    }

    /// Tells the run that its camera has ended; `false` where that cannot be told.
    fn end_camera(&mut self) -> Result<bool, Ros2Error> {
        let Some(sender) = self.input.sender() else { return Ok(false) };
        if !sender.end()? {
            return Ok(false);
        }
        // What was sent goes with the sender: it must have come before that ends.
        let told = Instant::now();
        while !sender.is_finished()? && told.elapsed() < MOST_TO_TELL {
            std::thread::sleep(POLL);
        }
        Ok(true)
    }

    /// Ends the run for a reset, and waits until its outputs are written.
    ///
    /// # Errors
    /// Where it failed.
    fn await_end(&mut self, mut ending: Started) -> Result<(), Ros2Error> {
        let name = ending.name.clone();
        self.report.say(&format!("reset: the run {name} ends"));
        self.input.begin_run();
        self.output.begin_run();
        self.map.begin_run();
        while !ending.has_ended()? {
            self.idle(&name, &format!("the run {name} ends for a reset"))?;
        }
        Ok(())
    }

    /// A moment without a run.
    fn idle(&mut self, name: &str, why: &str) -> Result<(), Ros2Error> {
        self.look_at_carrier()?;
        self.input.leave_out(&mut self.report);
        self.time.step(&mut self.report);
        self.parameters.step(&*self.carrier, self.time.now_nanos(), &mut self.report)?;
        self.reset.take(Some(&format!("{why}, and there is none to end")), &mut self.report)?;
        let refusal = format!("{why}, and there is none to ask");
        self.relocalise.refuse(&refusal, self.input.sender(), &mut self.report)?;
        if let Some(now_nanos) = self.time.next_second() {
            self.tell(name, Some(why.to_owned()), &[], now_nanos)?;
        }
        std::thread::sleep(RUN_POLL);
        Ok(())
    }

    /// Carries between the run and the network until the run is over, or this program is ended, which is
    /// answered with `true`; with `false` where a reset is asked for.
    fn follow(&mut self, run: JoinedRun, is_own: bool) -> Result<bool, Ros2Error> {
        let name = run.entry.name.clone();
        let mut joined = Joined::new(run);
        let (mut looked, mut is_over) = (Instant::now(), true);
        while !self.is_stopped.load(Ordering::Relaxed) {
            match self.step(&mut joined) {
                // A run that ends takes its shared memory with it.
                Err(Ros2Error::Transport(_)) if !joined.run.is_current()? => break,
                stepped => stepped?,
            }
            if looked.elapsed() >= ALIVE {
                looked = Instant::now();
                if !joined.run.is_current()? {
                    break;
                }
                self.look(&joined)?;
            }
            let refusal = (!is_own).then(|| {
                format!("this program did not start the run {name}: end it where it was started, and begin another one")
            });
            if self.reset.take(refusal.as_deref(), &mut self.report)? {
                is_over = false;
                break;
            }
            self.wait(&mut joined)?;
        }
        let refusal = format!("the run {name} has ended");
        self.relocalise.refuse(&refusal, self.input.sender(), &mut self.report)?;
        if joined.run.is_current()? {
            joined.take_poses(&mut self.input, &mut self.output, &self.time, &mut self.report)?;
        }
        if is_over && !self.is_stopped.load(Ordering::Relaxed) {
            self.map.finish(&self.input.clock, &mut self.report)?;
        }
        if is_over {
            self.report.say(&format!("the run {name} is over"));
        }
        if let Some(now_nanos) = self.time.now_nanos() {
            let values = self.values(&joined);
            self.tell(&name, None, &values, now_nanos)?;
        }
        Ok(is_over)
    }

    fn step(&mut self, joined: &mut Joined) -> Result<(), Ros2Error> {
        joined.look()?;
        joined.take_poses(&mut self.input, &mut self.output, &self.time, &mut self.report)?;
        self.map.step(&self.input.clock, &mut self.report)?;
        self.save.step(&joined.run.entry, self.input.base(), &mut self.report)?;
        self.time.step(&mut self.report);
        self.parameters.step(&*self.carrier, self.time.now_nanos(), &mut self.report)?;
        let n_depth = self.input.n_depth;
        self.input.step(self.carrier, &joined.run, self.time.waiting_nanos(), &mut self.report)?;
        if self.input.n_depth > n_depth {
            self.last_depth_nanos = self.time.now_nanos();
        }
        self.relocalise.step(&joined.run.entry.name, self.input.sender(), &mut self.report)?;
        self.initial_pose.step(self.output.map_from_base(), self.input.sender(), &mut self.report);
        let Some(now_nanos) = self.time.next_second() else { return Ok(()) };
        let silent = match self.last_depth_nanos.map(|at| now_nanos.saturating_sub(at)) {
            Some(nanos) if nanos >= SILENCE_NANOS => {
                Some(format!("no depth image for {:.0} s", nanos as f64 * 1e-9))
            }
            None => Some("waiting for the camera".to_owned()),
            Some(_) => None,
        };
        let values = self.values(joined);
        self.tell(&joined.run.entry.name, silent, &values, now_nanos)
    }

    /// Waits for a message of the network or, where one is expected, for a pose of the run.
    fn wait(&mut self, joined: &mut Joined) -> Result<(), Ros2Error> {
        let now = Instant::now();
        let until = now.checked_add(POLL).unwrap_or(now);
        while self.input.sender().is_some_and(|sender| sender.awaits_pose()) {
            std::thread::sleep(POSE_POLL);
            joined.take_poses(&mut self.input, &mut self.output, &self.time, &mut self.report)?;
            if self.carrier.wait(Duration::ZERO) || Instant::now() >= until {
                return Ok(());
            }
        }
        self.carrier.wait(until.saturating_duration_since(Instant::now()));
        Ok(())
    }

    /// Begins this program anew where the network is carried no more.
    fn look_at_carrier(&mut self) -> Result<(), Ros2Error> {
        if self.carrier.has_ended() { Err(begin_anew(&self.report)) } else { Ok(()) }
    }

    /// What is looked at now and then.
    fn look(&mut self, joined: &Joined) -> Result<(), Ros2Error> {
        self.look_at_carrier()?;
        if let Err(error) = self.carrier.introduce() {
            self.report.note(ReportEvent::Carrier, || error.to_string());
        }
        for words in self.carrier.unmatched() {
            self.report.note(ReportEvent::Unmatched, || words);
        }
        if self.time.now_nanos().is_none() {
            self.report
                .note(ReportEvent::NoClock, || "no /clock comes: no path and no diagnostics".to_owned());
        }
        self.map.look(self.carrier, &joined.run.entry, self.input.base());
        Ok(())
    }

    /// What is told now and then: path and diagnostics.
    fn tell(
        &mut self,
        name: &str,
        silent: Option<String>,
        values: &[(String, String)],
        now_nanos: i64,
    ) -> Result<(), Ros2Error> {
        let told = self
            .output
            .publish_path()
            .and_then(|()| self.output.publish_diagnostics(name, silent, values, now_nanos));
        match told {
            Err(Ros2Error::Carrier(error)) => {
                self.report.note(ReportEvent::Carrier, || error.to_string());
                Ok(())
            }
            other => other,
        }
    }

    fn values(&mut self, joined: &Joined) -> Vec<(String, String)> {
        let n_sent = self.input.sender().map_or(0, |sender| sender.n_sent());
        let mut values = vec![
            ("images received".to_owned(), self.input.n_depth.to_string()),
            ("images sent".to_owned(), n_sent.to_string()),
            ("poses".to_owned(), self.output.n_poses.to_string()),
            ("frames dropped by the run".to_owned(), joined.n_dropped.to_string()),
        ];
        let mut milliseconds = |key: &str, value: Option<f64>| {
            values.extend(value.map(|value| (key.to_owned(), format!("{value:.1}"))));
        };
        milliseconds("latency ms", joined.latency.map(|latency| latency.as_secs_f64() * 1e3));
        milliseconds("age ms", joined.age_ms);
        values.extend(self.map.verdict.iter().map(|verdict| ("verdict".to_owned(), verdict.clone())));
        values.extend(self.report.totals().map(|(event, total)| (event.key().to_owned(), total.to_string())));
        values
    }
}
