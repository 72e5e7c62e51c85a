//! Zenoh over TLS: both ends show certificates, which files of Zenoh's own form name.

use crate::common::{Network, Setup, root};
use crate::requirements::missing;
use crate::router::Router;
use std::path::Path;
use std::process::Command;

/// Certificates of a router and of those that may speak to it; `false`, with the reason printed, where
/// there is no openssl.
fn make_certificates(keys: &Path) -> bool {
    let mut command = Command::new(root().join("scripts/fleet_certificates.sh"));
    match command.arg(keys).args(["127.0.0.1", "driver", "robot"]).output() {
        Ok(output) if output.status.success() => true,
        Ok(output) => {
            missing("tools", String::from_utf8_lossy(&output.stderr));
            false
        }
        Err(error) => {
            missing("tools", error);
            false
        }
    }
}

/// Writes the file that `ZENOH_SESSION_CONFIG_URI` names, with the certificate of `folder`.
fn write_session(keys: &Path, endpoint: &str, folder: &Path) {
    let path = |folder: &Path, name: &str| folder.join(name).display().to_string();
    let text = format!(
        "{{ mode: 'client', connect: {{ endpoints: [{endpoint:?}] }}, transport: {{ link: {{ tls: {{
            root_ca_certificate: {:?}, enable_mtls: true,
            connect_certificate: {:?}, connect_private_key: {:?} }} }} }} }}",
        path(keys, "ca.pem"),
        path(folder, "robot.pem"),
        path(folder, "robot.key")
    );
    std::fs::write(keys.join("session.json5"), text).unwrap();
}

#[test]
fn messages_go_over_tls_and_a_certificate_of_another_authority_opens_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let [keys, others] = ["keys", "others"].map(|name| dir.path().join(name));
    if !make_certificates(&keys) || !make_certificates(&others) {
        return;
    }
    let Some(router) = Router::with(Some(keys.clone())) else { return };
    let Some(network) = router.network() else { return };
    assert!(router.endpoint.starts_with("tls/"));
    refuse_stranger(&network, &router, (&keys, &others));
    write_session(&keys, &router.endpoint, &keys);
    let words = crate::exchange(&network);
    assert!(words.contains(&format!("router {} (ZENOH_SESSION_CONFIG_URI", router.endpoint)), "{words}");
    assert!(!words.contains("no Zenoh router"), "{words}");
}

/// With a key that the router's authority has not signed there is no router.
fn refuse_stranger(network: &Network, router: &Router, (keys, others): (&Path, &Path)) {
    write_session(keys, &router.endpoint, others);
    let setup = Setup::new(10);
    let ros2 = network.join(&setup, &[]);
    ros2.await_words(&format!("no Zenoh router at {}: others are not found", router.endpoint));
    // It can be ended meanwhile.
    ros2.terminate();
    let (status, words) = ros2.wait();
    assert!(
        status.code() == Some(4) && words.contains("ended while there was no router"),
        "{status} {words}"
    );
}
