//! The command as its users meet it: help, exit codes, messages.

use std::path::Path;
use std::process::{Command, Output};

fn tessera(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).env_remove("RUST_BACKTRACE").output().unwrap()
}

/// Standard error of a command that must end with this exit code.
fn refusal(arguments: &[&str], code: i32) -> String {
    let output = tessera(arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(text.starts_with("tessera: "), "{text}");
    assert_eq!(text.matches("tessera: ").count(), 1, "an error is told once: {text}");
    text
}

fn stdout(arguments: &[&str]) -> String {
    let output = tessera(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// A trajectory file along x, one pose every tenth of a second.
fn write_trajectory(path: &Path, n: usize, scale: f64) {
    let row = |k: usize| {
        let (t, x) = (k as f64 / 10.0, k as f64 / 10.0);
        format!("{t:.6} {} {} 0 0 0 0 1\n", scale * x, 0.1 * x * x)
    };
    std::fs::write(path, (0..n).map(row).collect::<String>()).unwrap();
}

#[test]
fn help_has_examples_and_exit_codes() {
    let help = stdout(&["--help"]);
    assert!(help.contains("Exit codes:") && help.contains("Examples:"), "{help}");
    for command in [
        "run",
        "resume",
        "export",
        "evaluate",
        "status",
        "stage",
        "check",
        "calibrate",
        "ablate",
        "clean",
        "completions",
        "man",
    ] {
        assert!(help.contains(command), "{command} is not in the help");
        assert!(stdout(&[command, "--help"]).contains("Examples:"), "{command}");
    }
    assert_eq!(stdout(&["--version"]).trim(), concat!("tessera ", env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_arguments_end_with_2() {
    assert!(refusal(&["rum"], 2).contains("`tessera run FOLDER` runs a recording): 'rum'"));
    assert!(refusal(&["rnu"], 2).contains("did you mean `tessera run`?"));
    assert!(!refusal(&["fly"], 2).contains("did you mean"));
    assert!(refusal(&["run", "--frames", "-3"], 2).contains("invalid value '-3'"));
    assert!(refusal(&["run", "--frams", "3"], 2).contains("--frames"));
    assert!(refusal(&["run", "--frames", "many"], 2).contains("invalid value 'many'"));
    assert!(refusal(&["run", "--frames", "0"], 2).contains("--frames is 0, expected at least 1"));
    assert!(refusal(&["run", "--name", "../x"], 2).contains("\"../x\" is not usable"));
    assert!(
        refusal(&["stage", "algin", "--run-dir", "x"], 2).contains("sensor, reconstruct, align, optimise")
    );
    assert!(refusal(&["stage", "align"], 2).contains("--run"));
    assert!(refusal(&["run", "room", "--set", "simulation.readout_s=-1"], 3).contains("readout_s is -1"));
    assert!(refusal(&["export", "no-such-run"], 2).contains("no run \"no-such-run\""));
    assert!(refusal(&["resume", "no-such-run"], 2).contains("no run \"no-such-run\""));
    assert!(refusal(&["status", "no-such-run"], 2).contains("no run \"no-such-run\""));
}

#[test]
fn several_sources_are_run_one_after_the_other_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let small = folder.path().join("small.toml");
    let numbers = "fx = 131.25\nfy = 131.25\ncx = 79.5\ncy = 59.5\nunits_per_metre = 1000.0\n";
    std::fs::write(&small, format!("width = 160\nheight = 120\n{numbers}")).unwrap();
    let small = small.display().to_string();
    let common = ["--frames", "4", "--camera", &small, "--out", &out];
    let run = |sources: &[&str], code: i32| {
        let output = tessera(&[&["run"], sources, &common].concat());
        let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert_eq!(output.status.code(), Some(code), "{text}");
        text
    };
    // One that is not there costs itself alone, and is the exit code.
    let text = run(&["room", "no/such/folder", "corridor"], 3);
    assert!(text.contains("no source") && text.contains("side by side: "), "{text}");
    let rows: Vec<&str> = text.lines().skip_while(|line| !line.contains("CPU ms/frame  frames/s")).collect();
    assert!(rows[1].contains("room-1") && rows[2].contains("corridor-1"), "{text}");
    let page = std::fs::read_to_string(folder.path().join("comparison.html")).unwrap();
    assert!(page.contains("Side by side") && page.contains("corridor-1"));
    // Folders that are there are left alone.
    run(&["room", "room"], 0);
    assert!(folder.path().join("room-3/trajectory.txt").is_file());
    assert!(refusal(&["run", "room", "wall", "--name", "x"], 2).contains("--name is for one source"));
    assert!(refusal(&["run", "room", "external"], 2).contains("external is for one source"));
}

#[test]
fn wrong_settings_name_key_value_and_rule() {
    let set = |pair: &str| refusal(&["run", "--set", pair], 2);
    assert!(
        set("surface.stepp=2")
            .contains("unknown key `surface.stepp`; the nearest known key is `surface.step`")
    );
    assert!(set("surface.step=3").contains("surface.step is 3, expected 1, 2, 4 or 8"));
    assert!(set("surface.max_depth_m=nan").contains("surface.max_depth_m is NaN, expected a number from"));
    assert!(set("surface.step=two").contains("`surface.step` is the text \"two\", expected a whole number"));
    assert!(
        set("experiment.surface.variant=mine")
            .contains("unknown variant `mine`, expected `tessera` or `paper`")
    );
    assert!(set("flow.window").contains("expected key=value"));
    assert!(
        refusal(&["run", "--config", "nowhere.toml"], 2)
            .contains("presets are default, paper, fast, onboard")
    );
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("mine.toml");
    std::fs::write(&file, "[surface]\nstep = 4\nedge_rul = \"or\"\n").unwrap();
    let message = refusal(&["run", "--config", file.to_str().unwrap()], 2);
    assert!(message.contains("mine.toml, line 3: unknown key `surface.edge_rul`"), "{message}");
}

#[test]
fn unusable_sources_end_with_3() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().to_str().unwrap();
    assert!(
        refusal(&["run", "no/such/folder"], 3)
            .contains("expected room, corridor, wall, house, building or a folder")
    );
    assert!(refusal(&["check", "no/such/folder"], 3).contains("no/such/folder"));
    assert!(refusal(&["run", folder], 3).contains("tessera: "));
    assert!(refusal(&["run", "room", "--camera", "kinect"], 3).contains("no camera"));
}

#[test]
fn an_output_folder_that_cannot_be_written_ends_with_2() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let out = file.join("out");
    let message = refusal(&["run", "room", "--frames", "2", "--out", out.to_str().unwrap()], 2);
    assert!(message.contains("file/out"), "{message}");
}

#[test]
fn evaluate_prints_the_standard_figures_and_more_beside_them() {
    let dir = tempfile::tempdir().unwrap();
    let (estimate, truth) = (dir.path().join("estimate.txt"), dir.path().join("truth.txt"));
    write_trajectory(&estimate, 50, 0.5);
    write_trajectory(&truth, 60, 1.0);
    let files = [estimate.to_str().unwrap(), truth.to_str().unwrap()];
    let text = stdout(&["evaluate", files[0], files[1]]);
    assert!(text.contains("ATE") && text.contains("50 pairs: 100.0 % of the estimate's 50 poses"), "{text}");
    let json = |extra: &[&str]| -> serde_json::Value {
        let arguments = [&["evaluate", files[0], files[1], "--json"], extra].concat();
        serde_json::from_str(&stdout(&arguments)).unwrap()
    };
    let plain = json(&[]);
    assert_eq!(plain["pairs"], 50);
    assert!(plain["ate_rmse_m"].as_f64().unwrap() > 0.1);
    assert!(plain["rpe_translation_rmse_m_per_s"].as_f64().unwrap() > 0.4);
    assert!(plain["rpe_rotation_rmse_deg_per_s"].is_number());
    let more = json(&["--scale", "--time-offset", "auto"]);
    assert_eq!(more["ate_rmse_m"], plain["ate_rmse_m"], "further figures stand beside, never instead");
    assert!(more["with_scale"]["scale"].as_f64().unwrap() > 1.0);
}

#[test]
fn evaluate_refuses_what_it_cannot_compare() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    write_trajectory(Path::new(&path("good.txt")), 20, 1.0);
    std::fs::write(path("nan.txt"), "0 0 0 0 0 0 0 1\n1 0 nan 0 0 0 0 1\n").unwrap();
    std::fs::write(path("late.txt"), "1000 0 0 0 0 0 0 1\n1001 0 0 0 0 0 0 1\n").unwrap();
    let message = refusal(&["evaluate", &path("good.txt"), &path("nan.txt")], 3);
    assert!(message.contains("nan.txt, line 2"), "{message}");
    assert!(refusal(&["evaluate", &path("none.txt"), &path("good.txt")], 3).contains("none.txt"));
    let message = refusal(&["evaluate", &path("good.txt"), &path("late.txt")], 3);
    assert!(message.contains("found 0 pairs"), "{message}");
}

/// Clocks of two computers: no pair as they are, and a path that tells where they belong.
#[test]
fn evaluate_tells_the_offset_of_stamps_that_have_no_pair_without_it() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let row = |k: u32, rate: f64, later_s: f64| {
        let t = f64::from(k) / rate;
        format!("{:.6} {:.9} {:.9} 0 0 0 0 1\n", t + later_s, (1.3 * t).sin(), (2.1 * t).cos())
    };
    let rows = |n: u32, rate: f64, later_s: f64| (0..n).map(|k| row(k, rate, later_s)).collect::<String>();
    std::fs::write(path("estimate.txt"), rows(120, 30.0, 1000.0)).unwrap();
    std::fs::write(path("truth.txt"), rows(800, 100.0, 1020.0)).unwrap();
    let files = [path("estimate.txt"), path("truth.txt")];
    let message = refusal(&["evaluate", &files[0], &files[1]], 3);
    assert!(message.contains("found 0 pairs") && !message.contains("moved by"), "{message}");
    let message = refusal(&["evaluate", &files[0], &files[1], "--time-offset", "auto"], 3);
    let moved = message.split_once("with stamps moved by ").expect("the offset").1;
    let offset_s: f64 = moved.split_once(" s: 120 pairs").expect("all pairs").0.parse().unwrap();
    assert!((offset_s - 20.0).abs() < 0.001, "{message}");
}

#[test]
fn completions_are_printed_for_each_shell() {
    for shell in ["bash", "zsh", "fish"] {
        assert!(stdout(&["completions", shell]).contains("tessera"), "{shell}");
    }
}

#[test]
fn each_command_has_its_manual_page() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("share/man1");
    stdout(&["man", folder.to_str().unwrap()]);
    let page = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert!(page("tessera.1").contains(".TH tessera 1"), "{}", page("tessera.1"));
    assert!(page("tessera-run.1").contains("frames"), "{}", page("tessera-run.1"));
    let file = dir.path().join("file");
    std::fs::write(&file, "").unwrap();
    assert!(refusal(&["man", file.to_str().unwrap()], 4).contains("file: "));
}

#[test]
fn check_looks_at_a_source() {
    let text = stdout(&["check", "wall"]);
    assert!(text.contains("640x480 px") && text.contains("median depth"), "{text}");
    let json: serde_json::Value = serde_json::from_str(&stdout(&["check", "room", "--json"])).unwrap();
    assert!(json["n_frames"].as_u64().unwrap() > 100);
}

#[test]
fn calibrate_prints_and_writes_a_camera_with_what_is_known_of_it() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("camera.toml");
    let out = file.to_str().unwrap();
    let text = stdout(&["calibrate", "room", "--frames", "60", "--fix", "k3", "--out", out]);
    assert!(text.contains("readout_s") && text.contains("+- ") && text.contains("k3"), "{text}");
    assert!(text.contains("the global scale of depth (units_per_metre) stays as it was"), "{text}");
    let written = std::fs::read_to_string(&file).unwrap();
    assert!(written.contains("# fx") && written.contains("depth_offset_m = "), "{written}");
    let start = ["calibrate", "room", "--frames", "2", "--camera", out, "--out", out];
    let message = refusal(&start, 3);
    assert!(message.contains("pairs of keyframes see the same surfaces, expected at least 3"), "{message}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), written, "a failed calibration writes nothing");
}

#[test]
fn calibrate_refuses_what_it_cannot_do_before_it_begins() {
    let dir = tempfile::tempdir().unwrap();
    let missing = dir.path().join("nowhere").join("camera.toml");
    let message = refusal(&["calibrate", "room", "--out", missing.to_str().unwrap()], 2);
    assert!(message.contains("there is no folder"), "{message}");
    let message = refusal(&["calibrate", "room", "--fix", "k7"], 2);
    assert!(message.contains("no such parameter, expected one of fx, fy, cx, cy"), "{message}");
    let small = dir.path().join("small.toml");
    std::fs::write(&small, "width = 320\nheight = 240\nfx = 262.0\nfy = 262.0\ncx = 160.0\ncy = 120.0\nunits_per_metre = 5000.0\n").unwrap();
    let out = dir.path().join("out.toml");
    let arguments =
        ["calibrate", "room", "--camera", small.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let message = refusal(&arguments, 3);
    assert!(message.contains("320x240 px, expected 640x480"), "{message}");
}
