//! One verdict: terminal, `summary.json`, log, exit code, report and comparison tell the same of a run.

use crate::common::{Run, room, signal};
use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Output};
use tessera_sources::{FrameBuffers, SourceOptions, SourceSpec};

/// Every second frame of the room, in which the camera turns.
const N_FRAMES: u64 = 180;

/// A recording of the room, whose camera file states a focal length that is wrong by this factor.
fn recording(folder: &Path, factor: f64) {
    let text = |fx: f64| {
        format!(
            "width = 160\nheight = 120\nfx = {fx}\nfy = {fx}\ncx = 79.5\ncy = 59.5\n\
             units_per_metre = 1000.0\ncolour_registered = true\n"
        )
    };
    let camera = folder.join("camera.toml");
    std::fs::write(&camera, text(131.25)).unwrap();
    let camera_file = Some(camera.to_str().unwrap().to_owned());
    let options =
        SourceOptions { camera: camera_file, frames: Some(2 * N_FRAMES), ..SourceOptions::default() };
    let source = tessera_sources::open(&SourceSpec::parse("room"), &options).unwrap();
    let (mut depth, mut colour) = (vec![0; 160 * 120], vec![0; 3 * 160 * 120]);
    let (mut depth_list, mut colour_list) = (String::new(), String::new());
    for name in ["depth", "rgb"] {
        std::fs::create_dir(folder.join(name)).unwrap();
    }
    for index in 0..N_FRAMES {
        source.read(2 * index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(160, 120, depth.clone()).unwrap();
        image.save(folder.join(format!("depth/{index}.png"))).unwrap();
        let image = image::RgbImage::from_raw(160, 120, colour.clone()).unwrap();
        image.save(folder.join(format!("rgb/{index}.png"))).unwrap();
        let seconds = index as f64 / 15.0;
        writeln!(depth_list, "{seconds:.6} depth/{index}.png").unwrap();
        writeln!(colour_list, "{seconds:.6} rgb/{index}.png").unwrap();
    }
    std::fs::write(folder.join("depth.txt"), depth_list).unwrap();
    std::fs::write(folder.join("rgb.txt"), colour_list).unwrap();
    std::fs::write(&camera, text(131.25 * factor)).unwrap();
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Compares all that is told of a run; its grade and reasons.
fn told(run: &Run, output: &Output, how: &str) -> (String, Vec<String>) {
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let grade = summary["verdict"]["grade"].as_str().unwrap().to_owned();
    let reasons = summary["verdict"]["reasons"].as_array().into_iter().flatten();
    let reasons: Vec<String> = reasons.map(|reason| reason["found"].as_str().unwrap().to_owned()).collect();
    let code = match grade.as_str() {
        "good" => 0,
        "doubtful" => 6,
        "failed" => 7,
        other => panic!("{other}"),
    };
    assert_eq!(output.status.code(), Some(code), "{grade}: {reasons:?}");
    let printed = String::from_utf8_lossy(&output.stdout).split_whitespace().collect::<Vec<_>>().join(" ");
    let page = String::from_utf8(run.output("report.html")).unwrap();
    assert!(page.contains(&format!(">{how}: {grade}</span>")), "{grade}, the page's badge");
    for reason in &reasons {
        assert!(printed.contains(reason.as_str()), "{reason}: {printed}");
        assert!(page.contains(&escaped(reason)), "{reason} is not on the page");
        assert!(run.log().contains(reason.as_str()), "{reason}: {}", run.log());
    }
    assert!(run.log().contains(&format!("verdict {grade}")), "{}", run.log());
    (grade, reasons)
}

/// Runs to the end, not quietly and with `--strict`.
fn strictly(run: &Run) -> Output {
    let command = run.command();
    let arguments = command.get_args().filter(|argument| *argument != "--quiet");
    Command::new(command.get_program()).args(arguments).arg("--strict").output().unwrap()
}

#[test]
fn all_that_is_told_of_a_run_is_one_verdict() {
    let healthy = room().frames(60);
    assert_eq!(told(&healthy, &strictly(&healthy), "done").0, "good");

    let wrong = tempfile::tempdir().unwrap();
    recording(wrong.path(), 0.8);
    let camera = wrong.path().join("camera.toml");
    let wrong_focal = room().frames(N_FRAMES).of(wrong.path()).with(&["--camera", camera.to_str().unwrap()]);
    let (grade, reasons) = told(&wrong_focal, &strictly(&wrong_focal), "done");
    assert_eq!(grade, "doubtful", "{reasons:?}");
    let focal = reasons.iter().filter(|reason| reason.starts_with("a focal length of about"));
    let focal: Vec<&String> = focal.collect();
    assert!(focal.len() == 1 && focal[0].ends_with("by features of turned views"), "{reasons:?}");
    let summary: serde_json::Value = serde_json::from_slice(&wrong_focal.output("summary.json")).unwrap();
    let found = &summary["focal"];
    let likely = found["likely_px"].as_f64().unwrap();
    assert!(found["is_doubted"] == true && focal[0].contains(&format!(" {likely:.0} px")), "{found}");
    // The right one, within what the judge states.
    let deviation = found["deviation_px"].as_f64().unwrap();
    assert!((likely - 131.25).abs() < 3.0 * deviation, "{found}");

    let plain = ["--set", "mapping.features.enabled=false", "--set", "simulation.sensor=exact"];
    let wall = room().frames(12).of(Path::new("wall")).with(&plain);
    let (grade, reasons) = told(&wall, &strictly(&wall), "done");
    assert_eq!(grade, "doubtful");
    assert!(reasons.iter().any(|reason| reason.contains("degenerate")), "{reasons:?}");

    let output = std::process::Command::new(env!("CARGO_BIN_EXE_tessera"))
        .arg("report")
        .args([healthy.out(), wrong_focal.out(), wall.out()])
        .arg("--out")
        .arg(wrong.path().join("page.html"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(wrong.path().join("page.html")).unwrap();
    let row = page.split("<tr>").find(|row| row.contains(">verdict<")).unwrap();
    for cell in ["done: good", "done: doubtful"] {
        assert!(row.contains(cell), "{row}");
    }
}

/// Broken and black images, and one frame alone.
#[test]
fn reasons_of_each_kind_are_told_alike() {
    let spoilt = tempfile::tempdir().unwrap();
    recording(spoilt.path(), 1.0);
    let image = |kind: &str, index: u64| spoilt.path().join(format!("{kind}/{index}.png"));
    (20..24).for_each(|index| std::fs::write(image("depth", index), "no image").unwrap());
    std::fs::write(image("rgb", 40), "no image").unwrap();
    let black = image::ImageBuffer::<image::Luma<u16>, _>::new(160, 120);
    (60..75).for_each(|index| black.save(image("depth", index)).unwrap());
    let camera = spoilt.path().join("camera.toml");
    let spoilt = room().frames(120).of(spoilt.path()).with(&["--camera", camera.to_str().unwrap()]);
    let alone = room().frames(1);
    let cases: [(&Run, &[&str]); 2] = [
        (&spoilt, &["missing or broken image", "went without their colour image", "hold too little depth"]),
        (&alone, &["one frame alone was processed"]),
    ];
    for (run, expected) in cases {
        let (grade, reasons) = told(run, &strictly(run), "done");
        assert_eq!(grade, "doubtful", "{reasons:?}");
        for words in expected {
            assert!(reasons.iter().any(|reason| reason.contains(words)), "{words}: {reasons:?}");
        }
    }
}

#[test]
fn a_quiet_run_that_is_doubtful_has_words_for_its_exit_code() {
    let plain = ["--set", "mapping.features.enabled=false", "--set", "simulation.sensor=exact", "--strict"];
    let output = room().frames(12).of(Path::new("wall")).with(&plain).command().output().unwrap();
    assert_eq!(output.status.code(), Some(6));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("--strict: verdict doubtful: ") && text.contains("degenerate"), "{text}");
    let good = room().frames(12).with(&["--strict"]).command().output().unwrap();
    assert!(good.status.success() && good.stderr.is_empty(), "{}", String::from_utf8_lossy(&good.stderr));
}

#[test]
fn a_run_that_goes_on_is_not_called_unfinished() {
    let run = room().frames(60).with_faults("align=computed:40:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("align");
    let report = run.tessera(&["report"]);
    assert!(report.status.success(), "{}", String::from_utf8_lossy(&report.stderr));
    let page = String::from_utf8(run.output("report.html")).unwrap();
    assert!(page.contains(">going on: good</span>"), "{}", &page[page.find("<header>").unwrap()..][..300]);
    assert!(!page.contains("tessera resume"));
    let verified = run.tessera(&["verify"]);
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
    signal(child.id(), "KILL");
    child.wait().unwrap();
    signal(stopped, "KILL");
    // Without its supervisor it is.
    assert!(run.tessera(&["report"]).status.success());
    let page = String::from_utf8(run.output("report.html")).unwrap();
    assert!(page.contains(">unfinished: doubtful</span>") && page.contains("tessera resume"));
}
