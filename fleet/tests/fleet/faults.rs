//! Faults on the network and deaths of both ends: nothing is lost, nothing comes twice, and the map is that
//! of a day without faults.

use crate::processes::{
    Process, base, copy_of, fleet, free_port, map_files, start, status, uplink, wait_for, wait_for_robot,
};
use crate::proxy::Proxy;
use crate::run::{GrowingRun, assert_same};
use std::path::Path;
use std::time::Duration;
use tessera_numerics::SplitMix64;

#[test]
fn kills_and_faults_on_the_network_change_no_byte() {
    let dir = tempfile::tempdir().unwrap();
    let runs = ["a", "b"].map(|robot| dir.path().join(format!("run-{robot}")));
    let (folder, port) = (dir.path().join("base"), free_port());
    let proxies = [Proxy::to(port), Proxy::to(port)];
    let mut growing = [0, 1].map(|k| GrowingRun::begin(&runs[k], &format!("run{k}"), k as u64));
    let mut bases = base(&folder, port, 2);
    let mut uplinks: Vec<Process> = Vec::new();
    for (k, robot) in ["a", "b"].into_iter().enumerate() {
        growing[k].grow();
        uplinks.push(uplink(&runs[k], robot, proxies[k].port));
        wait_for_robot(&folder, robot);
    }
    let mut random = SplitMix64::for_frame(1, 2);
    // `scripts/soak_fleet.sh` asks for more.
    let n_steps = std::env::var("TESSERA_FLEET_STEPS").ok().map_or(40, |steps| steps.parse().unwrap());
    for step in 0..n_steps {
        growing.iter_mut().for_each(|run| (0..4).for_each(|_| run.grow()));
        let k = random.below(2);
        match step % 8u32 {
            0 => proxies[k].cut(),
            1 => proxies[k].repeat(true),
            2 => {
                bases.kill();
                bases = base(&folder, port, 2);
            }
            3 => {
                uplinks[k].kill();
                uplinks[k] = uplink(&runs[k], ["a", "b"][k], proxies[k].port);
            }
            4 => proxies[k].slow(20, 200_000),
            5 => proxies.iter().for_each(Proxy::heal),
            6 => proxies.iter().for_each(|proxy| proxy.slow(0, 0)),
            _ => {}
        }
        std::thread::sleep(Duration::from_millis(random.below(150) as u64));
    }
    proxies.iter().for_each(Proxy::heal);
    growing.iter_mut().for_each(GrowingRun::end);
    bases.wait_for_success("the base");
    assert!(proxies.iter().any(|proxy| proxy.n_repeated() > 0), "attempts came twice");
    for (k, robot) in ["a", "b"].into_iter().enumerate() {
        assert_same(&runs[k], &copy_of(&folder, robot));
    }
    let (disturbed, undisturbed) = (map_files(&folder), undisturbed(dir.path(), &runs));
    assert!(disturbed.contains_key("map.ply"), "{:?}", disturbed.keys());
    assert!(disturbed == undisturbed, "{:?} and {:?}", disturbed.keys(), undisturbed.keys());
}

/// The map of the same runs in the same order, without a fault.
fn undisturbed(dir: &Path, runs: &[std::path::PathBuf; 2]) -> std::collections::BTreeMap<String, Vec<u8>> {
    let (folder, port) = (dir.join("undisturbed"), free_port());
    let mut bases = base(&folder, port, 2);
    let _a = uplink(&runs[0], "a", port);
    wait_for_robot(&folder, "a");
    let _b = uplink(&runs[1], "b", port);
    bases.wait_for_success("the undisturbed base");
    map_files(&folder)
}

#[test]
fn a_base_says_what_it_has_and_there_is_one_of_a_folder() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 3);
    (0..20).for_each(|_| growing.grow());
    let mut first = base(&folder, port, 1);
    let mut robot = uplink(&run, "a", port);
    wait_for("a map", || status(&folder).mapped > 0);
    let second = fleet(&["base", folder.to_str().unwrap(), "--listen", "tcp/127.0.0.1:0"])
        .stderr(std::process::Stdio::piped())
        .output()
        .unwrap();
    let words = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(!second.status.success() && words.contains("written by another process"), "{words}");
    let said = fleet(&["base", folder.to_str().unwrap(), "status"])
        .stdout(std::process::Stdio::piped())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(said.contains("a desk: 20 frames, 3 keyframes") && said.contains("this machine alone"), "{said}");
    robot.kill();
    wait_for("the robot to be away", || !status(&folder).runs[0].is_connected);
    growing.end();
    let _robot = uplink(&run, "a", port);
    first.wait_for_success("the base");
    assert!(status(&folder).runs[0].is_ended);
    assert_same(&run, &copy_of(&folder, "a"));
}

#[test]
fn plain_tcp_beyond_this_machine_is_refused() {
    for arguments in
        [["base", "x", "--listen", "tcp/0.0.0.0:7447"], ["uplink", "x", "--to", "tcp/192.0.2.1:7447"]]
    {
        let dir = tempfile::tempdir().unwrap();
        let output = fleet(&arguments).current_dir(dir.path()).stderr(std::process::Stdio::piped()).output();
        let output = output.unwrap();
        assert_eq!(output.status.code(), Some(2));
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(words.contains("expected tls/HOST:PORT"), "{words}");
    }
}

#[test]
fn a_bound_on_the_rate_is_kept_and_everything_comes() {
    let dir = tempfile::tempdir().unwrap();
    let (run, folder, port) = (dir.path().join("run"), dir.path().join("base"), free_port());
    let mut growing = GrowingRun::begin(&run, "desk", 3);
    (0..40).for_each(|_| growing.grow());
    growing.end();
    let n_bytes = std::fs::metadata(run.join("align.journal")).unwrap().len();
    let mut bases = base(&folder, port, 1);
    let to = format!("tcp/127.0.0.1:{port}");
    // Two seconds' worth.
    let kbps = (n_bytes * 8 / 2000).to_string();
    let begun = std::time::Instant::now();
    let arguments = ["uplink", run.to_str().unwrap(), "--to", &to, "--robot", "a", "--max-kbps", &kbps];
    let _robot = start(&arguments);
    bases.wait_for_success("the base");
    assert!(begun.elapsed() >= Duration::from_millis(1500), "{:?}", begun.elapsed());
    assert_same(&run, &copy_of(&folder, "a"));
}
