//! `tessera top --metrics`: figures for Prometheus, on the loopback interface alone.

use crate::exit::CommandError;
use crate::terminal::say;
use crate::top::{Watcher, metrics};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

/// Time between two looks for a question.
const POLL: Duration = Duration::from_millis(50);
/// Longest that a client may take to ask or to read.
const PATIENCE: Duration = Duration::from_millis(500);

/// Answers questions for as long as `goes_on` says so.
pub(crate) fn serve(
    address: SocketAddr,
    watcher: &mut Watcher,
    mut goes_on: impl FnMut() -> Result<bool, CommandError>,
) -> Result<(), CommandError> {
    let cannot = |error: std::io::Error| CommandError::Arguments(format!("--metrics {address}: {error}"));
    let listener = TcpListener::bind(address).map_err(cannot)?;
    listener.set_nonblocking(true).map_err(cannot)?;
    let bound = listener.local_addr().map_err(cannot)?;
    say(&format!("metrics on http://{bound}/metrics, for this machine alone"));
    while goes_on()? {
        watcher.listen(POLL)?;
        while let Ok((stream, _)) = listener.accept() {
            // A client that goes away harms itself alone.
            let _ = answer(stream, &metrics(&watcher.look()));
        }
    }
    Ok(())
}

fn answer(mut stream: TcpStream, text: &str) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut request = [0; 1024];
    let n = stream.read(&mut request)?;
    let is_asked = request[..n].starts_with(b"GET /metrics ");
    let (status, body) = if is_asked { ("200 OK", text) } else { ("404 Not Found", "ask for /metrics\n") };
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: text/plain; version=0.0.4\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    )
}
