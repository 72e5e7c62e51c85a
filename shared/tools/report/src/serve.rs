//! A page that changes, for browsers on this machine.
//!
//! The server is one more reader of a folder. No process that writes there knows of it, and a browser that
//! is slow or frozen delays nothing but other browsers.

use crate::http::{Answer, answer};
use crate::run_directory::page_of;
use std::net::{Ipv4Addr, TcpListener};
use std::path::PathBuf;
use std::time::{Duration, Instant, SystemTime};
use tessera_outputs::{STATISTICS_FILE, ToolError};
use tessera_stage::RunFiles;

/// Time after which a browser asks again, while the page goes on to change, seconds, at least.
const REFRESH_S: u64 = 5;
/// The same as a multiple of the time that the page took to make: others need the processor more.
const REFRESH_SHARE: u64 = 10;
/// A file that has not been written for so long is of something that is over, or waits.
const IDLE: Duration = Duration::from_secs(15);

/// What a page shows, and what tells whether it has changed.
pub trait LivePage {
    /// The file that is written while the page goes on to change.
    fn growing(&self) -> PathBuf;
    /// When something was written that changes the page beside it.
    fn ended(&self) -> Option<SystemTime> {
        None
    }
    /// The page as it is now.
    ///
    /// # Errors
    /// Where there is nothing to show yet.
    fn make(&self) -> Result<String, ToolError>;
}

/// The report of a run while it goes on.
#[derive(Clone, Debug)]
pub struct RunPage {
    /// Folder of the run.
    pub run_folder: PathBuf,
}

impl LivePage for RunPage {
    fn growing(&self) -> PathBuf {
        RunFiles::new(&self.run_folder).align_journal()
    }

    fn ended(&self) -> Option<SystemTime> {
        std::fs::metadata(self.run_folder.join(STATISTICS_FILE)).and_then(|about| about.modified()).ok()
    }

    fn make(&self) -> Result<String, ToolError> {
        page_of(&[&self.run_folder])
    }
}

/// A server of one page, on the loopback interface alone.
#[derive(Debug)]
pub struct PageServer(TcpListener);

impl PageServer {
    /// A server at a free port.
    ///
    /// # Errors
    /// Where no port can be had.
    pub fn open() -> Result<Self, ToolError> {
        TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map(Self).map_err(cannot)
    }

    /// What to open in a browser.
    ///
    /// # Errors
    /// Where the system does not tell the port.
    pub fn url(&self) -> Result<String, ToolError> {
        Ok(format!("http://{}/", self.0.local_addr().map_err(cannot)?))
    }

    /// Answers browsers, one after the other; comes back only where the socket fails.
    pub fn serve(&self, page: &dyn LivePage) -> ToolError {
        let mut made = MadePage::default();
        loop {
            match self.0.accept() {
                // A browser that goes away harms itself alone.
                Ok((stream, _)) => drop(answer(stream, "/", || made.answer(page))),
                Err(error) => return cannot(error),
            }
        }
    }
}

fn cannot(error: std::io::Error) -> ToolError {
    ToolError::Stage(format!("cannot serve the page on 127.0.0.1: {error}"))
}

/// Length of the growing file, when it was written, and when what stands beside it was.
type Version = (u64, Option<SystemTime>, Option<SystemTime>);

/// The page as it was last made.
#[derive(Default)]
struct MadePage {
    of: Option<Version>,
    body: Vec<u8>,
    /// Time that it took to make.
    took: Duration,
}

impl MadePage {
    /// The page as it is now; made again only where something was written.
    fn answer(&mut self, page: &dyn LivePage) -> Answer {
        let growing = std::fs::metadata(page.growing()).ok();
        let written = growing.as_ref().and_then(|about| about.modified().ok());
        let of = growing.map(|about| (about.len(), written, page.ended()));
        let goes_on = written.and_then(|at| at.elapsed().ok()).is_none_or(|age| age < IDLE);
        let begin = Instant::now();
        let head = |took: Duration| {
            let refresh_s = REFRESH_S.max(REFRESH_SHARE.saturating_mul(took.as_secs()));
            let refresh = if goes_on { format!("Refresh: {refresh_s}\r\n") } else { String::new() };
            format!("Content-Type: text/html; charset=utf-8\r\nCache-Control: no-store\r\n{refresh}")
        };
        if self.of != of || of.is_none() {
            match page.make() {
                Ok(page) => *self = Self { of, body: page.into_bytes(), took: begin.elapsed() },
                // What has only begun has a page when it is asked again a little later.
                Err(error) => {
                    let body = format!("no page yet: {error}\n").into_bytes();
                    return Answer { status: "503 Service Unavailable", head: head(begin.elapsed()), body };
                }
            }
        }
        Answer { status: "200 OK", head: head(self.took), body: self.body.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpStream;

    #[test]
    fn a_folder_without_a_run_is_told_and_asked_for_again() {
        let folder = tempfile::tempdir().unwrap();
        let server = PageServer::open().unwrap();
        let address = server.url().unwrap().trim_start_matches("http://").trim_end_matches('/').to_owned();
        assert!(address.starts_with("127.0.0.1:"));
        std::thread::spawn(move || server.serve(&RunPage { run_folder: folder.path().into() }));
        let ask = |request: &str| {
            let mut stream = TcpStream::connect(&address).unwrap();
            stream.write_all(request.as_bytes()).unwrap();
            let mut text = String::new();
            stream.read_to_string(&mut text).unwrap();
            text
        };
        let answer = ask("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
        assert!(answer.starts_with("HTTP/1.1 503") && answer.contains("Refresh: 5"), "{answer}");
        assert!(answer.contains("config.toml"), "{answer}");
        assert!(ask("GET /etc/passwd HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 404"));
        assert!(ask("GET / HTTP/1.1\r\nHost: example.org\r\n\r\n").starts_with("HTTP/1.1 403"));
    }
}
