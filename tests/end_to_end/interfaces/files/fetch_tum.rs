//! `scripts/fetch_tum.sh` against a web server on this machine with a made-up sequence.

use crate::requirements::missing;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

const LONG: &str = "rgbd_dataset_freiburg1_tiny";

/// A server of static files that ends with the test.
struct Server {
    child: Child,
    url: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn is_there(program: &str) -> bool {
    let tried = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    tried.is_ok_and(|status| status.success())
}

/// Serves a folder, ranges of bytes included; `None`, with the reason printed, where that cannot be.
fn serve(folder: &Path) -> Option<Server> {
    for program in ["python3", "curl", "bash", "tar", "gzip"] {
        if !is_there(program) {
            let requirement = if program == "python3" { "python" } else { "tools" };
            missing(requirement, format_args!("there is no {program}"));
            return None;
        }
    }
    let mut child = Command::new("python3")
        .args(["-u", "-c", SERVER])
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut port = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut port).unwrap();
    Some(Server { child, url: format!("http://127.0.0.1:{}", port.trim()) })
}

/// Static files on a free port of the loopback, with `Range: bytes=N-` as curl asks for it.
const SERVER: &str = r#"
import http.server, os
class Handler(http.server.SimpleHTTPRequestHandler):
    def send_head(self):
        path, wanted = self.translate_path(self.path), self.headers.get("Range")
        if not os.path.isfile(path) or not wanted:
            return super().send_head()
        start, whole = int(wanted.split("=")[1].split("-")[0]), os.path.getsize(path)
        open("resumed_at", "w").write(str(start))
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {start}-{whole - 1}/{whole}")
        self.send_header("Content-Length", str(whole - start))
        self.end_headers()
        file = open(path, "rb")
        file.seek(start)
        return file
server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
print(server.server_port, flush=True)
server.serve_forever()
"#;

/// Puts a sequence into a server's folder.
fn publish(server: &Path, parts: &[&str]) {
    let sequence = server.join("stage").join(LONG);
    fs::create_dir_all(&sequence).unwrap();
    for part in parts {
        match part.split_once('.') {
            Some(_) => fs::write(sequence.join(part), format!("# {part}\n")).unwrap(),
            None => fs::create_dir(sequence.join(part)).unwrap(),
        }
    }
    fs::create_dir_all(server.join("freiburg1")).unwrap();
    let archive = server.join("freiburg1").join(format!("{LONG}.tgz"));
    let packed = Command::new("tar")
        .args(["--create", "--gzip", "--file"])
        .arg(&archive)
        .arg("--directory")
        .arg(server.join("stage"))
        .arg(LONG)
        .status();
    assert!(packed.unwrap().success());
}

const PARTS: [&str; 5] = ["depth.txt", "rgb.txt", "groundtruth.txt", "depth", "rgb"];

fn fetch(url: &str, to: &Path, sequences: &[&str]) -> Output {
    Command::new("bash")
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/fetch_tum.sh"))
        .arg(to)
        .args(sequences)
        .env("TESSERA_TUM_URL", url)
        .env_remove("http_proxy")
        .output()
        .unwrap()
}

fn words(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn a_sequence_is_fetched_unpacked_and_given_its_camera() {
    let dir = tempfile::tempdir().unwrap();
    let (www, to) = (dir.path().join("www"), dir.path().join("to"));
    fs::create_dir(&www).unwrap();
    let Some(server) = serve(&www) else { return };
    publish(&www, &PARTS);
    let output = fetch(&server.url, &to, &["fr1_tiny"]);
    assert!(output.status.success(), "{}", words(&output));
    let folder = to.join(LONG);
    let camera = tessera_sources::load_camera(&folder.join("camera.toml")).unwrap();
    assert_eq!(camera, tessera_sources::named_camera("freiburg1").unwrap());
    assert!(folder.join("depth.txt").is_file() && folder.join("rgb").is_dir());
    assert_eq!(fs::read_dir(&to).unwrap().count(), 1, "the archive and the half-made folder are gone");
    let output = fetch(&server.url, &to, &["fr1_tiny"]);
    assert!(output.status.success() && words(&output).contains("fr1_tiny: is there"), "{}", words(&output));
}

#[test]
fn an_interrupted_download_goes_on_where_it_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let (www, to) = (dir.path().join("www"), dir.path().join("to"));
    fs::create_dir(&www).unwrap();
    let Some(server) = serve(&www) else { return };
    publish(&www, &PARTS);
    let mut begin = vec![0; 100];
    fs::File::open(www.join(format!("freiburg1/{LONG}.tgz"))).unwrap().read_exact(&mut begin).unwrap();
    fs::create_dir(&to).unwrap();
    fs::write(to.join(format!("{LONG}.tgz.part")), begin).unwrap();
    let output = fetch(&server.url, &to, &["fr1_tiny"]);
    assert!(output.status.success(), "{}", words(&output));
    assert_eq!(fs::read_to_string(www.join("resumed_at")).unwrap(), "100");
    assert!(to.join(LONG).join("groundtruth.txt").is_file());
}

#[test]
fn what_goes_wrong_is_named_and_leaves_no_half_sequence() {
    let dir = tempfile::tempdir().unwrap();
    let (www, to) = (dir.path().join("www"), dir.path().join("to"));
    fs::create_dir(&www).unwrap();
    let Some(server) = serve(&www) else { return };
    let refused = |sequences: &[&str], expected: &str| {
        let output = fetch(&server.url, &to, sequences);
        assert!(!output.status.success() && words(&output).contains(expected), "{}", words(&output));
        assert!(!to.join(LONG).exists());
    };
    refused(&["desk"], "no sequence 'desk': expected a name like fr1_desk");
    refused(&["fr1_nowhere"], "rgbd_dataset_freiburg1_nowhere.tgz: not to be had");
    publish(&www, &["depth.txt", "rgb.txt", "depth", "rgb"]);
    refused(&["fr1_tiny"], "there is no groundtruth.txt");
    let archive = www.join(format!("freiburg1/{LONG}.tgz"));
    let mut bytes = fs::read(&archive).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0xff;
    fs::write(&archive, bytes).unwrap();
    let _ = fs::remove_file(to.join(format!("{LONG}.tgz.part")));
    refused(&["fr1_tiny"], "is damaged and was removed");
    assert!(!to.join(format!("{LONG}.tgz.part")).exists());
    drop(server);
}
