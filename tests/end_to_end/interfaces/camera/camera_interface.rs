//! The public services in other languages: the C header is that of the Rust types, and a program
//! in Python drives a live pipeline and reads its poses.

use crate::common::room;
use crate::requirements::missing;
use std::fmt::Write;
use std::mem::{align_of, offset_of, size_of};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tessera_messages::{CameraFlow, CameraFrame, Message, PoseMessage, RotationBits, StepTimes, UpBits};

const HEADER: &str = "examples/c/tessera.h";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A type of the header: its names, the file that defines it, and where its fields lie.
struct Type {
    name: &'static str,
    wire_name: Option<&'static str>,
    file: &'static str,
    size: usize,
    alignment: usize,
    fields: Vec<(&'static str, usize)>,
}

macro_rules! described {
    ($type:ident, $file:literal, $wire:expr, [$($field:ident),* $(,)?]) => {
        Type {
            name: stringify!($type),
            wire_name: $wire,
            file: $file,
            size: size_of::<$type>(),
            alignment: align_of::<$type>(),
            fields: vec![$((stringify!($field), offset_of!($type, $field))),*],
        }
    };
}

fn types() -> [Type; 6] {
    [
        described!(
            RotationBits,
            "rotation.rs",
            None,
            [start_from_camera_xyzw, variance_rad2, bias_sigma_rad_per_s]
        ),
        described!(UpBits, "rotation.rs", None, [in_camera, sigma_rad]),
        described!(
            CameraFrame,
            "camera.rs",
            Some(CameraFrame::NAME),
            [
                session,
                index,
                stamp_nanos,
                kind,
                has_colour,
                width,
                height,
                ring_frames,
                colour_registered,
                fx,
                fy,
                cx,
                cy,
                units_per_metre,
                distortion,
                readout_s,
                depth_offset_m,
                rotation,
                up
            ]
        ),
        described!(CameraFlow, "camera.rs", Some(CameraFlow::NAME), [epoch, send_from, send_below, finished]),
        described!(
            StepTimes,
            "message.rs",
            None,
            [read_began, frame_sent, surface_began, surface_sent, align_began, pose_sent]
        ),
        described!(
            PoseMessage,
            "pose.rs",
            Some(PoseMessage::NAME),
            [
                index,
                stamp_nanos,
                state,
                n_correspondences,
                reason,
                odom_from_camera,
                world_from_odom,
                covariance,
                step_variance,
                times
            ]
        ),
    ]
}

/// A Rust type as C writes it: the word before the name, and what follows it.
fn in_c(rust: &str) -> (String, String) {
    if let Some(inside) = rust.strip_prefix('[') {
        let (element, n) = inside.strip_suffix(']').unwrap().rsplit_once("; ").unwrap();
        let (word, dimensions) = in_c(element);
        return (word, format!("[{n}]{dimensions}"));
    }
    let word = match rust {
        "u8" => "uint8_t",
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "i64" => "int64_t",
        "f64" => "double",
        other => return (format!("tessera_{other}"), String::new()),
    };
    (word.to_owned(), String::new())
}

/// The doc lines and fields of a struct, as its file has them.
fn definition(file: &str, name: &str) -> Vec<String> {
    let text = std::fs::read_to_string(root().join("shared/runtime/messages/src").join(file)).unwrap();
    let (before, after) = text.split_once(&format!("pub struct {name} {{\n")).unwrap();
    let (body, _) = after.split_once("\n}").unwrap();
    let is_head = |line: &&str| line.starts_with("///") || line.starts_with("#[");
    let mut head: Vec<&str> = before.lines().rev().take_while(is_head).collect();
    head.reverse();
    head.into_iter().filter(|line| line.starts_with("///")).chain(body.lines()).map(str::to_owned).collect()
}

fn header() -> String {
    let mut text = String::from(
        "/* Tessera's public services for C and C++: see docs/camera.md.\n   Made from the Rust types by tests/end_to_end/interfaces/camera/camera_interface.rs; \
         TESSERA_UPDATE=1 cargo test --test end_to_end camera_interface writes it. */\n\
         #ifndef TESSERA_H\n#define TESSERA_H\n\n#include <assert.h>\n#include <stddef.h>\n#include <stdint.h>\n",
    );
    for described in types() {
        let name = described.name;
        text.push('\n');
        if let Some(wire) = described.wire_name {
            let constant: String = name
                .chars()
                .enumerate()
                .flat_map(|(at, c)| (at > 0 && c.is_uppercase()).then_some('_').into_iter().chain([c]))
                .collect();
            writeln!(text, "#define TESSERA_{} \"{wire}\"", constant.to_uppercase()).unwrap();
        }
        let lines = definition(described.file, name);
        let (doc, body): (Vec<_>, Vec<_>) = lines.iter().partition(|line| line.starts_with("///"));
        doc.iter().for_each(|line| writeln!(text, "//{}", &line[3..]).unwrap());
        writeln!(text, "typedef struct tessera_{name} {{").unwrap();
        let mut fields = Vec::new();
        for line in body {
            let line = line.trim();
            if let Some(doc) = line.strip_prefix("///") {
                writeln!(text, "    //{doc}").unwrap();
                continue;
            }
            let (field, kind) = line.strip_prefix("pub ").unwrap().split_once(": ").unwrap();
            let (word, dimensions) = in_c(kind.trim_end_matches(','));
            writeln!(text, "    {word} {field}{dimensions};").unwrap();
            fields.push(field.to_owned());
        }
        writeln!(text, "}} tessera_{name};").unwrap();
        assert_eq!(fields, described.fields.iter().map(|(field, _)| *field).collect::<Vec<_>>(), "{name}");
        let assert = |left: String, right: usize| {
            format!("static_assert({left} == {right}, \"the layout of {name}\");\n")
        };
        text += &assert(format!("sizeof(tessera_{name})"), described.size);
        for (field, offset) in described.fields {
            text += &assert(format!("offsetof(tessera_{name}, {field})"), offset);
        }
        assert!(described.alignment == 8, "{name}");
    }
    text + "\n#endif\n"
}

#[test]
fn the_c_header_is_that_of_the_rust_types() {
    let (path, expected) = (root().join(HEADER), header());
    if std::env::var_os("TESSERA_UPDATE").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{HEADER} is not up to date: TESSERA_UPDATE=1 writes it");
    for (compiler, arguments) in [("cc", ["-std=c11", "-x", "c"]), ("c++", ["-std=c++17", "-x", "c++"])] {
        let mut command = Command::new(compiler);
        command.args(arguments).args(["-Wall", "-Wextra", "-Werror", "-fsyntax-only"]).arg(&path);
        match command.output() {
            Ok(output) => {
                assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            }
            Err(error) => missing("cc", format_args!("no {compiler}: {error}")),
        }
    }
}

/// A Python with the packages that the examples need; `None`, with the reason printed, without.
fn python() -> Option<PathBuf> {
    crate::common::python("camera", &["iceoryx2==0.10.0", "pillow"])
}

fn example(python: &Path, name: &str, arguments: &[&str]) -> Child {
    Command::new(python)
        .arg(root().join("examples/python").join(name))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn a_program_in_python_is_a_camera_and_another_reads_the_poses() {
    let Some(python) = python() else { return };
    let external = room().of(Path::new("external")).frames(30);
    let folder = external.dir.path().join("frames");
    crate::common::write_folder(&folder, &external.dir.path().join("camera.toml"), 30);
    let reference = room().of(&folder).frames(30);
    assert!(reference.finish().success());
    let folder = folder.display().to_string();

    let run = external.start();
    let poses = example(&python, "poses.py", &[&external.name]);
    let mut camera = example(&python, "publisher.py", &[&folder, &external.name, "--ring", "16"]);
    let run = run.wait_with_output().unwrap();
    if !run.status.success() {
        // Without a run nothing else ends it.
        camera.kill().unwrap();
        let camera = String::from_utf8(camera.wait_with_output().unwrap().stderr).unwrap();
        panic!("the camera's program says: {camera}\n{}", external.log());
    }
    let words = |child: Child| {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}\n{}", String::from_utf8_lossy(&output.stderr), external.log());
        String::from_utf8(output.stdout).unwrap()
    };
    words(camera);
    let poses = words(poses);
    external.assert_same_bytes(&reference, "sent by Python with a ring");
    // Python has the poses that the run wrote down; the last may overflow when it is slow.
    let online = String::from_utf8(external.output("trajectory_online.txt")).unwrap();
    let written: Vec<Vec<f64>> = online.lines().filter(|line| !line.starts_with('#')).map(numbers).collect();
    let mut n = 0;
    for line in poses.lines().filter(|line| line.contains(" tracking ")) {
        let read = numbers(&line.replace(" tracking", ""));
        let near = |row: &&Vec<f64>| (row[0] - read[0]).abs() < 1e-5;
        let row = written.iter().find(near).unwrap_or_else(|| panic!("{line}"));
        let difference = row.iter().zip(&read).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(difference < 2e-5, "{line} is not {row:?}");
        n += 1;
    }
    assert!(n >= 10, "{poses}");

    let asking = room().of(Path::new("external")).frames(30);
    let run = asking.start();
    let camera =
        example(&python, "publisher.py", &[&folder, &asking.name, "--ring", "16", "--relocalise-at", "9"]);
    assert!(run.wait_with_output().unwrap().status.success(), "{}", asking.log());
    words(camera);
    let states = String::from_utf8(asking.output("states.csv")).unwrap();
    let is_asked = |line: &&str| line.contains("a relocalisation was asked for");
    let rows: Vec<&str> = states.lines().filter(is_asked).collect();
    assert!(rows.len() == 1 && rows[0].starts_with("9,"), "{rows:?}");

    let live = room().of(Path::new("external")).frames(30);
    let run = live.start();
    let camera = example(&python, "publisher.py", &[&folder, &live.name]);
    assert!(run.wait_with_output().unwrap().status.success(), "{}", live.log());
    words(camera);
    assert!(live.log().contains("counts from"), "{}", live.log());
    assert_eq!(live.leftovers(), Vec::<PathBuf>::new());
}

/// A float image is twice as long as a loan: it was copied beyond its end.
#[test]
fn python_refuses_images_of_another_length_or_type() {
    let Some(python) = python() else { return };
    let program = "
import array, tessera_client
def refusal(*arguments):
    try:
        return len(tessera_client.pixels(*arguments))
    except (TypeError, ValueError) as error:
        return error
print(refusal('depth', bytes(24), 'H', (3, 4)))
print(refusal('depth', array.array('H', range(12)), 'H', (3, 4)))
print(refusal('depth', memoryview(bytes(24)).cast('H', (3, 4)), 'H', (3, 4)))
print(refusal('depth', memoryview(bytes(24)).cast('H', (4, 3)), 'H', (3, 4)))
print(refusal('depth', array.array('f', range(12)), 'H', (3, 4)))
print(refusal('depth', array.array('f', range(6)), 'H', (3, 4)))
print(refusal('depth', bytes(26), 'H', (3, 4)))
print(refusal('colour', bytes(35), 'B', (3, 4, 3)))
";
    let output = Command::new(python)
        .args(["-c", program])
        .env("PYTHONPATH", root().join("examples/python"))
        .output()
        .unwrap();
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    let expected = "24\n24\n24\n\
        depth has shape (4, 3), expected (3, 4)\n\
        depth holds values of format 'f', expected uint16\n\
        depth holds values of format 'f', expected uint16\n\
        depth has 26 bytes, expected 24\n\
        colour has 35 bytes, expected 36\n";
    assert_eq!(text, expected);
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().map(|word| word.parse().unwrap()).collect()
}
