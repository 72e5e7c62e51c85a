//! Stages killed at random moments, from their first instruction on.
//!
//! `TESSERA_TEST_KILLS` sets how many kills there are at least (30 by default).

use crate::common::{Run, room, signal, wait_for};
use std::process::Command;
use std::time::Duration;
use tessera_numerics::SplitMix64;

/// A schedule that a seed repeats as far as the machine lets it.
struct Random(SplitMix64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0.next_u64() % n
    }
}

/// Kills stages of a run until it ends; answers how many.
fn disturb(run: &Run, random: &mut Random) -> u64 {
    let mut child = run.start();
    let mut n_kills = 0;
    loop {
        // Some lives are cut in their first moments; none of the stages is always the one.
        std::thread::sleep(Duration::from_millis(20 + random.below(500)));
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "after {n_kills} kills\n{}", run.log());
            return n_kills;
        }
        let pids = run.stage_pids();
        // One stage, sometimes two at once.
        for _ in 0..1 + random.below(4) / 3 {
            if pids.is_empty() {
                break;
            }
            let pid = pids[random.below(pids.len() as u64) as usize];
            n_kills +=
                u64::from(Command::new("kill").args(["-KILL", &pid.to_string()]).status().unwrap().success());
        }
    }
}

#[test]
fn lossless_runs_keep_their_bytes() {
    let least: u64 = std::env::var("TESSERA_TEST_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(30);
    let undisturbed = room().frames(300);
    assert!(undisturbed.finish().success());
    let mut random = Random(SplitMix64::new(20_261_121));
    let (mut n_kills, mut n_runs) = (0, 0);
    while n_kills < least {
        let run = room().frames(300);
        n_kills += disturb(&run, &mut random);
        n_runs += 1;
        run.assert_same_bytes(&undisturbed, &format!("run {n_runs}, {n_kills} kills in all"));
        assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
    }
    eprintln!("{n_kills} kills in {n_runs} runs");
}

#[test]
fn lives_cut_in_their_first_moments_leave_no_half_made_service() {
    let frames = 300;
    let undisturbed = room().frames(frames);
    assert!(undisturbed.finish().success());
    let run = room().frames(frames);
    let mut child = run.start();
    run.wait_until_busy();
    let mut random = Random(SplitMix64::new(3));
    for _ in 0..12 {
        for pid in run.stage_pids() {
            std::thread::sleep(Duration::from_millis(random.below(40)));
            // It may have ended by itself.
            let _ = Command::new("kill").args(["-KILL", &pid.to_string()]).output();
        }
    }
    assert!(child.wait().unwrap().success(), "{}", run.log());
    run.assert_same_bytes(&undisturbed, "lives cut short");
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}

/// Killed while they made a node, a service or a port, processes leave pieces that iceoryx2 does
/// not clean up: the supervisor does, while the run goes on.
#[test]
fn the_dead_leave_no_half_made_nodes() {
    let run = room().frames(100_000);
    let mut child = run.start();
    run.wait_until_busy();
    let mut random = Random(SplitMix64::new(5));
    for _ in 0..12 {
        for pid in run.stage_pids() {
            std::thread::sleep(Duration::from_millis(random.below(40)));
            // It may have ended by itself.
            let _ = Command::new("kill").args(["-KILL", &pid.to_string()]).output();
        }
    }
    let file = tessera_stage::RunFile::read(&tessera_stage::RunFiles::new(&run.out())).unwrap();
    let n_nodes = || {
        let items = std::fs::read_dir(file.identity.root.join("nodes")).unwrap().flatten();
        items.filter(|item| item.file_type().is_ok_and(|kind| kind.is_dir())).count()
    };
    let is_ready = |pid: &u32| run.log().contains(&format!("[{pid}] ready"));
    // The supervisor and four stages, and no other.
    wait_for("the nodes of the living alone", || {
        let pids = run.stage_pids();
        pids.len() == 4 && pids.iter().all(is_ready) && n_nodes() == 5
    });
    signal(child.id(), "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{}", run.log());
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}

#[test]
fn live_runs_go_on() {
    let run = room().frames(90).with(&["--live"]);
    let n_kills = disturb(&run, &mut Random(SplitMix64::new(7)));
    assert!(n_kills > 2);
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let count = |key: &str| summary[key].as_u64().unwrap();
    // Every frame is accounted for.
    assert_eq!(
        count("frames_processed") + count("frames_dropped") + count("frames_missing"),
        90,
        "{summary}"
    );
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}
