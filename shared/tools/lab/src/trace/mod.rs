//! `tessera run --trace FILE`: what all processes of a run did and when, for Perfetto.

mod chrome;
mod rows;

use chrome::{ChromeEvent, events};
use rows::Process;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tessera_outputs::ToolError;
use tessera_stage::{TraceEvent, read_trace};

/// The file as `chrome://tracing` and Perfetto read it.
#[derive(Serialize)]
struct TraceFile<'a> {
    #[serde(rename = "displayTimeUnit")]
    unit: &'static str,
    #[serde(rename = "traceEvents")]
    events: &'a [ChromeEvent],
}

/// The file of a trace, made before the run so that a wrong path is told at once.
#[derive(Debug)]
pub struct TraceOutput {
    path: PathBuf,
    file: File,
}

impl TraceOutput {
    /// Makes the file.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn create(path: &Path) -> Result<Self, ToolError> {
        let file = File::create(path)
            .map_err(|error| ToolError::Arguments(format!("--trace {}: {error}", path.display())))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Puts together what the processes wrote below `folder`, and removes that folder.
    ///
    /// # Errors
    /// Where a file cannot be read or written.
    pub fn write(self, folder: &Path) -> Result<(), ToolError> {
        let failed = |error: std::io::Error| {
            ToolError::Stage(format!("cannot write the trace {}: {error}", self.path.display()))
        };
        let (processes, marks) = read(folder).map_err(failed)?;
        let events = events(&processes, &marks);
        let mut writer = BufWriter::new(&self.file);
        serde_json::to_writer(&mut writer, &TraceFile { unit: "ms", events: &events })
            .map_err(std::io::Error::from)
            .and_then(|()| writer.flush())
            .map_err(failed)?;
        std::fs::remove_dir_all(folder).map_err(failed)
    }
}

/// What each process wrote, and the supervisor's marks.
fn read(folder: &Path) -> std::io::Result<(Vec<Process>, Vec<TraceEvent>)> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        files.insert(name, read_trace(&std::fs::read_to_string(&path)?));
    }
    let (mut processes, mut marks) = (Vec::new(), Vec::new());
    for (name, events) in files {
        let mut words = name.split('.');
        let stage = words.next().unwrap_or_default().to_owned();
        let pid = words.next().and_then(|word| word.parse().ok()).unwrap_or_default();
        if stage == "supervisor" {
            marks.extend(events);
        } else {
            processes.push(Process { stage, pid, events });
        }
    }
    Ok((processes, marks))
}
