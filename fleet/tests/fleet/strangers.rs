//! Who may speak: another's name, nonsense, old records and floods are refused, counted and named.

use crate::processes::{
    base, copy_of, free_port, start, status, uplink, wait_for, wait_for_robot, wait_for_success,
};
use crate::requirements::missing;
use crate::run::{GrowingRun, assert_same};
use std::path::Path;
use std::process::Command;
use tessera_fleet::chaos::FleetProcess;
use tessera_fleet::wire::keys::{alive_key, run_key};
use tessera_fleet::wire::piece::Piece;
use tessera_fleet::wire::request::PieceRefusal;
use tessera_fleet::wire::session::{FleetEnd, configuration};
use zenoh::{Config, Session, Wait};

fn session(port: u16) -> Session {
    let locator = format!("tcp/127.0.0.1:{port}");
    zenoh::open(configuration(&FleetEnd::Robot(Some(&locator)), None).unwrap()).wait().unwrap()
}

fn n_refused(folder: &Path, robot: &str, what: PieceRefusal) -> u64 {
    let refused = status(folder).refused;
    refused.iter().filter(|r| r.robot == robot && r.what == what).map(|r| r.n).sum()
}

/// Answers every question at a key in this way until it is dropped.
fn answering(
    session: &Session,
    key: String,
    answer: impl Fn(&zenoh::query::Query) + Send + Sync + 'static,
) -> zenoh::query::Queryable<()> {
    session.declare_queryable(key).callback(move |query| answer(&query)).wait().unwrap()
}

#[test]
fn strangers_are_counted_and_harm_no_robot() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 5);
    (0..30).for_each(|_| growing.grow());
    let mut bases = base(&folder, port, 1);
    let _robot = uplink(&run, "a", port);
    wait_for_robot(&folder, "a");
    let stranger = session(port);
    let token = |key: String| stranger.liveliness().declare_token(key).wait().unwrap();
    // Names that none may have, and no robot behind.
    let _names = [token("fleet/disk/alive".into()), token("fleet/-x/alive".into())];
    // A robot that talks nonsense, and floods while it does.
    let _nonsense_token = token(alive_key("nonsense"));
    let _nonsense = answering(&stranger, run_key("nonsense"), |query| {
        for _ in 0..50 {
            let _ = query.reply(query.key_expr().clone(), vec![1u8; 100_000]).wait();
        }
    });
    // A robot that offers the run of another.
    let _thief_token = token(alive_key("thief"));
    let mut served = tessera_fleet::robot::served::Served::open(&run).unwrap();
    let mut offer = None;
    served.answer(&tessera_fleet::wire::request::Request::Offer, &mut |piece| {
        offer.get_or_insert(piece);
        true
    });
    let offer = offer.unwrap();
    let _thief = answering(&stranger, run_key("thief"), move |query| {
        let _ = query.reply(query.key_expr().clone(), offer.bytes.clone()).attachment(offer.label()).wait();
    });
    // One that takes the name of the robot itself, with another run and old records.
    let other = dir.path().join("other");
    let mut forged = GrowingRun::begin(&other, "desk", 6);
    (0..30).for_each(|_| forged.grow());
    let old = Piece::data(1, 0, std::fs::read(other.join("align.journal")).unwrap()[..1000].to_vec());
    let _double = answering(&stranger, run_key("a"), move |query| {
        let _ = query.reply(query.key_expr().clone(), old.bytes.clone()).attachment(old.label()).wait();
    });
    for _ in 0..1000 {
        stranger.put(run_key("a"), vec![0u8; 1000]).wait().unwrap();
    }
    wait_for("refusals", || {
        n_refused(&folder, "disk", PieceRefusal::Name) > 0
            && n_refused(&folder, "-x", PieceRefusal::Name) > 0
            && n_refused(&folder, "nonsense", PieceRefusal::Foreign) > 0
            && n_refused(&folder, "thief", PieceRefusal::Name) > 0
    });
    (0..30).for_each(|_| growing.grow());
    growing.end();
    wait_for_success(&mut bases, "the base");
    assert_same(&run, &copy_of(&folder, "a"));
    let said = status(&folder);
    assert_eq!(said.runs.len(), 1, "{said:?}");
}

/// Certificates as docs/fleet.md makes them; `false`, with the reason printed, without openssl.
pub(crate) fn certificates(folder: &Path) -> bool {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scripts/fleet_certificates.sh");
    match Command::new(script).arg(folder).args(["127.0.0.1", "robot1", "robot2"]).output() {
        Ok(output) if output.status.success() => true,
        other => {
            missing("tools", format_args!("no certificates by openssl: {other:?}"));
            false
        }
    }
}

/// The configuration of an end as docs/fleet.md has it.
pub(crate) fn write_configuration(folder: &Path, name: &str, port: u16) -> std::path::PathBuf {
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let example = if name == "base" { "base.json5" } else { "robot1.json5" };
    let text = std::fs::read_to_string(page.join(example)).unwrap();
    let text = text
        .replace("robot1.key", &format!("{name}.key"))
        .replace("robot1.pem", &format!("{name}.pem"))
        .replace("base.example:7447", &format!("127.0.0.1:{port}"))
        .replace("0.0.0.0:7447", &format!("127.0.0.1:{port}"));
    let text = ["ca.pem", "base.key", "base.pem"]
        .iter()
        .chain(&[format!("{name}.key").as_str(), &format!("{name}.pem")])
        .fold(text, |text, file| {
            text.replace(&format!("\"{file}\""), &format!("{:?}", folder.join(file).display().to_string()))
        });
    let path = folder.join(format!("{name}.json5"));
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn with_certificates_a_robot_speaks_for_itself_alone() {
    let dir = tempfile::tempdir().unwrap();
    if !certificates(dir.path()) {
        return;
    }
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 5);
    (0..30).for_each(|_| growing.grow());
    let config = |name: &str| write_configuration(dir.path(), name, port);
    let [at_base, robot1, robot2] = ["base", "robot1", "robot2"].map(config);
    let start = |words: &[&str]| -> FleetProcess { start(words) };
    let mut bases = start(&[
        "base",
        folder.to_str().unwrap(),
        "--config",
        at_base.to_str().unwrap(),
        "--runs",
        "1",
        "--quiet",
    ]);
    // The second robot takes the first one's name: its token is not let through.
    let forger: Config = configuration(&FleetEnd::Robot(None), Some(&robot2)).unwrap();
    let forger = zenoh::open(forger).wait().unwrap();
    let _forged = forger.liveliness().declare_token(alive_key("robot1")).wait().unwrap();
    let _answers = answering(&forger, run_key("robot1"), |query| {
        let _ = query.reply(query.key_expr().clone(), vec![1u8; 100]).wait();
    });
    let _own = forger.liveliness().declare_token(alive_key("robot2")).wait().unwrap();
    // Its own token is: what is asked of it goes unanswered, and nothing comes of it.
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert!(status(&folder).runs.is_empty());
    let run_text = run.to_str().unwrap();
    let _robot = start(&["uplink", run_text, "--config", robot1.to_str().unwrap(), "--robot", "robot1"]);
    wait_for_robot(&folder, "robot1");
    growing.end();
    wait_for_success(&mut bases, "the base");
    assert_same(&run, &copy_of(&folder, "robot1"));
    let said = status(&folder);
    assert_eq!(said.refused, [], "the forger was not heard at all");
    assert!(said.listens.unwrap().contains("TLS"));
}
