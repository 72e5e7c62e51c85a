//! Corrections from the base: the base answers the requests of its robots, and a robot needs no base.

use crate::processes::{
    base, free_port, start, status, uplink, wait_for, wait_for_robot, wait_for_success, whole_base,
};
use crate::robot::{EARLY_LOOPS, Robot, tessera};
use crate::run::answer_of;
use crate::strangers::{certificates, write_configuration};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tessera_evaluation::{EvaluationOptions, evaluate, read_tum};
use tessera_fleet::chaos::FleetProcess;
use tessera_fleet::wire::keys::run_key;
use tessera_fleet::wire::piece::{Piece, PieceKind};
use tessera_fleet::wire::request::Request;
use tessera_fleet::wire::session::{FleetEnd, configuration};
use zenoh::{Session, Wait};

/// Longest step of the simulated hand from one frame to the next, with room for errors, metres.
const MOST_STEP_M: f64 = 0.1;

/// The settings of a robot that leaves its optimisations to a base for so long.
fn asking(wait: &'static str) -> Vec<&'static str> {
    EARLY_LOOPS.into_iter().chain([wait]).collect()
}

/// A run that asks no base, for comparison.
fn alone(tessera: &Path, folder: &Path) -> Robot {
    let robot = Robot::new(tessera, (folder, "alone"), (0, 40), &EARLY_LOOPS).with_small_camera();
    robot.finish();
    robot
}

#[test]
fn the_base_answers_a_lone_robot_with_the_bytes_of_its_own_corrections() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    let alone = alone(&tessera, dir.path());
    let (folder, port) = (dir.path().join("base"), free_port());
    let robot = Robot::new(&tessera, (dir.path(), "a"), (0, 40), &asking("run.base_wait_s=600"));
    let robot = robot.with_small_camera();
    robot.begin();
    let mut bases = whole_base(&folder, port, 1);
    let _uplink = uplink(&robot.out, "a", port);
    robot.wait_for_contact();
    assert!(robot.resume("").wait().unwrap().success(), "{}", robot.log());
    wait_for_success(&mut bases, "the base");
    let (n_answers, n_from_base) = robot.n_answers();
    assert!(n_answers > 1 && n_from_base + 1 >= n_answers, "{n_from_base} of {n_answers} from the base");
    assert_eq!(robot.summary()["corrections_from_base"], n_from_base);
    assert!(alone.summary()["corrections_from_base"].is_null());
    assert_eq!(status(&folder).runs.len(), 1, "a run that is resumed is the same run");
    assert_eq!(status(&folder).runs[0].corrections_from_base, n_from_base as u64);
    assert!(status(&folder).text(true).contains("from here, the last with 0 other run(s)"));
    robot.assert_same_outputs(&alone);
    let (largest_step_m, _) = robot.odometry();
    assert!(largest_step_m < MOST_STEP_M, "{largest_step_m} m");
}

/// Kills of the robot's own stages. Requests are numbered from 0.
const KILLS: &str = "optimise=opened:0,received:0,journaled:1,received:2;align=journaled:20,received:31";

#[test]
fn kills_of_all_leave_a_whole_run_with_the_same_bytes() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    let alone = alone(&tessera, dir.path());
    let (folder, port) = (dir.path().join("base"), free_port());
    let robot = Robot::new(&tessera, (dir.path(), "a"), (0, 40), &asking("run.base_wait_s=5"));
    let robot = robot.with_small_camera();
    robot.begin();
    let mut bases = whole_base(&folder, port, 1);
    let mut uplinks = uplink(&robot.out, "a", port);
    robot.wait_for_contact();
    let mut going_on = robot.resume(KILLS);
    for step in 0.. {
        if going_on.try_wait().unwrap().is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(700));
        match step % 2 {
            0 => {
                bases.kill();
                bases = whole_base(&folder, port, 1);
            }
            _ => {
                uplinks.kill();
                uplinks = uplink(&robot.out, "a", port);
            }
        }
    }
    assert!(going_on.wait().unwrap().success(), "{}", robot.log());
    wait_for_success(&mut bases, "the base");
    assert!(robot.log().contains("it is started again"), "{}", robot.log());
    robot.assert_same_outputs(&alone);
    assert!(robot.odometry().0 < MOST_STEP_M);
}

fn ate_m(run: &Robot) -> f64 {
    let truth = read_tum(&run.out.join("groundtruth.txt")).unwrap();
    let estimate = read_tum(&run.out.join("trajectory.txt")).unwrap();
    evaluate(&truth, &estimate, &EvaluationOptions::default()).unwrap().ate_rmse_m
}

#[test]
fn robots_that_share_places_correct_each_other() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    let (folder, port) = (dir.path().join("base"), free_port());
    let asking = ["run.base_wait_s=600"];
    let alone = Robot::new(&tessera, (dir.path(), "alone"), (40, 60), &[]);
    alone.finish();
    let mut bases = base(&folder, port, 2);
    let first = Robot::new(&tessera, (dir.path(), "a"), (0, 60), &asking);
    first.begin();
    let _first = uplink(&first.out, "a", port);
    first.wait_for_contact();
    let second = Robot::new(&tessera, (dir.path(), "b"), (40, 60), &asking);
    second.begin();
    // The first one has come to its end before the second one asks.
    assert!(first.resume("").wait().unwrap().success(), "{}", first.log());
    wait_for("the first run", || status(&folder).runs.first().is_some_and(|run| run.is_ended));
    let _second = uplink(&second.out, "b", port);
    wait_for_robot(&folder, "b");
    second.wait_for_contact();
    assert!(second.resume("").wait().unwrap().success(), "{}", second.log());
    wait_for_success(&mut bases, "the base");
    let said = status(&folder);
    let b = said.runs.iter().find(|run| run.robot == "b").unwrap();
    assert_eq!(b.answer.as_ref().map(|answer| answer.runs), Some(1), "{said:?}");
    assert_eq!(second.summary()["corrections_from_base"], second.n_answers().1);
    let trajectory = |run: &Robot| std::fs::read(run.out.join("trajectory.txt")).unwrap();
    assert!(trajectory(&second) != trajectory(&alone), "the other robot's keyframes count");
    let (by_itself, corrected) = (ate_m(&alone), ate_m(&second));
    assert!(corrected <= by_itself * 1.1 + 5e-4, "{by_itself} m alone, {corrected} m corrected");
    assert!(second.odometry().0 < MOST_STEP_M);
}

/// What a robot replies to this request of a base.
fn ask(session: &Session, robot: &str, request: &Request) -> Vec<Piece> {
    let selector = format!("{}?{}", run_key(robot), request.to_parameters());
    let asked = session
        .get(selector)
        .consolidation(zenoh::query::ConsolidationMode::None)
        .payload(request.payload())
        .wait();
    let mut pieces = Vec::new();
    while let Ok(reply) = asked.as_ref().unwrap().recv() {
        let Ok(sample) = reply.result() else { break };
        let label = sample.attachment().map(|label| label.to_bytes()).unwrap_or_default();
        pieces.extend(Piece::read(&label, &sample.payload().to_bytes()));
    }
    pieces
}

#[test]
fn forged_answers_are_refused_counted_and_named() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    let alone = alone(&tessera, dir.path());
    let port = free_port();
    let robot = Robot::new(&tessera, (dir.path(), "a"), (0, 40), &asking("run.base_wait_s=5"));
    let robot = robot.with_small_camera();
    robot.begin();
    let locator = format!("tcp/127.0.0.1:{port}");
    let session = zenoh::open(configuration(&FleetEnd::Base(Some(&locator)), None).unwrap()).wait().unwrap();
    let _uplink: FleetProcess =
        start(&["uplink", robot.out.to_str().unwrap(), "--to", &locator, "--robot", "a", "-q"]);
    wait_for("the uplink", || !ask(&session, "a", &Request::Offer).is_empty());
    robot.wait_for_contact();
    let identity = tessera_stage::identity_of(&std::fs::read(robot.out.join("run.json")).unwrap());
    let answer = |identity, bytes| ask(&session, "a", &Request::Answer { identity, bytes });
    let bytes = |identity| answer_of(identity, 0).to_bytes().unwrap();
    let mut flipped = bytes(identity);
    flipped[50] ^= 1;
    let refused = [
        (answer(identity ^ 1, bytes(identity ^ 1)), "is not here"),
        (answer(identity, bytes(identity ^ 1)), "an answer to run"),
        (answer(identity, flipped), "checksum"),
        (answer(identity, Vec::new()), "cut"),
        (answer(identity, vec![0; (4 << 20) + 1]), "expected at most"),
    ];
    for (pieces, words) in refused {
        let said = pieces.first().map(|piece| String::from_utf8_lossy(&piece.bytes).into_owned());
        assert!(pieces.iter().all(|piece| piece.kind == PieceKind::Refused), "{words}: {pieces:?}");
        assert!(said.as_ref().is_some_and(|said| said.contains(words)), "{words}: {said:?}");
    }
    assert!(!robot.out.join("base.answer").exists());
    let is_over = Arc::new(AtomicBool::new(false));
    let mut going_on = robot.resume("");
    let forger = std::thread::spawn({
        let (is_over, session) = (Arc::clone(&is_over), session.clone());
        move || {
            // What the uplink cannot know to be wrong: of other keyframes.
            for request in (0..10).cycle() {
                let bytes = answer_of(identity, request).to_bytes().unwrap();
                ask(&session, "a", &Request::Answer { identity, bytes });
                std::thread::sleep(Duration::from_millis(20));
                if is_over.load(Ordering::Relaxed) {
                    return;
                }
            }
        }
    });
    let status = going_on.wait().unwrap();
    is_over.store(true, Ordering::Relaxed);
    forger.join().unwrap();
    assert!(status.success(), "{}", robot.log());
    assert!(robot.log().contains("an answer of the base is refused: an answer"), "{}", robot.log());
    assert_eq!(robot.n_answers().1, 0);
    robot.assert_same_outputs(&alone);
}

#[test]
fn two_robots_at_once_are_answered_over_tls() {
    let Some(tessera) = tessera() else { return };
    let dir = tempfile::tempdir().unwrap();
    if !certificates(dir.path()) {
        return;
    }
    let (folder, port) = (dir.path().join("base"), free_port());
    let names = ["robot1", "robot2"];
    let config = |name: &str| write_configuration(dir.path(), name, port).display().to_string();
    let at_base = config("base");
    let mut bases = start(&[
        "base",
        folder.to_str().unwrap(),
        "--config",
        &at_base,
        "--runs",
        "2",
        "--map-every",
        "1",
        "-q",
    ]);
    let robots = [(names[0], (0, 40)), (names[1], (20, 40))].map(|(name, part)| {
        let wait = asking("run.base_wait_s=600");
        let robot = Robot::new(&tessera, (dir.path(), name), part, &wait).with_small_camera();
        robot.begin();
        robot
    });
    let _uplinks = [0, 1].map(|k| {
        let (run, config) = (robots[k].out.to_str().unwrap(), config(names[k]));
        start(&["uplink", run, "--config", &config, "--robot", names[k], "-q"])
    });
    robots.iter().for_each(Robot::wait_for_contact);
    let mut going_on = robots.each_ref().map(|robot| robot.resume(""));
    for (child, robot) in going_on.iter_mut().zip(&robots) {
        assert!(child.wait().unwrap().success(), "{}", robot.log());
    }
    wait_for_success(&mut bases, "the base");
    for robot in &robots {
        let (n_answers, n_from_base) = robot.n_answers();
        assert!(n_answers > 0 && n_from_base + 1 >= n_answers, "{n_from_base} of {n_answers} from the base");
        assert!(robot.odometry().0 < MOST_STEP_M);
    }
    assert_eq!(status(&folder).refused, []);
}
