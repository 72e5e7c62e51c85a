//! The report of a run that goes on, in a browser: it follows the run, and no browser disturbs it.

use crate::common::{room, signal, wait_for};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// `tessera view NAME --web`, ended with the test.
struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn start(run: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tessera"))
            .args(["view", run, "--web"])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next());
        let address = address.unwrap_or_else(|| panic!("no address in {line:?}")).to_owned();
        Self { child, address }
    }

    /// A browser that has asked and reads nothing.
    fn frozen(&self) -> TcpStream {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n").unwrap();
        stream
    }

    /// The answer to a browser.
    fn page(&self) -> String {
        let mut stream = self.frozen();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn browsers_follow_a_run_and_change_no_byte_of_it() {
    let undisturbed = room();
    assert!(undisturbed.finish().success());
    // One stage stops itself, so that the run cannot end before the browsers are there.
    let run = room().with(&["--set", "flow.hang_s=600"]).with_faults("reconstruct=sent:30:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("reconstruct");
    let server = Server::start(&run.out().display().to_string());
    let mut silent = TcpStream::connect(&server.address).unwrap();
    let frozen = server.frozen();
    wait_for("the page of 31 frames", || server.page().contains("<dd>31 of "));
    let page = server.page();
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{}", &page[..200]);
    assert!(page.contains("<canvas") && page.trim_end().ends_with("</html>"), "the whole page");
    let head = page.split("\r\n\r\n").next().unwrap();
    assert!(head.contains("Cache-Control: no-store"), "{head}");

    signal(stopped, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    let ended = server.page();
    assert!(ended.contains("<dd>40 of 40</dd>"), "the page follows the run to its end");
    let report = String::from_utf8(run.output("report.html")).unwrap();
    assert!(ended.split_once("\r\n\r\n").unwrap().1 == report, "and is its report then");
    silent.write_all(b"GET / HTTP/1.1\r\n\r\n").ok();
    drop((frozen, silent, server));
    run.assert_same_bytes(&undisturbed, "it was looked at in browsers");
    assert_eq!(run.n_deaths(), 0, "{}", run.log());
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());
}
