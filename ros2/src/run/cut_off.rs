//! The newest run of a name that was cut off, as by a robot that was turned off: it is gone on with.

use crate::run::folder_of;
use std::path::PathBuf;
use tessera_outputs::{Ended, read_statistics};
use tessera_stage::RunFiles;

/// The folder of the newest run of a name, its resets counted, where that run did not come to its end; `None`
/// where it did, or there is none.
pub(crate) fn cut_off(name: &str, arguments: &[String]) -> Option<PathBuf> {
    let is_there = |folder: &PathBuf| RunFiles::new(folder).run_file().is_file();
    let first = Some(folder_of(name, arguments, None)).filter(is_there)?;
    let resets = (2..).map(|number| folder_of(name, arguments, Some(number))).take_while(is_there);
    let newest = resets.last().unwrap_or(first);
    let ended = read_statistics(&newest).ok()?.ended;
    (ended != Ended::Finished).then_some(newest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_outputs::{RunStatistics, write_statistics};

    #[test]
    fn the_newest_run_that_did_not_end_is_gone_on_with() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out").display().to_string();
        let arguments = vec!["--live".to_owned(), "--out".to_owned(), out.clone()];
        let make = |folder: &str, ended: Option<Ended>| {
            let folder = std::path::Path::new(folder);
            std::fs::create_dir_all(folder).unwrap();
            std::fs::write(RunFiles::new(folder).run_file(), "{}").unwrap();
            if let Some(ended) = ended {
                let statistics = RunStatistics { ended, ..RunStatistics::default() };
                write_statistics(folder, &statistics).unwrap();
            }
        };
        assert_eq!(cut_off("desk", &arguments), None);
        make(&out, None);
        assert_eq!(cut_off("desk", &arguments), Some(out.clone().into()));
        make(&out, Some(Ended::Finished));
        assert_eq!(cut_off("desk", &arguments), None);
        // After two resets.
        make(&format!("{out}-2"), Some(Ended::Finished));
        make(&format!("{out}-3"), Some(Ended::Interrupted));
        assert_eq!(cut_off("desk", &arguments), Some(format!("{out}-3").into()));
        make(&format!("{out}-3"), Some(Ended::Finished));
        assert_eq!(cut_off("desk", &arguments), None);
        let without = vec!["--live".to_owned()];
        assert_eq!(folder_of("desk", &without, Some(4)), PathBuf::from("runs/desk-4"));
    }
}
