//! Trace of a process for `tessera run --trace`: a line of JSON for each event.
//!
//! A process writes a file of its own, so none waits for another, and a killed one leaves what it
//! had done. Nothing else is changed by it.

use serde::{Deserialize, Serialize};
use std::fs::{DirBuilder, File, OpenOptions};
use std::io::{BufWriter, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::Path;

/// Environment variable with the folder of a run's traces; unset: nothing is traced.
pub const TRACE_VARIABLE: &str = "TESSERA_TRACE";

/// One event; times are nanoseconds of the monotonic clock.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TraceEvent {
    /// Work on a frame (or request) was taken up; the last one of a file was never done.
    Begun {
        /// Frame or request.
        index: u64,
        /// When.
        at: u64,
    },
    /// A frame (or request) from being taken up until its result was handed on.
    Done {
        /// Frame or request.
        index: u64,
        /// Beginning.
        from: u64,
        /// End.
        to: u64,
    },
    /// A step or phase of it.
    Part {
        /// Frame or request.
        index: u64,
        /// Name of the step or phase.
        name: String,
        /// Beginning.
        from: u64,
        /// End.
        to: u64,
    },
    /// Something that happened to a stage, as the supervisor saw it.
    Mark {
        /// The stage.
        stage: String,
        /// What happened.
        name: String,
        /// When.
        at: u64,
    },
}

/// Writes the events of one process.
#[derive(Debug)]
pub struct Tracer {
    file: BufWriter<File>,
}

impl Tracer {
    /// The tracer of a stage, where a trace was asked for. A trace that cannot be written
    /// stops no work: the log says so.
    pub fn from_environment(process: &str) -> Option<Self> {
        let folder = std::env::var_os(TRACE_VARIABLE)?;
        let tracer = Self::open(Path::new(&folder), process);
        tracer.map_err(|error| tracing::warn!("no trace of {process}: {error}")).ok()
    }

    /// A tracer that writes below `folder`.
    ///
    /// # Errors
    /// Where the file cannot be made.
    pub fn open(folder: &Path, process: &str) -> std::io::Result<Self> {
        DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
        let path = folder.join(format!("{process}.{}.jsonl", std::process::id()));
        let file = OpenOptions::new().append(true).create(true).mode(0o600).open(path)?;
        Ok(Self { file: BufWriter::new(file) })
    }

    /// Puts an event down; it is in the file after the next [`Self::flush`].
    pub fn note(&mut self, event: &TraceEvent) {
        let _ = serde_json::to_writer(&mut self.file, event);
        let _ = self.file.write_all(b"\n");
    }

    /// Hands what was put down to the system: it outlives this process.
    pub fn flush(&mut self) {
        let _ = self.file.flush();
    }
}

/// The events of a file, up to the first line that is torn.
pub fn read_trace(text: &str) -> Vec<TraceEvent> {
    text.lines().map_while(|line| serde_json::from_str(line).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_read_back_up_to_a_torn_line() {
        let dir = tempfile::tempdir().unwrap();
        let events = [
            TraceEvent::Begun { index: 3, at: 10 },
            TraceEvent::Part { index: 3, name: "search".into(), from: 11, to: 12 },
            TraceEvent::Done { index: 3, from: 10, to: u64::MAX },
        ];
        let mut tracer = Tracer::open(dir.path(), "align").unwrap();
        events.iter().for_each(|event| tracer.note(event));
        tracer.flush();
        let path = dir.path().join(format!("align.{}.jsonl", std::process::id()));
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(read_trace(&text), events);
        assert_eq!(read_trace(&text[..text.len() - 4]), events[..2]);
    }
}
