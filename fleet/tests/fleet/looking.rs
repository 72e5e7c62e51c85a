//! A base looked at from outside as it goes on.

use crate::processes::{base, fleet, free_port, status, uplink, wait_for, wait_for_success};
use crate::run::GrowingRun;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::time::Duration;
use tessera_fleet::base::status::{STATUS_FILE, Status};

fn look(folder: &Path, arguments: &[&str]) -> Output {
    fleet(&["base", folder.to_str().unwrap()])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .output()
        .unwrap()
}

/// A process that answers at an address of this machine.
struct Server(Child, String);

impl Server {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let mut command = fleet(&["base", folder.to_str().unwrap()]);
        let mut child = command.args(arguments).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next()).unwrap();
        assert!(address.starts_with("127.0.0.1:") && line.contains("this machine"), "{line}");
        Self(child, address.to_owned())
    }

    fn get(&self, path: &str) -> String {
        let mut stream = TcpStream::connect(&self.1).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\n\r\n", self.1).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn has_line(text: &str, wanted: &str) -> bool {
    text.lines().any(|line| line == wanted)
}

#[test]
fn a_base_is_watched_as_it_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 5);
    (0..20).for_each(|_| growing.grow());
    let mut watched = base(&folder, port, 1);
    let _robot = uplink(&run, "a", port);
    wait_for("a map", || status(&folder).mapped > 0);

    let said = look(&folder, &["top", "--json", "--interval", "0.05", "--count", "2"]);
    assert!(said.status.success(), "{said:?}");
    let looks: Vec<Status> = String::from_utf8(said.stdout)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(looks.len(), 2);
    assert!(looks.iter().all(|look| look.runs[0].frames == 20 && look.runs[0].is_connected));

    let metrics = Server::start(&folder, &["top", "--metrics", "127.0.0.1:0"]);
    let page = Server::start(&folder, &["view"]);
    let figures = metrics.get("/metrics");
    for line in [
        "tessera_fleet_up 1",
        "tessera_fleet_frames{robot=\"a\",run=\"desk\"} 20",
        "tessera_fleet_runs{state=\"goes on\"} 1",
        "tessera_fleet_map_components 1",
    ] {
        assert!(has_line(&figures, line), "{line} is missing in {figures}");
    }
    let shown = page.get("/");
    assert!(shown.starts_with("HTTP/1.1 200 OK") && shown.contains("Refresh: "), "{shown}");
    assert!(shown.contains("a desk") && shown.contains("<td>20</td>"), "{shown}");

    // What comes is seen without a new map.
    growing.grow();
    wait_for("the frame", || status(&folder).runs[0].frames == 21);
    assert!(page.get("/").contains("<td>21</td>"));
    growing.end();
    wait_for_success(&mut watched, "the base");
    let figures = metrics.get("/metrics");
    assert!(has_line(&figures, "tessera_fleet_up 0"), "{figures}");
    assert!(has_line(&figures, "tessera_fleet_runs{state=\"ended\"} 1"), "{figures}");
    // A base that is over is looked at once.
    let said = look(&folder, &["top", "--json"]);
    assert_eq!((said.status.code(), said.stdout.iter().filter(|byte| **byte == b'\n').count()), (Some(0), 1));
}

#[test]
fn a_look_that_makes_no_sense_is_refused_in_words() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], code: i32, words: &str| {
        let output = look(dir.path(), arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
    };
    for action in [&["status"][..], &["view"], &["top"], &["top", "--metrics", "127.0.0.1:0"]] {
        refused(action, 3, "expected the folder of a base");
    }
    refused(&["view", "--json"], 2, "--json cannot be used with view");
    refused(&["status", "--count", "2"], 2, "--count cannot be used with status");
    refused(&["top", "--metrics", "0.0.0.0:1"], 2, "0.0.0.0 is not of this machine alone");
    let status = serde_json::to_vec(&Status::default()).unwrap();
    std::fs::write(dir.path().join(STATUS_FILE), status).unwrap();
    refused(&["top"], 2, "standard output is no terminal");
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    refused(&["top", "--metrics", &address], 2, "in use");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "who looks writes nothing");
}
