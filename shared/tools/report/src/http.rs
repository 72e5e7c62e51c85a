//! The little of HTTP that is needed to answer programs on this machine.

use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest that a client may take to ask.
const TO_ASK: Duration = Duration::from_millis(500);
/// Longest that it may take for the next part of the answer.
const TO_READ: Duration = Duration::from_secs(2);
/// Longest request that is read; the piece that goes beyond it is the last.
const MOST_BYTES: usize = 4096;

/// What is answered.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Code and words, such as `200 OK`.
    pub status: &'static str,
    /// Lines of the head, each ended by CR LF; length and end of the connection are added.
    pub head: String,
    /// What follows.
    pub body: Vec<u8>,
}

/// Answers a client's request for `path` by what `make` gives; other requests get a 404. A name in the
/// request other than this machine's is refused: it is a page from elsewhere that asks (DNS rebinding).
///
/// # Errors
/// Where the client goes away or takes too long.
pub fn answer(mut stream: TcpStream, path: &str, make: impl FnOnce() -> Answer) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(TO_ASK))?;
    stream.set_write_timeout(Some(TO_READ))?;
    let request = read_request(&mut stream)?;
    let words = |text: &str| Answer { status: "", head: String::new(), body: text.into() };
    let Answer { status, head, body } = if !is_of_this_machine(&request) {
        Answer { status: "403 Forbidden", ..words("ask by the address 127.0.0.1\n") }
    } else if request.starts_with(&format!("GET {path} ")) {
        make()
    } else {
        Answer { status: "404 Not Found", ..words(&format!("ask for {path}\n")) }
    };
    write!(stream, "HTTP/1.1 {status}\r\n{head}Content-Length: {}\r\nConnection: close\r\n\r\n", body.len())?;
    stream.write_all(&body)
}

/// The head of a request, in whatever pieces it comes.
fn read_request(stream: &mut TcpStream) -> io::Result<String> {
    let began = Instant::now();
    let mut request = Vec::new();
    let mut piece = [0; MOST_BYTES];
    while request.len() < MOST_BYTES && !request.ends_with(b"\r\n\r\n") && began.elapsed() < TO_ASK {
        let n = stream.read(&mut piece)?;
        let Some(read) = piece.get(..n).filter(|read| !read.is_empty()) else { break };
        request.extend_from_slice(read);
    }
    Ok(String::from_utf8_lossy(&request).into_owned())
}

/// Whether the name that the request was made to, where it has one, is one of the loopback interface.
fn is_of_this_machine(request: &str) -> bool {
    let host = request.lines().find_map(|line| {
        let (name, value) = line.split_once(':')?;
        name.eq_ignore_ascii_case("host").then(|| value.trim())
    });
    host.is_none_or(|host| {
        let name = host.rsplit_once(':').filter(|(_, port)| port.parse::<u16>().is_ok());
        let name = name.map_or(host, |(name, _)| name);
        name == "localhost"
            || name == "[::1]"
            || name.starts_with("127.") && name.parse::<std::net::Ipv4Addr>().is_ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_read_in_whatever_pieces_it_comes() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let server = std::thread::spawn(move || {
            let made = || Answer { status: "200 OK", head: String::new(), body: b"all".to_vec() };
            answer(listener.accept().unwrap().0, "/", made)
        });
        for piece in ["GET ", "/ HTTP/1.1\r\nHost: ", "127.0.0.1\r\n", "\r\n"] {
            client.write_all(piece.as_bytes()).unwrap();
            std::thread::sleep(Duration::from_millis(5));
        }
        let mut said = String::new();
        client.read_to_string(&mut said).unwrap();
        assert!(said.starts_with("HTTP/1.1 200 OK") && said.ends_with("all"), "{said}");
        server.join().unwrap().unwrap();
    }

    #[test]
    fn names_from_elsewhere_are_refused() {
        let of = |host: &str| is_of_this_machine(&format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n"));
        assert!(of("127.0.0.1:9464") && of("localhost") && of("[::1]:80") && of("127.0.0.1"));
        assert!(
            !of("example.org") && !of("example.org:80") && !of("127.example.org") && !of("192.168.0.2:80")
        );
        assert!(is_of_this_machine("GET / HTTP/1.0\r\n\r\n"));
    }
}
