//! A run, a network of its own, and programs in Python that take part in it.

use crate::images::room;
use crate::program::{Listener, Program};
use crate::requirements::missing;
use serde_json::Value;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const PACKAGES: [&str; 5] =
    ["cyclonedds==11.0.1", "eclipse-zenoh==1.10.2", "rosbags==0.11.9", "numpy", "pillow"];
/// Cyclone on loopback, without multicast.
const CYCLONE: &str = "<CycloneDDS><Domain Id=\"any\"><General><Interfaces>\
    <NetworkInterface address=\"127.0.0.1\" multicast=\"false\"/></Interfaces>\
    <AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>\
    <MaxAutoParticipantIndex>20</MaxAutoParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers>\
    </Discovery></Domain></CycloneDDS>";

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Another number for each test and, as far as there are domains, for each process.
fn number() -> u32 {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    COUNT.fetch_add(1, Ordering::Relaxed)
}

/// A domain of one's own on this machine, for as long as it is kept, also beside tests of other processes: the images
/// of two cameras in one domain jump to and fro in time.
pub(crate) struct Domain {
    pub(crate) number: String,
    /// Bound to the domain's name; the system frees it with the process.
    _claim: UnixListener,
}

impl Domain {
    pub(crate) fn claim() -> Self {
        /// Domains whose ports lie below the ephemeral ones.
        const N: u32 = 100;
        let first = 8 * std::process::id() + number();
        for next in 0..N {
            let number = 1 + (first + next) % N;
            let name = SocketAddr::from_abstract_name(format!("tessera-test-domain-{number}")).unwrap();
            if let Ok(claim) = UnixListener::bind_addr(&name) {
                return Self { number: number.to_string(), _claim: claim };
            }
        }
        panic!("no domain is free");
    }
}

pub(crate) fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(180);
    while !holds() {
        assert!(Instant::now() < deadline, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Waits until the run in that folder has journaled several frames more.
pub(crate) fn wait_for_growth(out: &Path, what: &str) {
    let len = || out.join("align.journal").metadata().map_or(0, |meta| meta.len());
    let before = len();
    wait_for(what, || len() >= before + 6000);
}

/// The command, of the newer build.
pub(crate) fn tessera() -> Option<PathBuf> {
    let places = ["debug", "release"].map(|profile| root().join("target").join(profile).join("tessera"));
    let age = |path: &PathBuf| path.metadata().and_then(|meta| meta.modified()).ok();
    let found = places.into_iter().filter(|path| path.is_file()).max_by_key(age);
    if found.is_none() {
        missing("tessera", "it is not built: cargo build");
    }
    found
}

/// A Python with the packages that take part; `None`, with the reason printed, without.
pub(crate) fn python() -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_BIN_EXE_tessera-ros2")).parent()?.parent()?;
    let folder = target.join("python-ros2");
    let (python, done) = (folder.join("bin/python"), folder.join("packages.txt"));
    // One test installs, others wait for it.
    let lock = std::fs::File::create(target.join("python-ros2.lock")).ok()?;
    lock.lock().ok()?;
    if std::fs::read_to_string(&done).is_ok_and(|there| there == PACKAGES.join("\n")) {
        return Some(python);
    }
    let mut venv = Command::new("python3");
    venv.args(["-m", "venv", "--clear"]).arg(&folder);
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(PACKAGES);
    for mut command in [venv, install] {
        let failed = match command.output() {
            Ok(output) if output.status.success() => continue,
            Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
            Err(error) => error.to_string(),
        };
        let why = failed.lines().last().unwrap_or_default();
        missing("python", format_args!("no Python with {PACKAGES:?}: {why}"));
        return None;
    }
    std::fs::write(done, PACKAGES.join("\n")).ok()?;
    Some(python)
}

/// A ROS 2 network of one's own.
pub(crate) struct Network {
    domain: Domain,
    python: PathBuf,
    tessera: PathBuf,
    /// The router of Zenoh, where it is none of DDS.
    router: Option<String>,
    /// Folder with certificates, where links to the router are of TLS.
    keys: Option<PathBuf>,
    /// Configuration of Cyclone DDS on the other side; `None`: its own defaults.
    cyclone: Option<String>,
    /// Variables of ROS on this program's side, and whether the domain is one of them.
    variables: Vec<(String, String)>,
    is_domain_a_variable: bool,
    /// A network namespace of each side, `ours` and `theirs`, as words before a command.
    inside: [Vec<String>; 2],
}

impl Network {
    /// `None`, with the reason printed, where something is missing.
    pub(crate) fn new() -> Option<Self> {
        Some(Self {
            tessera: tessera()?,
            python: python()?,
            domain: Domain::claim(),
            router: None,
            keys: None,
            cyclone: Some(CYCLONE.to_owned()),
            variables: Vec::new(),
            is_domain_a_variable: false,
            inside: [Vec::new(), Vec::new()],
        })
    }

    /// The other side with that configuration, `None` its defaults; this one with these variables and the
    /// domain as one of them.
    pub(crate) fn between(self, cyclone: Option<&str>, variables: &[(&str, &str)]) -> Self {
        let owned = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
        Self {
            cyclone: cyclone.map(str::to_owned),
            variables: variables.iter().map(owned).collect(),
            is_domain_a_variable: true,
            ..self
        }
    }

    /// Each side on a machine of its own: words before a command.
    pub(crate) fn inside(self, inside: [Vec<String>; 2]) -> Self {
        Self { inside, ..self }
    }

    /// A program with words before it.
    fn command(&self, side: usize, program: &Path) -> Command {
        match self.inside[side].split_first() {
            None => Command::new(program),
            Some((first, rest)) => {
                let mut command = Command::new(first);
                command.args(rest).arg(program);
                command
            }
        }
    }

    /// The same over Zenoh.
    #[cfg(feature = "zenoh")]
    pub(crate) fn over(self, router: String, keys: Option<PathBuf>) -> Self {
        Self { router: Some(router), keys, ..self }
    }

    pub(crate) fn domain(&self) -> &str {
        &self.domain.number
    }

    pub(crate) fn python(&self) -> &Path {
        &self.python
    }

    fn script(&self, name: &str) -> Command {
        let mut command = self.command(1, &self.python);
        command.arg(root().join("ros2/tests/python").join(name));
        match &self.cyclone {
            Some(cyclone) => command.env("CYCLONEDDS_URI", cyclone),
            None => command.env_remove("CYCLONEDDS_URI"),
        };
        if let Some(keys) = &self.keys {
            command.env("TEST_KEYS", keys);
        }
        command
    }

    pub(crate) fn camera(&self, setup: &Setup, arguments: &[&str]) -> Program {
        let mut command = self.script("camera.py");
        command.arg(setup.frames()).arg(self.domain()).args(arguments);
        if let Some(router) = &self.router {
            command.args(["--router", router.as_str()]);
        }
        Program::start(command, true)
    }

    /// A whole run over so many images of the room: its folder, what the program printed, and what was heard.
    pub(crate) fn played(&self, n_frames: u64, heard: &[&str]) -> (Setup, String, Vec<Value>) {
        let setup = Setup::new(n_frames);
        room(setup.frames());
        let listener = self.listen(heard);
        let run = setup.start();
        let ros2 = self.join(&setup, &[]);
        let camera = self.camera(&setup, &[]);
        setup.finish(run);
        let words = ros2.finish();
        drop(camera);
        (setup, words, listener.finish())
    }

    /// A camera that waits for the answer to each image, and whose times jump ahead by so many seconds.
    pub(crate) fn waiting_camera(&self, setup: &Setup, jump_s: f64) -> Listener {
        let mut command = self.script("waiting_camera.py");
        command.arg(setup.frames()).arg(self.domain()).arg(jump_s.to_string());
        Listener(Program::start(command, true))
    }

    pub(crate) fn listen(&self, arguments: &[&str]) -> Listener {
        let mut command = self.script("listen.py");
        command.arg(self.domain()).args(arguments).args(&self.router);
        Listener(Program::start(command, true))
    }

    /// Runs a program to its end; what it prints.
    pub(crate) fn ask(&self, script: &str, words: &[&str]) -> Vec<Value> {
        let mut command = self.script(script);
        command.arg(self.domain()).args(&self.router).args(words);
        Listener(Program::start(command, true)).await_end()
    }

    /// A program that goes on beside the test.
    pub(crate) fn ask_beside(&self, script: &str, words: &[&str]) -> Listener {
        let mut command = self.script(script);
        command.arg(self.domain()).args(words);
        Listener(Program::start(command, true))
    }

    /// Calls a service once; the reply.
    pub(crate) fn call(&self, form: &str, service: &str) -> Value {
        let script = if self.router.is_some() { "call_zenoh.py" } else { "call.py" };
        let line = self.ask(script, &[form, service]).pop().expect("a reply");
        assert_eq!(line["same"], true, "{line}");
        line
    }

    /// As [`Self::join`], with the program starting the run itself.
    pub(crate) fn join_and_run(&self, setup: &Setup) -> Program {
        self.join_and_run_with(setup, &[])
    }

    /// A room that a camera sends, and a program that maps it in a run of its own.
    pub(crate) fn running(&self) -> (Setup, Program, Program) {
        let setup = Setup::new(100_000);
        room(setup.frames());
        let camera = self.camera(&setup, &[]);
        let ros2 = self.join_and_run(&setup);
        setup.wait_for_growth("the first frames");
        (setup, camera, ros2)
    }

    /// The same with arguments of the program's own.
    pub(crate) fn join_and_run_with(&self, setup: &Setup, own: &[&str]) -> Program {
        let run = setup.run_arguments();
        let run = run.iter().map(String::as_str);
        let arguments: Vec<&str> = own.iter().copied().chain(["--run", "--"]).chain(run).collect();
        self.join(setup, &arguments)
    }

    /// Starts `tessera-ros2`.
    pub(crate) fn join(&self, setup: &Setup, arguments: &[&str]) -> Program {
        let mut command = self.command(0, Path::new(env!("CARGO_BIN_EXE_tessera-ros2")));
        command.arg(&setup.name);
        if !self.is_domain_a_variable {
            command.args(["--domain", self.domain()]);
        }
        if self.router.is_some() {
            command.args(["--carrier", "zenoh"]);
        }
        command.args(arguments);
        for variable in ["ROS_LOCALHOST_ONLY", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"] {
            command.env_remove(variable);
        }
        command.env_remove("RMW_IMPLEMENTATION");
        if self.is_domain_a_variable {
            command.env("ROS_DOMAIN_ID", self.domain()).envs(self.variables.iter().cloned());
        }
        match (&self.router, &self.keys) {
            (Some(_), Some(keys)) => command.env("ZENOH_SESSION_CONFIG_URI", keys.join("session.json5")),
            (Some(router), None) => {
                command.env("ZENOH_CONFIG_OVERRIDE", format!("connect/endpoints=[{router:?}]"))
            }
            (None, _) => &mut command,
        };
        command.env("TESSERA_PROGRAM", &self.tessera);
        Program::start(command, false)
    }
}

/// A run with a name and a folder of its own.
pub(crate) struct Setup {
    pub(crate) name: String,
    dir: tempfile::TempDir,
    n_frames: String,
}

impl Setup {
    pub(crate) fn new(n_frames: u64) -> Self {
        let name = format!("test-ros2-{}-{}", std::process::id(), number());
        Self { name, dir: tempfile::tempdir().unwrap(), n_frames: n_frames.to_string() }
    }

    pub(crate) fn out(&self) -> PathBuf {
        self.dir.path().join("out")
    }

    pub(crate) fn frames(&self) -> &Path {
        self.dir.path()
    }

    /// Arguments of `tessera run external` behind its name.
    pub(crate) fn run_arguments(&self) -> Vec<String> {
        let out = self.out().display().to_string();
        let words = ["--quiet", "--frames", &self.n_frames, "--out", &out];
        let settings = ["--set", "surface.step=2", "--set", "run.camera_timeout_s=120"];
        words.into_iter().chain(settings).map(str::to_owned).collect()
    }

    pub(crate) fn start(&self) -> Program {
        self.start_with(&[])
    }

    /// The run with further arguments.
    pub(crate) fn start_with(&self, arguments: &[&str]) -> Program {
        let mut command = Command::new(tessera().unwrap());
        command.args(["run", "external", "--name", &self.name]).args(self.run_arguments()).args(arguments);
        Program::start(command, false)
    }

    /// Waits for the run's end; one that failed shows its log.
    pub(crate) fn finish(&self, run: Program) {
        let (status, words) = run.wait();
        let log = std::fs::read_to_string(self.out().join("log.txt")).unwrap_or_default();
        assert!(status.success(), "{status}: {words}\n{log}");
    }

    /// Waits until the run has journaled several frames more.
    pub(crate) fn wait_for_growth(&self, what: &str) {
        wait_for_growth(&self.out(), what);
    }

    /// What is left of the run where runs are registered.
    pub(crate) fn leftovers(&self) -> Vec<String> {
        let runtime = std::env::var("XDG_RUNTIME_DIR").map(|dir| PathBuf::from(dir).join("tessera"));
        let folders = ["/dev/shm".into(), runtime.unwrap_or_default()];
        let items = folders.iter().flat_map(std::fs::read_dir).flatten().flatten();
        let names = items.map(|item| item.file_name().to_string_lossy().into_owned());
        names.filter(|name| name.contains(&self.name)).collect()
    }
}
