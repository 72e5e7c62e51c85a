//! A map that lies about its keyframes, among those of other runs: it spoils itself and nothing else.

use tessera_geometry::{Camera, PoseBits};
use tessera_registration::RegistrationSettings;
use tessera_slam::{Context, EdgeRecord, JointMap, KeyframeState, MappingSettings, StoreSlot, TrackerState};
use tessera_surface::SurfaceSettings;

fn context() -> Context {
    let camera = Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0);
    let (surface, registration) = (SurfaceSettings::default(), RegistrationSettings::default());
    Context::new(&camera, &surface, &registration, &MappingSettings::default())
}

fn keyframe(id: u32) -> KeyframeState {
    KeyframeState {
        id,
        session: 0,
        submap: 0,
        frame_index: u64::from(id),
        stamp_nanos: i64::from(id),
        world_from_camera: PoseBits::IDENTITY,
        velocity: [0.0; 6],
        slot: StoreSlot::default(),
        edges: Vec::new(),
        covariance: Vec::new(),
        up: None,
        place: Vec::new(),
        alike: Vec::new(),
        anchored_to: None,
    }
}

fn map(keyframes: Vec<KeyframeState>) -> TrackerState {
    let mut state = TrackerState::default();
    state.keyframes = keyframes;
    state
}

#[test]
fn what_a_map_names_beyond_its_keyframes_is_none_of_another_run() {
    let mut joint = JointMap::new(context());
    joint.add(&map((0..3).map(keyframe).collect()));
    let edge = |to| EdgeRecord { to, is_loop: true };
    let lying = KeyframeState {
        id: u32::MAX,
        session: u32::MAX,
        submap: 0,
        edges: vec![edge(0), edge(2), edge(u32::MAX), edge(u32::MAX - 1)],
        // With three keyframes before it, u32::MAX would wrap to keyframe 2 of the other run.
        alike: vec![u32::MAX, 1, u32::MAX - 2],
        anchored_to: Some(u32::MAX),
        ..keyframe(1)
    };
    joint.add(&map(vec![keyframe(0), lying]));
    let found = &joint.keyframes()[4];
    assert_eq!(joint.keyframes().iter().map(|k| k.id).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    assert_eq!(found.edges, [edge(3)]);
    assert_eq!(found.alike, [4]);
    assert_eq!(found.anchored_to, Some(4));
    assert_eq!(joint.keyframes_of(0), 0..3);
    // And the map can still be added to.
    joint.add(&map(vec![keyframe(0)]));
    assert_eq!(joint.keyframes()[5].id, 5);
}
