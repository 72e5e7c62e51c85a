//! Messages of the manual whose situation another test makes.

/// Tests of bags that are damaged or odd.
const BAGS: &str = "../../shared/data/recording/src/tests/bags.rs";

/// Tests of exports for reconstruction from images and for planners.
const MODELS: &str = "promises/outputs/models.rs";

/// Tests of folders as other systems leave them.
const STRANGERS: &str = "../../shared/data/sources/src/folder/layouts/tests/strangers.rs";

/// Rows whose situation another test makes: a piece of the row, the test, and what it looks for.
pub(crate) const ELSEWHERE: [(&str, &str, &str); 36] = [
    ("no floor was seen", MODELS, "no floor was seen"),
    ("own program sent its frames", MODELS, "own program sent its frames"),
    ("frames has a colour image", MODELS, "frames has a colour image"),
    ("expected '#ROSBAG V2.0", BAGS, r#"contains("expected '#ROSBAG V2.0"#),
    ("expected a bag of ROS 2", BAGS, r#"contains("expected a bag of ROS 2")"#),
    ("is an SQLite database that was cut", BAGS, r#"contains("an SQLite database that was cut")"#),
    ("has a write-ahead log", BAGS, r#"contains("has a write-ahead log beside it")"#),
    ("/dev/shm has", "promises/bounds/small_machines.rs", r#"contains("/dev/shm has")"#),
    (
        "it sends is refused",
        "interfaces/camera/external.rs",
        r#"contains("what it sends is refused: frame ")"#,
    ),
    (
        "of the camera's images, the last",
        "interfaces/camera/external.rs",
        r#"contains("of the camera's images, the last: frame ")"#,
    ),
    ("its program is not there", "interfaces/camera/external.rs", "its program is not there"),
    (
        "it must keep its last",
        "interfaces/camera/external.rs",
        r#"contains("it must keep its last 8 frames")"#,
    ),
    ("in a new session", "interfaces/camera/external.rs", r#"matches("in a new session")"#),
    (
        "a relocalisation was asked for",
        "interfaces/camera/external.rs",
        r#"contains("a relocalisation was asked for")"#,
    ),
    (
        "views of long ago contradict the map",
        "promises/durability/submaps.rs",
        r#"contains("views of long ago contradict the map")"#,
    ),
    (
        "both saw what contradicts it",
        "../../shared/method/slam/src/map/cause/words.rs",
        "both saw what contradicts it",
    ),
    ("its index leaves out", "interfaces/camera/external.rs", r#"contains("its index leaves out")"#),
    (
        "cannot be proven to hold it",
        "../../shared/runtime/journal/src/lock.rs",
        "the_holder_is_ended_and_one_that_is_not_proven_is_left_alone",
    ),
    ("was not forced to disk", "promises/durability/power.rs", r#"contains("was not forced to disk")"#),
    ("newer frames had come", "../../processes/align/src/step.rs", "newer frames had come"),
    ("images of several cameras or takes", STRANGERS, "images of several cameras or takes?"),
    ("the map is mirrored", STRANGERS, "the map is mirrored"),
    ("nothing is compared", STRANGERS, "nothing is compared; do their clocks differ?"),
    ("the names of the images are no times", STRANGERS, "timestamps.txt is not read"),
    (
        "is at the other end of its quaternions",
        "../../shared/tools/outputs/src/verdict/tests.rs",
        "fit only if w is at the other end of its quaternions",
    ),
    (
        "a .klg has no camera",
        "../../shared/data/sources/src/klg/tests.rs",
        "a .klg has no camera in it, expected --camera FILE",
    ),
    ("fit only in a mirror", "../../shared/tools/outputs/src/verdict/tests.rs", "fit only in a mirror"),
    (
        "if it is the distance along the ray",
        "../../shared/data/frames/src/along_ray.rs",
        r#"contains("depth = \"distance\"")"#,
    ),
    (
        "the inverse of depth (disparity)",
        "../../shared/data/frames/src/along_ray.rs",
        r#"contains("the inverse of depth (disparity)")"#,
    ),
    (
        "expected times in microseconds",
        "../../shared/data/sources/src/folder/layouts/tests/polycam.rs",
        "step by 1, expected times in microseconds",
    ),
    (
        "far from the middle",
        "../../shared/data/frames/src/odd_camera.rs",
        "is it the camera of these images?",
    ),
    (
        "these look like millimetres",
        "../../shared/data/frames/src/decode/metres.rs",
        "floats from 870.5 to 2250",
    ),
    ("in the other byte order", "../../shared/data/frames/src/odd_depth.rs", "in the other byte order"),
    ("bit for bit", "../../shared/data/frames/src/odd_depth.rs", "frames 4 and 8 have the same"),
    (
        "is unlike a sensor's with",
        "../../shared/data/frames/src/depth_units.rs",
        "units_per_metre = 5000: 1000 is likely",
    ),
    (
        "is likely, not the camera's",
        "../../shared/data/frames/src/judge/focal.rs",
        "is likely, not the camera's 500 px",
    ),
];
