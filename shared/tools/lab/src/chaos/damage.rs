//! Damage to the files of a run between its processes' death and `resume`.

use super::schedule::{FaultKind, Random};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tessera_outputs::ToolError;
use tessera_stage::RunFiles;

const PAGE: usize = 4096;

/// A file as it was, and as it was left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FileDamage {
    pub(super) path: PathBuf,
    before: Vec<u8>,
    /// `None`: deleted.
    after: Option<Vec<u8>>,
}

/// Damages a file of a run; `None` where there is nothing to damage yet.
pub(super) fn damage(files: &RunFiles, kind: FaultKind, random: &mut Random) -> Option<FileDamage> {
    let any = [files.align_journal(), files.optimise_journal(), files.store()];
    let path = match kind {
        FaultKind::StoreCut | FaultKind::StoreLost => files.store(),
        _ => any.into_iter().nth(random.below(3) as usize)?,
    };
    let before = std::fs::read(&path).ok().filter(|bytes| !bytes.is_empty())?;
    let mut after = before.clone();
    let at = random.below(before.len() as u64) as usize;
    match kind {
        FaultKind::StoreLost => {
            std::fs::remove_file(&path).ok()?;
            return Some(FileDamage { path, before, after: None });
        }
        FaultKind::StoreCut => after.truncate(at),
        FaultKind::PageZeroed => {
            let page = at / PAGE * PAGE;
            after.iter_mut().skip(page).take(PAGE).for_each(|byte| *byte = 0);
        }
        _ => *after.get_mut(at)? ^= 1 << random.below(8),
    }
    write(&path, &after).ok()?;
    Some(FileDamage { path, before, after: Some(after) })
}

impl FileDamage {
    /// Whether the file is as it was left: it was refused, and nothing was written to it.
    pub(super) fn is_untouched(&self) -> bool {
        std::fs::read(&self.path).ok() == self.after
    }

    /// Puts the file back.
    pub(super) fn mend(&self) -> Result<(), ToolError> {
        write(&self.path, &self.before).map_err(|error| ToolError::write(&self.path, error))
    }
}

/// Forgets the damages to files that were written to since: the run went on with them, and what was before them is
/// older than the run.
pub(super) fn forget_overwritten(damages: &mut Vec<FileDamage>) {
    // From the newest on: what it found is what the one before it left.
    let mut found: BTreeMap<PathBuf, Option<Vec<u8>>> = BTreeMap::new();
    let mut kept: Vec<FileDamage> = Vec::new();
    for damage in damages.drain(..).rev() {
        let bytes = found.remove(&damage.path).unwrap_or_else(|| std::fs::read(&damage.path).ok());
        if bytes == damage.after {
            found.insert(damage.path.clone(), Some(damage.before.clone()));
            kept.push(damage);
        } else {
            found.insert(damage.path, bytes);
        }
    }
    kept.reverse();
    *damages = kept;
}

/// Writes in place: the file's owner and mode stay, and one that was deleted is its owner's alone.
fn write(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    use std::io::Write;
    use std::os::unix::fs::OpenOptionsExt;
    let mut file =
        std::fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(path)?;
    file.write_all(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_damage_is_done_and_undone() {
        let dir = tempfile::tempdir().unwrap();
        let files = RunFiles::new(dir.path());
        let kinds = FaultKind::ALL.map(|(_, kind)| kind).into_iter().filter(|kind| kind.is_damage());
        let mut n = 0;
        for (kind, seed) in kinds.flat_map(|kind| (0..20).map(move |seed| (kind, seed))) {
            for path in [files.align_journal(), files.optimise_journal(), files.store()] {
                std::fs::write(path, vec![7; 10_000]).unwrap();
            }
            let damage = damage(&files, kind, &mut Random::new(seed)).unwrap();
            assert!(damage.is_untouched() && damage.after.as_ref() != Some(&damage.before), "{kind:?}");
            damage.mend().unwrap();
            assert_eq!(std::fs::read(&damage.path).unwrap(), vec![7; 10_000]);
            n += 1;
        }
        assert_eq!(n, 80);
    }

    #[test]
    fn what_is_older_than_the_run_is_not_put_back() {
        let dir = tempfile::tempdir().unwrap();
        let files = RunFiles::new(dir.path());
        std::fs::write(files.store(), vec![7; 10_000]).unwrap();
        let mut random = Random::new(3);
        let kinds = [FaultKind::StoreCut, FaultKind::StoreCut, FaultKind::StoreLost];
        let damages = kinds.map(|kind| damage(&files, kind, &mut random).unwrap());
        let mut kept = damages.to_vec();
        forget_overwritten(&mut kept);
        assert_eq!(kept, damages, "one upon the other, with nothing written between");
        damages[2].mend().unwrap();
        kept.pop();
        forget_overwritten(&mut kept);
        assert_eq!(kept, damages[..2]);
        std::fs::write(files.store(), vec![8; 10_000]).unwrap();
        forget_overwritten(&mut kept);
        assert!(kept.is_empty());
    }
}
