//! Keyframes there, damaged, given up and forgotten.

use super::*;
use std::os::unix::fs::FileExt;
use std::time::Duration;
use tessera_journal::Store;
use tessera_messages::store_surface;

#[test]
fn a_damaged_keyframe_is_found_when_it_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let mut store = Store::open(&path, Duration::ZERO).unwrap();
    let grid = Grid { width: 4, height: 3, step: 4 };
    let (surface, _) = store_surface(grid, &[Vertex::default(); 12]);
    let slots: Vec<StoreSlot> = (0..3).map(|_| store_slot(&store.append(&surface, false).unwrap())).collect();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.write_all_at(&[1], slots[1].offset + 7).unwrap();
    let mut keyframes = StoredKeyframes::open(&path, grid).unwrap();
    for (id, slot) in slots.iter().enumerate() {
        keyframes.add_unread(id as u32, slot).unwrap();
    }
    assert_eq!(keyframes.vertices(0).len(), 12);
    assert!(keyframes.check().is_ok(), "what was not read was not looked at");
    assert_eq!(keyframes.vertices(1).len(), 12, "a surface without a measurement");
    let message = keyframes.check().unwrap_err().to_string();
    assert!(message.contains("checksum"), "{message}");
    let mut eager = StoredKeyframes::open(&path, grid).unwrap();
    eager.add(0, &slots[0]).unwrap();
    assert!(eager.add(1, &slots[1]).is_err());
}

#[test]
fn a_surface_that_was_given_up_has_no_measurement_and_is_named_where_it_is_needed() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let mut store = Store::open(&path, Duration::ZERO).unwrap();
    let grid = Grid { width: 4, height: 3, step: 4 };
    let (surface, _) = store_surface(grid, &[Vertex { flags_rgb: 7 << 8, ..Vertex::default() }; 12]);
    let mut keyframes = StoredKeyframes::open(&path, grid).unwrap();
    for id in 0..2 {
        let slot = store.append(&surface, false).unwrap();
        keyframes.add(id, &store_slot(&slot)).unwrap();
    }
    store.give_up(&journal_slot(&keyframes.slot(1).unwrap()), false).unwrap();
    assert_eq!(keyframes.load(1).unwrap(), vec![Vertex::default(); 12]);
    assert_eq!(keyframes.vertices(0).len(), 12);
    keyframes.check_held().unwrap();
    assert_eq!(keyframes.vertices(1), vec![Vertex::default(); 12]);
    assert!(keyframes.features(1).is_empty() && keyframes.features_once(1).is_empty());
    assert!(keyframes.stored(1).unwrap().is_none());
    keyframes.check().unwrap();
    let message = keyframes.check_held().unwrap_err().to_string();
    assert!(message.contains("keyframe 1 is needed"), "{message}");
}

#[test]
fn a_surface_that_its_maker_holds_is_the_one_that_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let mut store = Store::open(&path, Duration::ZERO).unwrap();
    let grid = Grid { width: 4, height: 3, step: 4 };
    let vertex = Vertex { position: [0.1, 0.2, 1.0], flags_rgb: 7 << 8, ..Vertex::default() };
    let (bytes, vertices) = store_surface(grid, &[vertex; 12]);
    assert_ne!(vertices[0], vertex, "it is rounded");
    let slot = store_slot(&store.append(&bytes, false).unwrap());
    let open = || {
        let mut keyframes = StoredKeyframes::open(&path, grid).unwrap();
        keyframes.add(0, &slot).unwrap();
        keyframes
    };
    let (mut held, read) = (open(), open());
    held.hold_newest(vertices, &bytes).unwrap();
    assert!(held.keyframes[0].surface.get().is_some());
    assert_eq!(held.vertices(0), read.vertices(0));
    assert_eq!(held.features(0), read.features(0));
    assert!(held.hold_newest(Vec::new(), &bytes[..3]).is_err());
}

/// The surface of a keyframe in [`stored`].
fn surface(id: u32) -> [Vertex; 4] {
    [Vertex { flags_rgb: id << 8, ..Vertex::default() }; 4]
}

/// So many keyframes of four vertices, none of them read.
fn stored(n: u32) -> (tempfile::TempDir, StoredKeyframes) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("s");
    let mut store = Store::open(&path, Duration::ZERO).unwrap();
    let grid = Grid { width: 2, height: 2, step: 4 };
    let mut keyframes = StoredKeyframes::open(&path, grid).unwrap();
    for id in 0..n {
        let slot = store.append(&store_surface(grid, &surface(id)).0, false).unwrap();
        keyframes.add_unread(id, &store_slot(&slot)).unwrap();
    }
    (dir, keyframes)
}

fn n_held(keyframes: &StoredKeyframes) -> usize {
    keyframes.keyframes.iter().filter(|keyframe| keyframe.is_held()).count()
}

#[test]
fn an_unused_surface_is_forgotten_and_read_again() {
    let n_keyframes = 2 * MOST_UNPACKED as u32;
    let (_dir, mut keyframes) = stored(n_keyframes);
    (0..n_keyframes).for_each(|id| assert_eq!(keyframes.vertices(id), surface(id)));
    assert_eq!(n_held(&keyframes), n_keyframes as usize);
    for _ in 0..12 {
        assert_eq!(keyframes.vertices(7), surface(7));
        keyframes.forget_unused(4);
    }
    assert_eq!(n_held(&keyframes), 1);
    assert_eq!(keyframes.load(8).unwrap(), surface(8));
    assert_eq!(n_held(&keyframes), 1);
    assert!(keyframes.load(n_keyframes).unwrap_err().to_string().contains("there are 128"));
    assert_eq!(keyframes.vertices(9), surface(9));
    assert!(keyframes.check().is_ok());
}

#[test]
fn single_looks_hold_a_bounded_number_of_surfaces() {
    let n_keyframes = 130;
    let (_dir, mut keyframes) = stored(n_keyframes);
    assert_eq!(keyframes.most_looked_at, MOST_LOOKED_AT_BYTES / 128);
    keyframes.most_looked_at = 100;
    let held = |keyframes: &StoredKeyframes| {
        assert_eq!(keyframes.n_held.load(Ordering::Relaxed), n_held(keyframes));
        n_held(keyframes)
    };
    for _ in 0..2 {
        (0..n_keyframes).for_each(|id| assert_eq!(*keyframes.vertices_once(id), surface(id)));
        assert_eq!(held(&keyframes), 100);
    }
    // Who needs one at hand gets it.
    assert_eq!(keyframes.vertices(n_keyframes - 1), surface(n_keyframes - 1));
    assert_eq!(held(&keyframes), 101);
    keyframes.forget_unused(1);
    keyframes.forget_unused(1);
    assert_eq!(held(&keyframes), 0);
    assert_eq!(*keyframes.vertices_once(3), surface(3));
    assert_eq!(held(&keyframes), 1);
    assert!(keyframes.check().is_ok());
}
