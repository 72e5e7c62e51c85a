//! Both sides as they start by themselves: no configuration of Cyclone DDS, or what rmw_cyclonedds makes of the
//! variables of ROS 2, on one machine and on two.

use crate::common::{Network, Setup, wait_for};
use crate::images::room;
use crate::online;
use crate::program::signal;
use crate::requirements::missing;
use std::process::{Child, Command, Stdio};

/// `ROS_LOCALHOST_ONLY=1` (rmw_cyclonedds of Humble, `rmw_node.cpp`).
const LOCALHOST_ONLY: &str = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"127.0.0.1\"/>\
    </Interfaces></General></Domain></CycloneDDS>";
/// `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST` (of Iron and later): this machine's ports instead of multicast.
const RANGE_LOCALHOST: &str = "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast></General>\
    <Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>\
    <Peers><Peer address=\"localhost\"/></Peers></Discovery></Domain></CycloneDDS>";
const RANGE: &str = "ROS_AUTOMATIC_DISCOVERY_RANGE";

/// Images come in and odometry is heard.
fn meets(network: &Network, own: &[&str]) -> String {
    let setup = Setup::new(8);
    room(setup.frames());
    let listener = network.listen(&["/tessera/odom:=/robot1/tessera/odom"]);
    let camera = network.camera(&setup, &[]);
    let arguments = [&["--namespace", "/robot1/tessera"], own].concat();
    let words = network.join_and_run_with(&setup, &arguments).finish();
    assert!(online(&setup.out()).len() >= 4, "{words}");
    wait_for("odometry on the other side", || listener.n_of("/robot1/tessera/odom") > 0);
    drop(camera);
    words
}

#[test]
fn default_settings_on_both_sides_meet_on_one_machine() {
    for (cyclone, variables) in [
        (None, &[][..]),
        (None, &[(RANGE, "LOCALHOST")]),
        (None, &[("ROS_LOCALHOST_ONLY", "0")]),
        (Some(RANGE_LOCALHOST), &[(RANGE, "LOCALHOST")]),
        (Some(LOCALHOST_ONLY), &[("ROS_LOCALHOST_ONLY", "1")]),
        (Some(LOCALHOST_ONLY), &[]),
    ] {
        let Some(network) = Network::new() else { return };
        let words = meets(&network.between(cyclone, variables), &[]);
        assert!(words.contains("this machine alone"), "{words}");
        assert!(words.contains("depth images that came before are not in the run"), "{words}");
    }
}

#[test]
fn where_nobody_is_heard_it_is_told_what_was_tried_and_what_would_widen_it() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(8);
    let ros2 = network.between(None, &[]).join_and_run(&setup);
    ros2.await_words("no program is heard in DDS domain");
    ros2.await_words("--network all");
    ros2.terminate();
    let (_, words) = ros2.wait();
    assert!(words.contains("by multicast on 127.0.0.1") && words.contains("--domain N"), "{words}");
}

/// A network namespace of one's own, which ends with this.
struct Machine(Child);

impl Machine {
    /// On a network with another one where there is one: both have one user namespace, so that a link may join
    /// them.
    fn new(beside: Option<&Self>) -> Option<Self> {
        let pid = beside.map_or_else(String::new, |machine| machine.0.id().to_string());
        let words: &[&str] = match beside {
            None => &["unshare", "--user", "--map-root-user", "--net", "sleep", "3600"],
            Some(_) => &[
                "nsenter",
                "--target",
                &pid,
                "--user",
                "--preserve-credentials",
                "unshare",
                "--net",
                "sleep",
                "3600",
            ],
        };
        let mut command = Command::new(words[0]);
        command.args(&words[1..]);
        let machine = command.stderr(Stdio::null()).spawn().ok().map(Self)?;
        let own = std::fs::read_link("/proc/self/ns/net").ok()?;
        let path = format!("/proc/{}/ns/net", machine.0.id());
        // It is another one once the program behind it runs.
        for _ in 0..500 {
            if std::fs::read_link(&path).is_ok_and(|net| net != own) && machine.run("ip link set lo up") {
                return Some(machine);
            }
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        None
    }

    /// Words before a command that is to run on it.
    fn inside(&self) -> Vec<String> {
        let pid = self.0.id().to_string();
        let words = ["nsenter", "--target", &pid, "--user", "--net", "--preserve-credentials"];
        words.map(str::to_owned).to_vec()
    }

    fn run(&self, words: &str) -> bool {
        let inside = self.inside();
        let mut command = Command::new(&inside[0]);
        command.args(&inside[1..]).args(words.split(' ')).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        signal(self.0.id(), "-KILL");
        let _ = self.0.wait();
    }
}

/// Two machines on one network.
fn two_machines() -> Option<[Machine; 2]> {
    let first = Machine::new(None)?;
    let machines = [Machine::new(Some(&first))?, first];
    let there = machines[1].0.id();
    let is_linked = machines[0].run(&format!("ip link add eth0 type veth peer name eth0 netns {there}"))
        && machines.iter().zip(["10.77.0.1/24", "10.77.0.2/24"]).all(|(machine, address)| {
            machine.run(&format!("ip address add {address} dev eth0")) && machine.run("ip link set eth0 up")
        });
    is_linked.then_some(machines)
}

#[test]
fn another_machine_is_not_answered_until_the_network_is_opened() {
    let Some(network) = Network::new() else { return };
    let Some(machines) = two_machines() else {
        return missing("namespaces", "no network namespaces of one's own: unshare, nsenter, ip");
    };
    let network = network.between(None, &[]).inside([machines[0].inside(), machines[1].inside()]);
    let setup = Setup::new(8);
    room(setup.frames());
    let camera = network.camera(&setup, &[]);
    let sniffer = network.ask_beside("sniff.py", &["10.77.0.1"]);
    let ros2 = network.join_and_run(&setup);
    ros2.await_words("10.77.0.2 announces itself and is not answered: --network all");
    ros2.terminate();
    let (_, words) = ros2.wait();
    assert!(!words.contains("depth /camera"), "{words}");
    let heard = sniffer.finish();
    assert!(heard.iter().any(|line| line["topic"] == "ready"), "{heard:?}");
    let left: Vec<_> = heard.iter().filter(|line| line["topic"] == "left").collect();
    assert!(left.is_empty(), "datagrams left the machine: {left:?}");
    drop(camera);
    meets(&network, &["--network", "all"]);
}
