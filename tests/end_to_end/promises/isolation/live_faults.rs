//! Live runs under faults: only the struck stage restarts, and one bad frame does not end a run.

use crate::common::{Run, room, signal, wait_for, write_images, write_lists};

fn has_output(run: &Run, stage: &str, pid: u32) -> bool {
    // The optimiser has nothing to put out unless it is asked.
    let word = if stage == "optimise" { "ready" } else { "first output" };
    run.log().lines().any(|line| line.contains(&format!("{stage}[{pid}] {word}")))
}

#[test]
fn after_a_kill_no_other_process_restarts() {
    let run = room().frames(100_000).with(&["--live"]);
    let mut child = run.start();
    let stages = ["sensor", "reconstruct", "align", "optimise"];
    let find = |stage: &str| {
        let mut found = None;
        wait_for("a stage at work", || {
            let pids = run.pids_of(stage);
            found = pids.into_iter().find(|&pid| has_output(&run, stage, pid));
            found.is_some()
        });
        found.unwrap()
    };
    for struck in stages {
        let before = stages.map(find);
        let victim = before[stages.iter().position(|stage| *stage == struck).unwrap()];
        signal(victim, "KILL");
        wait_for("the end of the struck stage", || !run.pids_of(struck).contains(&victim));
        let after = stages.map(find);
        for ((stage, before), after) in stages.iter().zip(before).zip(after) {
            assert_eq!(
                before == after,
                *stage != struck,
                "{stage} after the death of {struck}\n{}",
                run.log()
            );
        }
    }
    signal(child.id(), "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{}", run.log());
    assert_eq!(run.n_deaths(), stages.len(), "{}", run.log());
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}

/// A recording of the room with so much time between its frames that one can come again and
/// again before the next.
fn slow_recording(run: &Run, n_frames: u64, gap_s: f64) {
    recording(run, (0..n_frames).collect::<Vec<_>>().as_slice(), gap_s);
}

/// A recording of these images of the room.
fn recording(run: &Run, images: &[u64], gap_s: f64) {
    let folder = run.dir.path().join("recording");
    write_images(&folder, &run.dir.path().join("camera.toml"), images.iter().max().unwrap() + 1);
    write_lists(
        &folder,
        (0..).zip(images).map(|(at, image)| (format!("{:.6}", f64::from(at) * gap_s), *image)),
    );
}

/// Seconds from the first blow at a stage until its last life was ready; `None`: it was not struck.
/// They hold the time in which a panic writes its backtrace, which is long beside other work.
fn recovery_s(log: &str, stage: &str) -> Option<f64> {
    let of_stage = |line: &&str, word: &str| line.contains(&format!(" {stage}[")) && line.contains(word);
    let struck = log.lines().find(|line| of_stage(line, "] struck by "));
    let ready = log.lines().rfind(|line| of_stage(line, "] ready"));
    let seconds = |line: &str| {
        let time = line.split(['T', 'Z']).nth(1).unwrap_or_else(|| panic!("a line without a time: {line}"));
        time.split(':').fold(0.0, |sum, part| 60.0 * sum + part.parse::<f64>().unwrap())
    };
    // The clock may pass midnight.
    Some((seconds(ready?) - seconds(struck?)).rem_euclid(86_400.0))
}

/// A run of five frames of which three are poison, each for another stage. The frames come so far
/// apart that the struck stage is back before the next one, however slow the machine is.
fn poisoned() -> Run {
    let mut gap_s = 4.0;
    loop {
        let run = room();
        slow_recording(&run, 5, gap_s);
        let folder = run.dir.path().join("recording");
        let plan = "sensor=read:1:panic*;reconstruct=received:2:panic*;align=received:3:panic*";
        let run = run.of(&folder).with(&["--live"]).with_faults(plan);
        assert!(run.finish().success());
        let log = run.log();
        // A frame that came too early for a stage may have spared the next one.
        let recovery_s = ["sensor", "reconstruct", "align"].map(|stage| recovery_s(&log, stage));
        let slowest_s = recovery_s.into_iter().map(|s| s.unwrap_or(f64::INFINITY)).fold(0.0, f64::max);
        if slowest_s < gap_s - 0.5 || gap_s > 50.0 {
            return run;
        }
        eprintln!("stages were back after {slowest_s} s, the next frame came after {gap_s} s: once more");
        gap_s *= 4.0;
    }
}

#[test]
fn poison_frames_are_left_out_and_counted() {
    let run = poisoned();
    let log = run.log();
    let n_deaths = |stage: &str| {
        log.lines().filter(|line| line.contains(&format!("] {stage} died: exit status 101"))).count()
    };
    // A frame comes to reconstruct again only behind a newer one, which it takes instead.
    assert_eq!(["sensor", "reconstruct", "align"].map(n_deaths), [3, 1, 3], "{log}");
    for (stage, frame) in [("sensor", 1), ("align", 3)] {
        let left_out =
            |line: &str| line.contains(&format!(" {stage} died")) && line.contains("the frame is left out");
        assert!(log.lines().any(|line| left_out(line) && line.ends_with(&format!("frame={frame}"))), "{log}");
    }
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let count = |key: &str| summary[key].as_u64().unwrap();
    // Frame 0 may come before the stages are ready to take it; frame 4 finds all of them alive.
    let processed = count("frames_processed");
    assert_eq!(processed + count("frames_dropped") + count("frames_missing"), 5, "{summary}");
    assert!((1..=2).contains(&processed), "{summary}");
    let states = String::from_utf8(run.output("states.csv")).unwrap();
    assert!(states.contains("it ended align again and again"), "{states}");
    let is_tracking = |frame: u64| {
        let row = states.lines().find(|line| line.starts_with(&format!("{frame},")));
        row.unwrap_or_else(|| panic!("no frame {frame} in {states}")).contains(",tracking,")
    };
    assert_eq!([1, 2, 3, 4].map(is_tracking), [false, false, false, true], "{states}");
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn a_pose_that_was_sent_is_recorded() {
    let run = room();
    // So far apart that each makes the one before it a keyframe.
    recording(&run, &[0, 5, 10, 15], 2.0);
    let folder = run.dir.path().join("recording");
    let run = run.of(&folder).with(&["--live"]).with_faults("align=published:3");
    assert!(run.finish().success(), "{}", run.log());
    assert_eq!(run.n_deaths(), 1, "{}", run.log());
    assert_eq!(run.output("live.posed"), 3u64.to_le_bytes(), "sent ahead of its record");
    let states = String::from_utf8(run.output("states.csv")).unwrap();
    let row = states.lines().find(|line| line.starts_with("3,"));
    assert!(row.is_some_and(|row| row.contains(",tracking,")), "{states}\n{}", run.log());
}

#[test]
fn a_poison_request_is_left_out_and_the_run_goes_on() {
    let run = room().with(&["--live"]).with_faults("optimise=solving:0:panic*");
    assert!(run.finish().success(), "{}", run.log());
    let log = run.log();
    assert_eq!(log.matches("] optimise died: exit status 101").count(), 3, "{log}");
    assert!(log.contains("the request is left out"), "{log}");
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    assert_eq!(summary["ended"], "finished", "{summary}");
    let count = |key: &str| summary[key].as_u64().unwrap();
    let n_frames = crate::common::FRAMES.parse::<u64>().unwrap();
    assert_eq!(
        count("frames_processed") + count("frames_dropped") + count("frames_missing"),
        n_frames,
        "{summary}"
    );
    assert!(count("frames_processed") > 0, "{summary}");
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}
