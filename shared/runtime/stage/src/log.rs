//! One log for all processes of a run: whole lines, each with time, level, process and frame.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;
use tracing::{Event, Subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;

/// Environment variable with the level of the log, or levels by module.
const LEVEL_VARIABLE: &str = "TESSERA_LOG";

/// `2026-11-21T08:00:00.000000Z  INFO align[4711] frame=12 …`
struct LineFormat {
    process: &'static str,
    pid: u32,
}

impl<S, N> FormatEvent<S, N> for LineFormat
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> std::fmt::Result {
        SystemTime.format_time(&mut writer)?;
        write!(writer, " {:>5} {}[{}] ", event.metadata().level(), self.process, self.pid)?;
        context.field_format().format_fields(writer.by_ref(), event)?;
        writeln!(writer)
    }
}

/// Opens a log file for appending: lines of several processes do not mix.
fn open_log(path: &Path) -> std::io::Result<File> {
    OpenOptions::new().append(true).create(true).mode(0o600).open(path)
}

/// Sends this process's log, panics included, to the file. `TESSERA_LOG` sets the level (`info` by
/// default, for instance `debug`), or those of modules beside it (`tessera_align=debug`).
///
/// # Errors
/// Where the file cannot be opened.
pub fn start_log(path: &Path, process: &'static str) -> std::io::Result<()> {
    let file = Arc::new(open_log(path)?);
    let wanted = std::env::var(LEVEL_VARIABLE).ok().filter(|text| !text.is_empty());
    let parsed = wanted.as_deref().map(str::parse::<Targets>);
    let levels = match &parsed {
        Some(Ok(levels)) if levels.default_level().is_some() => levels.clone(),
        Some(Ok(levels)) => levels.clone().with_default(LevelFilter::INFO),
        Some(Err(_)) | None => Targets::new().with_default(LevelFilter::INFO),
    };
    let lines = tracing_subscriber::fmt::layer()
        .with_ansi(false)
        .event_format(LineFormat { process, pid: std::process::id() })
        .with_writer(file);
    // A second start in one process (tests) keeps the first log.
    let _ = tracing_subscriber::registry().with(lines).with(levels).try_init();
    if let (Some(text), Some(Err(error))) = (wanted, parsed) {
        tracing::warn!("{LEVEL_VARIABLE} is {text:?}, expected a level such as debug: {error}; info is used");
    }
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        tracing::error!("panicked: {}", info.to_string().replace('\n', " "));
        print(info);
    }));
    Ok(())
}

/// Writes a line into this process's log: a warning, or what is for the user to know.
pub fn log_line(is_warning: bool, text: &str) {
    match is_warning {
        true => tracing::warn!("{text}"),
        false => tracing::info!("{text}"),
    }
}

/// The last lines of a log that a process wrote, oldest first.
pub fn last_lines(path: &Path, process: &str, n: usize) -> Vec<String> {
    let text = tail(path, 32 << 10).unwrap_or_default();
    let mark = format!("{process}[");
    // The third word, and no other: a line may quote another one.
    let is_own = |line: &&str| line.split_whitespace().nth(2).is_some_and(|word| word.starts_with(&mark));
    let lines: Vec<&str> = text.lines().filter(is_own).collect();
    lines.iter().skip(lines.len().saturating_sub(n)).map(|line| line.to_string()).collect()
}

/// The end of a file.
pub(crate) fn tail(path: &Path, most_bytes: u64) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    let len = file.metadata()?.len();
    file.seek(SeekFrom::Start(len.saturating_sub(most_bytes)))?;
    let mut bytes = Vec::new();
    file.take(most_bytes).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_lines_are_those_of_one_process() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.txt");
        let quoted = "t WARN supervisor[1] died last_line=\"t INFO align[7] line 99\"\n";
        let text: String = (0..10)
            .map(|k| format!("t INFO {}[7] line {k}\n", if k % 2 == 0 { "align" } else { "sensor" }))
            .collect();
        std::fs::write(&path, text + quoted).unwrap();
        assert_eq!(last_lines(&path, "align", 2), ["t INFO align[7] line 6", "t INFO align[7] line 8"]);
        assert!(last_lines(&dir.path().join("none"), "align", 2).is_empty());
    }
}
