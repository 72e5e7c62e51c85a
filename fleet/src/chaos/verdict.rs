//! What must be the same bytes, whatever happened on the way.

use crate::copies::checked::RunFacts;
use crate::copies::surfaces::{SURFACES, first_surfaces};
use crate::error::FleetError;
use crate::robot::served::grid_of;
use crate::wire::request::{Growing, JOURNALS, SMALL_FILES};
use crate::wire::surfaces::wire_form;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use tessera_journal::{Chain, StoreView};
use tessera_stage::journal_slot;

/// The folder of a robot's one run at a base.
///
/// # Errors
/// Where there is none, or more than one: then something came twice.
pub fn copy_of(base: &Path, robot: &str) -> Result<PathBuf, FleetError> {
    let folder = base.join("robots").join(robot);
    let mut runs = std::fs::read_dir(&folder).map_err(FleetError::io("read", &folder))?.flatten();
    match (runs.next(), runs.next()) {
        (Some(run), None) => Ok(run.path()),
        (None, _) => Err(FleetError::Input(format!("{} has no run, expected one", folder.display()))),
        _ => Err(FleetError::Input(format!("{} has several runs, expected one", folder.display()))),
    }
}

/// How a copy differs from the run; `None`: in no byte. Of the store up to the last surface; of a copy without
/// the store, in the surfaces of the keyframes that the run keeps.
///
/// # Errors
/// Where a file of the run cannot be read.
pub fn difference(original: &Path, copy: &Path) -> Result<Option<String>, FleetError> {
    let small = SMALL_FILES.into_iter().filter(|name| original.join(name).is_file());
    let is_whole = !copy.join(SURFACES).is_file();
    let store = is_whole.then_some(Growing::Store.file());
    for name in small.chain(JOURNALS.map(Growing::file)).chain(store) {
        let path = original.join(name);
        let expected = std::fs::read(&path).map_err(FleetError::io("read", &path))?;
        let found = std::fs::read(copy.join(name)).unwrap_or_default();
        let is_same = match name == Growing::Store.file() {
            // Behind it a store may have what no record names. The base says that all surfaces are there.
            true => expected.starts_with(&found),
            false => expected == found,
        };
        if !is_same {
            let at = expected.iter().zip(&found).position(|(a, b)| a != b);
            let at = at.unwrap_or_else(|| expected.len().min(found.len()));
            let (path, n, expected) = (copy.join(name), found.len(), expected.len());
            let words =
                format!("{}: {n} bytes, expected {expected}; differs from byte {at} on", path.display());
            return Ok(Some(words));
        }
    }
    if is_whole { Ok(None) } else { surface_difference(original, copy) }
}

/// How the surfaces of a copy differ from those of the run; those of culled keyframes may be missing.
fn surface_difference(original: &Path, copy: &Path) -> Result<Option<String>, FleetError> {
    let mut facts = RunFacts::default();
    let path = original.join(Growing::Align.file());
    let align = std::fs::read(&path).map_err(FleetError::io("read", &path))?;
    let mut chain = Chain::new(Growing::Align.kind());
    while let Some(part) = chain.step(&align[chain.len_bytes() as usize..], &path)? {
        part.payload
            .map_or(Ok(()), |payload| facts.take(part.version, payload))
            .map_err(FleetError::Input)?;
    }
    let found = first_surfaces(copy, usize::MAX)?;
    let n_twice = found.len() - found.iter().map(|surface| surface.keyframe).collect::<BTreeSet<_>>().len();
    if n_twice > 0 {
        return Ok(Some(format!("{n_twice} surfaces are there twice")));
    }
    let grid = grid_of(original).map_err(FleetError::Input)?;
    let view = StoreView::open(&original.join(Growing::Store.file()))?;
    for (id, (slot, is_active)) in (0..).zip(facts.slots.iter().zip(&facts.is_active)) {
        let surface = found.iter().find(|surface| surface.keyframe == id);
        let stored = view.read(&journal_slot(slot))?;
        let expected = stored.and_then(|stored| wire_form(grid, &stored).ok());
        match (surface, expected) {
            (None, _) if *is_active => {
                return Ok(Some(format!("the surface of keyframe {id} is missing")));
            }
            (Some(surface), Some(expected)) if surface.bytes != expected => {
                return Ok(Some(format!("the surface of keyframe {id} is another one")));
            }
            _ => {}
        }
    }
    Ok(None)
}

/// Every file of a base's map.
///
/// # Errors
/// Where there is no map.
pub fn map_files(base: &Path) -> Result<BTreeMap<String, Vec<u8>>, FleetError> {
    let folder = crate::map::joint::map_folder(base);
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(&folder).map_err(FleetError::io("read", &folder))?.flatten() {
        let bytes = std::fs::read(entry.path()).map_err(FleetError::io("read", &folder))?;
        files.insert(entry.file_name().to_string_lossy().into_owned(), bytes);
    }
    Ok(files)
}

/// How the files of a map differ from those of the undisturbed one; `None`: in no byte.
pub fn map_difference(
    found: &BTreeMap<String, Vec<u8>>,
    undisturbed: &BTreeMap<String, Vec<u8>>,
) -> Option<String> {
    if !undisturbed.contains_key("map.ply") {
        return Some("the undisturbed base made no map.ply".into());
    }
    let names = found.keys().chain(undisturbed.keys());
    let differing = names.filter(|name| found.get(*name) != undisturbed.get(*name)).min()?;
    let len = |files: &BTreeMap<String, Vec<u8>>| match files.get(differing) {
        Some(bytes) => format!("{} bytes", bytes.len()),
        None => "not there".into(),
    };
    Some(format!("map/{differing}: {}, undisturbed {}", len(found), len(undisturbed)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_copies_and_maps_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let [run, copy] = ["run", "copy"].map(|name| dir.path().join(name));
        for folder in [&run, &copy] {
            std::fs::create_dir(folder).unwrap();
            for name in ["run.json", "align.journal", "optimise.journal", "keyframes.store"] {
                std::fs::write(folder.join(name), "abcdef").unwrap();
            }
        }
        std::fs::write(copy.join("keyframes.store"), "abc").unwrap();
        assert_eq!(difference(&run, &copy).unwrap(), None);
        std::fs::write(copy.join("keyframes.store"), "abd").unwrap();
        assert!(difference(&run, &copy).unwrap().unwrap().contains("keyframes.store: 3 bytes, expected 6"));
        std::fs::write(copy.join("align.journal"), "abcdefabcdef").unwrap();
        assert!(difference(&run, &copy).unwrap().unwrap().contains("differs from byte 6 on"));
        let map = |names: &[&str]| names.iter().map(|name| ((*name).to_owned(), vec![1])).collect();
        assert_eq!(map_difference(&map(&["map.ply"]), &map(&["map.ply"])), None);
        let more = map_difference(&map(&["map.ply", "old"]), &map(&["map.ply"])).unwrap();
        assert_eq!(more, "map/old: 1 bytes, undisturbed not there");
        assert!(map_difference(&map(&[]), &map(&[])).is_some());
    }
}
