//! Programs beside a test, and what they print.

use crate::common::wait_for;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Of what a program printed, as much is shown where its test fails.
const SHOWN_BYTES: usize = 20_000;

/// A program that is killed when it is dropped, with what it printed.
pub(crate) struct Program {
    child: Child,
    printed: Option<JoinHandle<()>>,
    text: Arc<Mutex<String>>,
    /// The command, for who reads of a failure.
    name: String,
}

impl Program {
    /// Starts it; `is_output` takes what it prints, else its errors.
    pub(crate) fn start(mut command: Command, is_output: bool) -> Self {
        command.stdin(Stdio::null());
        if is_output {
            command.stdout(Stdio::piped());
        } else {
            command.stderr(Stdio::piped());
        }
        let mut child = command.spawn().unwrap();
        let from: Box<dyn Read + Send> = match is_output {
            true => Box::new(child.stdout.take().unwrap()),
            false => Box::new(child.stderr.take().unwrap()),
        };
        let name = format!("{} {command:?}", child.id());
        let text = Arc::<Mutex<String>>::default();
        let to = Arc::clone(&text);
        let printed = std::thread::spawn(move || {
            for line in BufReader::new(from).lines().map_while(Result::ok) {
                *to.lock().unwrap() += &(line + "\n");
            }
        });
        Self { child, printed: Some(printed), text, name }
    }

    /// Waits until it has printed this.
    pub(crate) fn await_words(&self, words: &str) {
        wait_for(words, || self.text.lock().unwrap().contains(words));
    }

    /// How often it has printed this.
    pub(crate) fn n_of(&self, words: &str) -> usize {
        self.text.lock().unwrap().matches(words).count()
    }

    /// All that it printed; it has ended.
    fn text(&mut self) -> String {
        self.printed.take().unwrap().join().unwrap();
        std::mem::take(&mut self.text.lock().unwrap())
    }

    /// What it printed, once it has ended by itself and well.
    pub(crate) fn finish(mut self) -> String {
        let mut status = None;
        wait_for("the end of a program", || {
            status = self.child.try_wait().unwrap();
            status.is_some()
        });
        let status = status.unwrap();
        let text = self.text();
        assert!(status.success(), "{status}: {text}");
        text
    }

    /// How it ended, whenever that is, and what it printed.
    pub(crate) fn wait(mut self) -> (ExitStatus, String) {
        (self.child.wait().unwrap(), self.text())
    }

    /// Its process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Tells it to end.
    pub(crate) fn terminate(&self) {
        signal(self.child.id(), "-TERM");
    }

    /// Stops it where it is.
    pub(crate) fn freeze(&self) {
        signal(self.child.id(), "-STOP");
    }

    /// Lets it go on.
    pub(crate) fn thaw(&self) {
        signal(self.child.id(), "-CONT");
    }

    fn end(mut self) -> String {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.text()
    }
}

/// Sends a signal to a process.
pub(crate) fn signal(pid: u32, name: &str) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

impl Drop for Program {
    /// A test that fails shows what its programs printed.
    fn drop(&mut self) {
        if std::thread::panicking() {
            let text = self.text.lock().unwrap_or_else(PoisonError::into_inner);
            let from = text.len().saturating_sub(SHOWN_BYTES);
            eprintln!("{}:\n{}", self.name, text.get(from..).unwrap_or(&text));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A listener to what the run publishes.
pub(crate) struct Listener(pub(crate) Program);

impl Listener {
    /// Messages of odometry that it has printed so far.
    pub(crate) fn n_odometry(&self) -> usize {
        self.n_of("/tessera/odom")
    }

    /// Messages of that topic.
    pub(crate) fn n_of(&self, topic: &str) -> usize {
        self.0.text.lock().unwrap().matches(&format!("{{\"topic\": {topic:?}")).count()
    }

    /// Ends it; all lines that it printed whole.
    pub(crate) fn finish(self) -> Vec<Value> {
        Self::lines(&self.0.end())
    }

    /// All lines, once it has ended by itself.
    pub(crate) fn await_end(self) -> Vec<Value> {
        Self::lines(&self.0.finish())
    }

    fn lines(text: &str) -> Vec<Value> {
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }
}
