//! Answers of the base to requests of a run, as the uplink takes them: into a file of the run directory, for
//! the optimiser, which checks them against its own keyframes.

use crate::robot::served::Served;
use crate::wire::piece::Piece;
use tessera_journal::{Durability, write_atomically};
use tessera_outputs::read_settings;
use tessera_stage::{BaseAnswer, BaseContactWriter, RunFiles};

/// The run that answers are for.
#[derive(Default)]
pub struct AnswerInbox {
    run: Option<AskingRun>,
    contact: BaseContactWriter,
}

struct AskingRun {
    identity: u64,
    files: RunFiles,
    /// Whether it leaves its optimisations to a base.
    is_asking: bool,
}

impl AnswerInbox {
    /// Notes that the base asked for something, where the run leaves its optimisations to it.
    pub fn heard(&mut self, served: &mut Served) {
        let Some(run) = self.run(served).filter(|run| run.is_asking) else { return };
        let files = run.files.clone();
        // Without the note the run answers itself, which needs no word.
        let _ = self.contact.heard(&files);
    }

    /// Takes an answer for the run with this identity; says what became of it.
    pub fn take(&mut self, served: &mut Served, identity: u64, bytes: &[u8]) -> Piece {
        let Some(run) = self.run(served) else { return Piece::refused(0, "run.json cannot be read") };
        let taken = if run.identity != identity {
            Err(format!("run {identity:016x} is not here: it is {:016x}", run.identity))
        } else if !run.is_asking {
            Err("the run asks no base: run.base_wait_s is 0".to_owned())
        } else {
            BaseAnswer::from_bytes(bytes, identity).and_then(|_| {
                let path = run.files.base_answer();
                write_atomically(&path, Durability::Scratch, |writer| writer.write_all(bytes))
                    .map_err(|error| format!("cannot write base.answer: {error}"))
            })
        };
        match taken {
            Ok(()) => Piece::end(identity, bytes.len() as u64),
            Err(reason) => Piece::refused(run.identity, &reason),
        }
    }

    /// The run that is there now.
    fn run(&mut self, served: &mut Served) -> Option<&AskingRun> {
        let identity = served.current().ok()?;
        if self.run.as_ref().is_none_or(|run| run.identity != identity) {
            let files = RunFiles::new(served.folder());
            let is_asking = read_settings(&files).is_ok_and(|settings| settings.run.base_wait_s > 0.0);
            self.run = Some(AskingRun { identity, files, is_asking });
        }
        self.run.as_ref()
    }
}
