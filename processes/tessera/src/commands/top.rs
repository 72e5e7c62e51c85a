//! `tessera top`: a run as it goes on.

use crate::arguments::TopArguments;
use crate::commands::metrics::serve;
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::say;
use crate::top::{Watcher, draw};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyModifiers};
use std::io::IsTerminal;
use std::time::Duration;
use tessera_transport::{RunEntry, living_runs};

/// How long the first beats of all stages may take to come.
const FIRST_WORDS: Duration = Duration::from_secs(3);

/// Looks at a run until it is over, the view is ended, or the number of looks is reached.
pub(crate) fn top(arguments: &TopArguments) -> Result<Exit, CommandError> {
    let run = find(arguments.run.as_deref())?;
    if let Some(address) = arguments.metrics {
        let mut watcher = Watcher::open(&run, "metrics")?;
        return serve(address, &mut watcher, || Ok(run.is_alive()?)).map(|()| Exit::Done);
    }
    if !arguments.json && !std::io::stdout().is_terminal() {
        return Err(CommandError::arguments(
            "standard output is no terminal, expected --json or a terminal".to_owned(),
        ));
    }
    let mut watcher = Watcher::open(&run, "top")?;
    watcher.begin(FIRST_WORDS)?;
    let interval = Duration::from_secs_f64(arguments.interval);
    let mut terminal = match arguments.json {
        true => None,
        false => Some(ratatui::try_init().map_err(|error| CommandError::stage(error.to_string()))?),
    };
    let mut look = || -> Result<(), CommandError> {
        let mut n_looks = 0;
        while run.is_alive()? && arguments.count.is_none_or(|count| n_looks < count) {
            watcher.listen(interval)?;
            let snapshot = watcher.look();
            n_looks += 1;
            let Some(terminal) = &mut terminal else {
                let json = serde_json::to_string(&snapshot);
                say(&json.map_err(|error| CommandError::stage(error.to_string()))?);
                continue;
            };
            let drawn = terminal.draw(|frame| draw(frame, &snapshot)).map(drop);
            drawn.map_err(|error| CommandError::stage(error.to_string()))?;
            if wants_end() {
                break;
            }
        }
        Ok(())
    };
    let looked = look();
    if !arguments.json {
        ratatui::restore();
    }
    looked.map(|()| Exit::Done)
}

/// The run of that name or folder; the only one there is where none is named.
fn find(wanted: Option<&str>) -> Result<RunEntry, CommandError> {
    let alive = living_runs()?;
    let names = alive.iter().map(|run| run.name.as_str()).collect::<Vec<_>>().join(", ");
    let there_are =
        if names.is_empty() { "no run is going on".to_owned() } else { format!("there are: {names}") };
    match wanted {
        None if alive.len() == 1 => Ok(alive[0].clone()),
        None => Err(CommandError::arguments(format!(
            "expected the name of one run that is going on; {there_are}"
        ))),
        Some(wanted) => alive
            .into_iter()
            .find(|run| run_folder::is_of(run, wanted))
            .ok_or_else(|| CommandError::arguments(format!("no run {wanted:?} is going on; {there_are}"))),
    }
}

/// Whether a key was pressed that ends the view.
fn wants_end() -> bool {
    while event::poll(Duration::ZERO).unwrap_or(false) {
        let Ok(Event::Key(key)) = event::read() else { continue };
        let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_interrupt || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) {
            return true;
        }
    }
    false
}
