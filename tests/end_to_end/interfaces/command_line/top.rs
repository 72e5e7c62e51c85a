//! Looking at a run as it goes on.

use crate::common::{room, signal, wait_for};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

fn top(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).arg("top").args(arguments).output().unwrap()
}

/// What Prometheus is told as soon as all lines that are wanted are among it.
fn scrape(name: &str, wanted: &[String]) -> String {
    let mut server = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["top", name, "--metrics", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next()).unwrap();
    let mut answer = String::new();
    wait_for("the words of all stages", || {
        answer = ask(address).unwrap_or_default();
        let has_steps = answer.contains("step=\"search\",quantile=\"0.99\"}");
        has_steps && wanted.iter().all(|line| answer.lines().any(|found| found == line))
    });
    server.kill().unwrap();
    server.wait().unwrap();
    answer
}

/// Asks at an address as Prometheus does; `None` without an answer.
fn ask(address: &str) -> Option<String> {
    let mut stream = TcpStream::connect(address).ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    stream.write_all(b"GET /metrics HTTP/1.1\r\n\r\n").ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    Some(answer)
}

#[test]
fn a_run_answers_for_itself_while_it_lasts() {
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap().to_string();
    drop(free);
    let run = room().with_faults("reconstruct=sent:30:stop").with(&[
        "--set",
        "flow.hang_s=60",
        "--metrics",
        &address,
    ]);
    let mut child = run.start();
    let stopped = run.wait_until_stopped("reconstruct");
    let wanted = format!("tessera_frames_total{{run=\"{}\",stage=\"align\"}} 31", run.name);
    wait_for("the aligner's frames", || {
        ask(&address).is_some_and(|answer| answer.lines().any(|line| line == wanted))
    });
    signal(stopped, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    assert!(TcpStream::connect(&address).is_err(), "no answer for a run that is over");
    let plain = room();
    assert!(plain.finish().success());
    run.assert_same_bytes(&plain, "metrics were asked for");
    assert_eq!(run.leftovers(), Vec::<std::path::PathBuf>::new());

    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    for (address, words) in
        [(address.as_str(), "in use"), ("0.0.0.0:0", "0.0.0.0 is not of this machine alone")]
    {
        let refused = room().with(&["--metrics", address]);
        let output = refused.command().output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(words), "{said}");
        assert!(!refused.out().exists());
    }
}

/// Steps of the aligner that a look shows; "waiting" is none of them, for one that began late has work until
/// the run stands still.
const STEPS: [&str; 7] = ["transport", "computing", "publishing", "search", "solve", "journal", "send"];

/// Whether the last look shows the newest pose and the aligner's steps.
fn has_times(looks: &Output) -> bool {
    let text = String::from_utf8_lossy(&looks.stdout);
    let Some(look) = text.lines().last().and_then(|line| serde_json::from_str::<Value>(line).ok()) else {
        return false;
    };
    let align = &look["stages"][2];
    let has_step = |name: &&str| align["times_ms"][*name]["n"].as_u64() >= Some(1);
    look["pose"]["frame"] == 30 && align["frames"] == 31 && STEPS.iter().all(has_step)
}

#[test]
fn a_running_pipeline_is_seen_and_changes_no_byte() {
    // One stage stops itself: the run stands still, and is not over.
    let run = room().with_faults("reconstruct=sent:30:stop").with(&["--set", "flow.hang_s=600"]);
    let mut child = run.start();
    let stopped = run.wait_until_stopped("reconstruct");
    let lines = ["tessera_frames_total{RUN,stage=\"align\"} 31", "# TYPE tessera_step_seconds summary"];
    let lines = lines.map(|line| line.replace("RUN", &format!("run=\"{}\"", run.name)));
    let scraped = scrape(&run.name, &lines);
    // The stages speak when they have time.
    let mut looks = None;
    wait_for("a look that has the aligner's times", || {
        let found = top(&[&run.name, "--json", "--interval", "1.5", "--count", "2"]);
        println!("a look: {found:?}");
        has_times(looks.insert(found))
    });
    let looks = looks.unwrap();
    let refused = top(&[&run.name]);
    signal(stopped, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    assert!(looks.status.success(), "{}", String::from_utf8_lossy(&looks.stderr));
    let text = String::from_utf8(looks.stdout).unwrap();
    let looks: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(looks.len(), 2, "one line for each look: {text}");
    assert_eq!(looks[0]["stages"][2]["frames"].as_u64(), Some(31), "the first line has numbers: {text}");
    let look = &looks[1];
    assert_eq!(look["name"].as_str(), Some(run.name.as_str()));
    assert_eq!(look["pose"]["frame"].as_u64(), Some(30), "{look}");
    let stages = look["stages"].as_array().unwrap();
    let names: Vec<&str> = stages.iter().map(|stage| stage["stage"].as_str().unwrap()).collect();
    assert_eq!(names, ["sensor", "reconstruct", "align", "optimise"]);
    let align = &stages[2];
    assert!(align["pid"].as_u64().is_some() && align["frames"].as_u64() == Some(31), "{look}");
    for name in STEPS {
        let row = &align["times_ms"][name];
        assert!(row["n"].as_u64() >= Some(1) && row["max"].as_f64() >= row["p50"].as_f64(), "{name}: {look}");
    }
    assert!(
        scraped.starts_with("HTTP/1.1 200 OK\r\n") && scraped.contains("step=\"search\",quantile=\"0.99\"}")
    );
    let open = top(&[&run.name, "--metrics", "0.0.0.0:0"]);
    assert_eq!(open.status.code(), Some(2));
    assert!(String::from_utf8(open.stderr).unwrap().contains("0.0.0.0 is not of this machine alone"));
    // Without a terminal there is no view.
    assert_eq!(refused.status.code(), Some(2));
    let words = String::from_utf8(refused.stderr).unwrap();
    assert!(words.contains("standard output is no terminal, expected --json"), "{words}");

    let undisturbed = room();
    assert!(undisturbed.finish().success());
    run.assert_same_bytes(&undisturbed, "a viewer looked on");
    let over = top(&[&run.name, "--json"]);
    assert_eq!(over.status.code(), Some(2));
    assert!(String::from_utf8(over.stderr).unwrap().contains("is going on"), "a run that is over");
}
