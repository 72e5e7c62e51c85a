//! The report of a run while it goes on, for browsers on this machine.
//!
//! The server is one more reader of the run directory. No process of the run knows of it, and a browser
//! that is slow or frozen delays nothing but other browsers.

use crate::http::{Answer, answer};
use crate::run_directory::page_of;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};
use tessera_outputs::{STATISTICS_FILE, ToolError};
use tessera_stage::RunFiles;

/// Time after which a browser asks again, while the run goes on, seconds, at least.
const REFRESH_S: u64 = 5;
/// The same as a multiple of the time that the page took to make: the run needs the processor more.
const REFRESH_SHARE: u64 = 10;
/// A journal that has not grown for so long is that of a run that is over, or waits.
const IDLE: Duration = Duration::from_secs(15);

/// A server of one page, on the loopback interface alone.
#[derive(Debug)]
pub struct PageServer {
    listener: TcpListener,
    run_folder: PathBuf,
}

impl PageServer {
    /// A server at a free port for the run of a folder.
    ///
    /// # Errors
    /// Where no port can be had.
    pub fn open(run_folder: &Path) -> Result<Self, ToolError> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(cannot)?;
        Ok(Self { listener, run_folder: run_folder.to_owned() })
    }

    /// What to open in a browser.
    ///
    /// # Errors
    /// Where the system does not tell the port.
    pub fn url(&self) -> Result<String, ToolError> {
        Ok(format!("http://{}/", self.listener.local_addr().map_err(cannot)?))
    }

    /// Answers browsers, one after the other; comes back only where the socket fails.
    pub fn serve(&self) -> ToolError {
        let mut page = Page::default();
        loop {
            match self.listener.accept() {
                // A browser that goes away harms itself alone.
                Ok((stream, _)) => drop(answer(stream, "/", || page.answer(&self.run_folder))),
                Err(error) => return cannot(error),
            }
        }
    }
}

fn cannot(error: std::io::Error) -> ToolError {
    ToolError::Stage(format!("cannot serve the page on 127.0.0.1: {error}"))
}

/// The page as it was last made.
#[derive(Default)]
struct Page {
    /// Bytes of the journal then, and when the run's end was last written.
    of: Option<(u64, Option<SystemTime>)>,
    body: Vec<u8>,
    /// Time that it took to make.
    took: Duration,
}

impl Page {
    /// The page as it is now; made again only where the run has gone on or ended.
    fn answer(&mut self, run_folder: &Path) -> Answer {
        let journal = std::fs::metadata(RunFiles::new(run_folder).align_journal());
        let end = std::fs::metadata(run_folder.join(STATISTICS_FILE)).and_then(|about| about.modified());
        let of = journal.as_ref().ok().map(|about| (about.len(), end.ok()));
        let age = journal.and_then(|about| about.modified()).ok().and_then(|at| at.elapsed().ok());
        let goes_on = age.is_none_or(|age| age < IDLE);
        let begin = Instant::now();
        let head = |took: Duration| {
            let refresh_s = REFRESH_S.max(REFRESH_SHARE * took.as_secs());
            let refresh = if goes_on { format!("Refresh: {refresh_s}\r\n") } else { String::new() };
            format!("Content-Type: text/html; charset=utf-8\r\nCache-Control: no-store\r\n{refresh}")
        };
        if self.of != of || of.is_none() {
            match page_of(&[run_folder]) {
                Ok(page) => *self = Self { of, body: page.into_bytes(), took: begin.elapsed() },
                // A run that has only begun; asked again a little later it has a page.
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
        let server = PageServer::open(folder.path()).unwrap();
        let address = server.url().unwrap().trim_start_matches("http://").trim_end_matches('/').to_owned();
        assert!(address.starts_with("127.0.0.1:"));
        std::thread::spawn(move || server.serve());
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
