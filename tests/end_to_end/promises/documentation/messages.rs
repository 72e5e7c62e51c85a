//! The table of messages in the manual: each row is a message that a user really gets.

use crate::common::{Run, room, signal};
use crate::promises::documentation::made_elsewhere::ELSEWHERE;
use crate::promises::documentation::small_recording::{CAMERA, N_FRAMES, N_PIXELS, Recording};
use crate::promises::documentation::told::Told;
use std::path::Path;
use std::process::Command;

/// The messages of the manual's page.
fn rows() -> Vec<String> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/messages.md");
    let text = std::fs::read_to_string(page).unwrap();
    let rows = text.lines().filter(|line| line.starts_with("| `"));
    let rows: Vec<String> = rows
        .map(|row| {
            let row = row.trim_start_matches("| ");
            let fence = if row.starts_with("``") { "``" } else { "`" };
            row[fence.len()..].split(fence).next().unwrap().trim().to_owned()
        })
        .collect();
    assert!(rows.len() > 40, "{rows:?}");
    rows
}

/// Whether a text has the pieces of a message, one behind the other.
fn has(text: &str, message: &str) -> bool {
    let mut rest = text;
    message.split('…').map(str::trim).all(|piece| match rest.find(piece) {
        Some(at) => {
            rest = &rest[at + piece.len()..];
            true
        }
        None => false,
    })
}

#[test]
fn every_message_of_the_manual_is_one_that_users_get() {
    let mut told = Told::default();
    of_arguments(&mut told);
    of_recordings(&mut told);
    of_mcap(&mut told);
    of_cameras(&mut told);
    of_running(&mut told);
    of_going_on(&mut told);
    of_frames(&mut told);
    let rows = rows();
    let is_told = |row: &&String| match ELSEWHERE.iter().find(|(piece, ..)| row.contains(piece)) {
        Some((_, file, words)) => {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/end_to_end").join(file);
            std::fs::read_to_string(path).unwrap().contains(words)
        }
        None => told.0.iter().any(|(_, text)| has(text, row)),
    };
    let untold: Vec<&String> = rows.iter().filter(|row| !is_told(row)).collect();
    assert!(untold.is_empty(), "no page says {untold:#?}");
    for (when, text) in told.0.iter().filter(|(_, text)| text.starts_with("tessera: ")) {
        assert!(rows.iter().any(|row| has(text, row)), "the manual lacks what {when:?} says: {text}");
    }
}

fn of_arguments(told: &mut Told) {
    let here = tempfile::tempdir().unwrap();
    let file = here.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    told.by(&["run", "--frams", "3"]);
    told.by(&["run", "--set", "surface.stepp=2"]);
    told.by(&["run", "--set", "surface.step=3"]);
    told.by(&["run", "--set", "surface.step=two"]);
    told.by(&["run", "--set", "flow.window"]);
    told.by(&["run", "--config", "nowhere.toml"]);
    told.by(&["report", "no-such-run"]);
    told.by(&["run", "--name", "a b"]);
    told.by(&["run", "--frames", "2", "--out", text(&file.join("out"))]);
    told.by(&["top", "no-such-run", "--json"]);
    // A copy with nothing beside it.
    let alone = here.path().join("tessera");
    // By another process: a copy that this one writes would be busy in whatever other tests start.
    let copied = Command::new("cp").arg(env!("CARGO_BIN_EXE_tessera")).arg(&alone).status().unwrap();
    assert!(copied.success());
    for command in ["view", "ros2", "uplink"] {
        let output = Command::new(&alone).args([command, "no-such-run"]).env("PATH", "").output().unwrap();
        told.add("a program built apart", String::from_utf8(output.stderr).unwrap());
    }
    let run = room().frames(6);
    assert!(run.finish().success());
    told.by_run(&run);
    let mesh = |name: &str| run.dir.path().join(name);
    told.by(&["export", text(&run.out()), "--mesh", text(&mesh("m.obj"))]);
    let small = ["--voxel-mm", "1", "--memory-mb", "1"];
    told.by(&[&["export", text(&run.out()), "--mesh", text(&mesh("m.ply"))], &small[..]].concat());
}

fn of_recordings(told: &mut Told) {
    let check = |told: &mut Told, change: &dyn Fn(&Recording)| {
        let recording = Recording::new();
        change(&recording);
        let out = recording.path("out");
        told.by(&["run", text(recording.dir.path()), "--quiet", "--out", text(&out)]);
    };
    told.by(&["check", "no/such/folder"]);
    told.by(&["run", "room", "--camera", "kinect"]);
    check(told, &|r| std::fs::remove_file(r.path("camera.toml")).unwrap());
    check(told, &|r| std::fs::remove_file(r.path("depth.txt")).unwrap());
    check(told, &|r| {
        ["depth.txt", "rgb.txt"].iter().for_each(|list| std::fs::remove_file(r.path(list)).unwrap());
        std::fs::remove_dir_all(r.path("depth")).unwrap();
    });
    check(told, &|r| {
        ["depth.txt", "rgb.txt"].iter().for_each(|list| std::fs::remove_file(r.path(list)).unwrap());
        std::fs::remove_dir_all(r.path("depth")).unwrap();
        std::fs::write(r.path("a.zip"), "PK\x03\x04").unwrap();
    });
    check(told, &|r| r.write("depth.txt", "# nothing\n"));
    check(told, &|r| {
        std::fs::remove_file(r.path("depth.txt")).unwrap();
        std::fs::remove_file(r.path("rgb.txt")).unwrap();
        for (index, number) in [0, 13, 55, 80, 140, 171].into_iter().enumerate().skip(1) {
            let (from, to) = (r.path(&format!("depth/{index}.png")), r.path(&format!("depth/{number}.png")));
            std::fs::copy(from, to).unwrap();
        }
        for index in 1..N_FRAMES {
            let path = r.path(&format!("depth/{index}.png"));
            std::fs::remove_file(path).unwrap();
        }
    });
    check(told, &|r| {
        std::fs::remove_file(r.path("camera.toml")).unwrap();
        r.write("a.json", r#"{"fx": 100, "fy": 100, "cx": 80, "cy": 60}"#);
        r.write("b.json", r#"{"fx": 110, "fy": 110, "cx": 80, "cy": 60}"#);
    });
    let found = |told: &mut Told, change: &dyn Fn(&Recording)| {
        let recording = Recording::new();
        change(&recording);
        let output = Command::new(env!("CARGO_BIN_EXE_tessera"))
            .args(["check", text(recording.dir.path())])
            .output()
            .unwrap();
        told.add("a recording", String::from_utf8([output.stdout, output.stderr].concat()).unwrap());
    };
    found(told, &|r| {
        r.write("depth.txt", "5.0 depth/0.png\n5.1 depth/1.png\n5.2 depth/2.png\n5.0 depth/3.png\n")
    });
    found(told, &|r| r.write("depth.txt", "0 depth/0.png\n0 depth/1.png\n0 depth/2.png\n"));
    found(told, &|r| r.write("groundtruth.txt", "0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n"));
    found(told, &|r| std::fs::remove_file(r.path("rgb.txt")).unwrap());
    found(told, &|r| {
        let line = |k: u64, n: u64| format!("{:.3} depth/{}.png\n", k as f64 / 30.0, k % n);
        r.write("depth.txt", &(0..14).map(|k| line(k, N_FRAMES)).collect::<String>());
        r.write("rgb.txt", &(0..8).map(|k| line(k, 1)).collect::<String>());
    });
    check(told, &|r| {
        let whole = std::fs::read(r.path("depth/0.png")).unwrap();
        for index in 0..N_FRAMES {
            let path = r.path(&format!("depth/{index}.png"));
            std::fs::write(path, &whole[..whole.len() / 2]).unwrap();
        }
    });
    check(told, &|r| r.write("camera.toml", &CAMERA.replace("width = 160", "width = 320")));
    check(told, &|r| r.write("camera.toml", &CAMERA.replace("5000.0", "50.0")));
    check(told, &|r| r.write("imu.txt", "0 5000 0 0\n1 90 0 0\n"));
    let recording = Recording::new();
    told.by(&["ablate", text(recording.dir.path())]);
    let out = recording.path("found.toml");
    told.by(&["calibrate", text(recording.dir.path()), "--out", text(&out), "--quiet"]);
    let path = |name: &str| text(&recording.path(name)).to_owned();
    recording.write("one.txt", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
    recording.write("other.txt", "100 0 0 0 0 0 0 1\n101 0 0 0 0 0 0 1\n");
    recording.write("turned.txt", "0 1 0 0 0 2 3 4\n");
    told.by(&["evaluate", &path("one.txt"), &path("other.txt")]);
    told.by(&["evaluate", &path("one.txt"), &path("turned.txt")]);
    recording.write("twice.txt", "1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
    recording.write("back.txt", "2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
    recording.write("kitti.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
    told.by(&["evaluate", &path("one.txt"), &path("twice.txt")]);
    told.by(&["evaluate", &path("one.txt"), &path("back.txt")]);
    told.by(&["evaluate", &path("one.txt"), &path("kitti.txt")]);
}

fn of_mcap(told: &mut Told) {
    use crate::common::ros::{Message, camera_info, image, write};
    let here = tempfile::tempdir().unwrap();
    let path = here.path().join("of.mcap");
    let check = |told: &mut Told, messages: &[Message], arguments: &[&str]| {
        write(&path, messages);
        told.by(&[&["check", text(&path)], arguments].concat());
    };
    let depth = |topic| image(topic, 1, "16UC1");
    let info = |model, distortion: &[f64]| camera_info("/depth/info", model, distortion);
    std::fs::write(&path, "RIFF").unwrap();
    told.by(&["check", text(&path)]);
    check(told, &[image("/rgb", 1, "rgb8")], &[]);
    check(told, &[depth("/left/depth"), depth("/right/depth")], &[]);
    check(told, &[depth("/depth")], &["--depth-topic", "/nothing"]);
    check(told, &[depth("/depth")], &[]);
    check(told, &[depth("/depth"), info("division", &[0.1; 4])], &[]);
    check(told, &[image("/depth", 1, "rgb8"), info("plumb_bob", &[])], &[]);
    let found = |told: &mut Told| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_tessera")).args(["check", text(&path)]).output().unwrap();
        told.add("a recording", String::from_utf8([output.stdout, output.stderr].concat()).unwrap());
    };
    let at = |seconds| image("/depth", seconds, "16UC1");
    write(&path, &[at(1), at(2), at(2), at(3), at(4), at(5), info("plumb_bob", &[])]);
    found(told);
    write(&path, &[depth("/depth"), info("plumb_bob", &[])]);
    let mut bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 20]).unwrap();
    found(told);
    // In the middle of the first image.
    bytes[700..740].fill(0x77);
    std::fs::write(&path, &bytes).unwrap();
    found(told);
}

fn of_cameras(told: &mut Told) {
    let here = tempfile::tempdir().unwrap();
    let out = here.path().join("out");
    let name = format!("test-{}-no-camera", std::process::id());
    let run = ["run", "external", "--quiet", "--name", &name, "--out", text(&out)];
    told.by(&[&run[..], &["--set", "run.camera_timeout_s=0.2"]].concat());
    told.by(&[&run[..], &["--skip", "3"]].concat());
    told.by(&["check", "external"]);
}

fn of_running(told: &mut Told) {
    // One stage stops itself, so that the run goes on until that was told.
    let run = room().with_faults("reconstruct=sent:5:stop;align=stored:3");
    let run = run.with(&["--set", "flow.hang_s=3"]);
    let mut child = run.start();
    run.wait_until_stopped("reconstruct");
    told.by(&["run", "--name", &run.name, "--frames", "2"]);
    told.by(&["top", &run.name]);
    assert!(child.wait().unwrap().success());
    told.add("a run with a stage that hung and one that was killed", run.log());
    told.by_run(&room().with_faults("align=computed:9:panic*"));
    let few = room();
    let command = few.command();
    let output = Command::new("sh")
        .args(["-c", "ulimit -n 40; exec \"$@\"", "sh"])
        .arg(command.get_program())
        .args(command.get_args())
        .output()
        .unwrap();
    told.add("few files", String::from_utf8(output.stderr).unwrap());
    // Another place than that of the map.
    let map = room().frames(20);
    assert!(map.finish().success());
    let out = map.out();
    told.by_run(&room().frames(4).of(Path::new("wall")).with(&["--map", text(&out)]));
}

fn of_going_on(told: &mut Told) {
    let run = room().frames(8);
    assert!(run.finish().success());
    let out = run.out();
    let resume = ["resume", text(&out), "--quiet"];
    let path = |name: &str| out.join(name);
    let journal = std::fs::read(path("align.journal")).unwrap();
    std::fs::write(path("align.journal"), &journal[..journal.len() - 9]).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(resume).output().unwrap();
    assert!(output.status.success());
    told.add("the log of a run that went on with a torn journal", run.log());
    for (at, byte) in [(0, b'X'), (8, 99), (100, 0xff)] {
        let mut damaged = journal.clone();
        damaged[at] = byte;
        std::fs::write(path("align.journal"), damaged).unwrap();
        told.by(&resume);
    }
    std::fs::write(path("align.journal"), &journal).unwrap();
    std::fs::rename(path("keyframes.store"), path("elsewhere")).unwrap();
    told.by(&resume);
    std::fs::rename(path("elsewhere"), path("keyframes.store")).unwrap();
    let file = std::fs::read_to_string(path("run.json")).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(file.contains(&version), "{file}");
    std::fs::write(path("run.json"), file.replace(&version, "\"version\": \"0.0.1\"")).unwrap();
    told.by(&resume);

    let run = room().with_faults("align=computed:20:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("align");
    signal(child.id(), "INT");
    signal(stopped, "CONT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let out = run.out();
    let status = Command::new(env!("CARGO_BIN_EXE_tessera")).args(["export", text(&out)]).output().unwrap();
    told.add("an interrupted run", String::from_utf8(status.stdout).unwrap());
}

/// Surfaces alone, and exact: along a wall they determine nothing.
const NO_TEXTURE: [&str; 4] = ["--set", "mapping.features.enabled=false", "--set", "simulation.sensor=exact"];

fn of_frames(told: &mut Told) {
    let states = |run: &Run| String::from_utf8(run.output("states.csv")).unwrap();
    let run = room().frames(12).of(Path::new("wall")).with(&NO_TEXTURE);
    assert!(run.finish().success());
    told.add("a wall", states(&run));
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let verdict = &summary["verdict"];
    assert_eq!(verdict["grade"], "doubtful", "{verdict}");
    assert!(verdict.to_string().contains("of 12 frames are degenerate"), "{verdict}");
    let recording = Recording::new();
    for index in 3..N_FRAMES - 1 {
        recording.write_depth(index, &vec![0; N_PIXELS]);
    }
    // Then something that is nowhere in the map: steps of 30 cm.
    let steps: Vec<u16> = (0..N_PIXELS).map(|pixel| 5000 + 1500 * ((pixel / 8 % 20) % 3) as u16).collect();
    recording.write_depth(N_FRAMES - 1, &steps);
    let run = room().of(recording.dir.path());
    assert!(run.finish().success());
    told.add("a covered camera", states(&run));
    let run = crate::common::lost_and_found();
    assert!(run.finish().success());
    told.add("a place never seen", states(&run));
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
