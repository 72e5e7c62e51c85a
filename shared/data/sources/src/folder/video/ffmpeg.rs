//! The program ffmpeg: it counts the frames of a video, and decodes them into a pipe.
//!
//! It is started by name, without a shell. It reads that one file, as MP4 or QuickTime: no list that leads to other
//! files, no network.

use std::ffi::OsString;
use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

/// Each frame once: makes even times of uneven ones by repeating none; the second before version 5.1.
const EACH_ONCE: [[&str; 2]; 2] = [["-fps_mode", "passthrough"], ["-vsync", "passthrough"]];
/// The head of a BMP up to its length, and the most that a frame may take.
const HEAD_BYTES: usize = 6;
const MOST_BYTES: usize = 512 << 20;
/// Bytes that are kept of what it complains of.
const MOST_WORDS: u64 = 4096;

/// The program, and how this version of it is told to give each frame once.
#[derive(Clone, Debug)]
pub(super) struct Ffmpeg {
    program: String,
    each_once: [&'static str; 2],
}

impl Ffmpeg {
    /// Finds it, and its version's words, by decoding one frame.
    ///
    /// # Errors
    /// It is not there, or cannot decode the video.
    pub(super) fn find(program: &str, path: &Path) -> Result<Self, String> {
        let [new, old] = EACH_ONCE;
        let newer = Self { program: program.to_owned(), each_once: new };
        let reason = match newer.decode(path)?.next() {
            Ok(_) => return Ok(newer),
            Err(reason) => reason,
        };
        if !reason.contains("fps_mode") {
            return Err(reason);
        }
        let older = Self { each_once: old, ..newer };
        older.decode(path)?.next()?;
        Ok(older)
    }

    /// Frames of a video by its list of them, without decoding.
    pub(super) fn count(&self, path: &Path) -> Result<u64, String> {
        let mut command = self.command(path, &[]);
        command.args(["-c", "copy", "-f", "framecrc", "pipe:1"]);
        let output = command.output().map_err(|error| self.missing(&error))?;
        if !output.status.success() {
            return Err(first_line(&output.stderr));
        }
        let lines = String::from_utf8_lossy(&output.stdout);
        Ok(lines.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).count() as u64)
    }

    /// Begins to decode. What is damaged ends it: a frame that is left out would shift all others.
    pub(super) fn decode(&self, path: &Path) -> Result<FrameStream, String> {
        let mut command = self.command(path, &["-xerror", "-err_detect", "explode"]);
        command.args(self.each_once).args(["-c:v", "bmp", "-pix_fmt", "bgr24"]);
        command.args(["-sws_flags", "accurate_rnd+bitexact", "-f", "image2pipe", "pipe:1"]);
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| self.missing(&error))?;
        let (images, errors) = (child.stdout.take().map(BufReader::new), child.stderr.take());
        let words = std::thread::Builder::new().name("ffmpeg".to_owned()).spawn(move || {
            let mut words = Vec::new();
            let Some(mut errors) = errors else { return words };
            // The rest is read too, so that it does not wait.
            let _ = errors.by_ref().take(MOST_WORDS).read_to_end(&mut words);
            let _ = io::copy(&mut errors, &mut io::sink());
            words
        });
        Ok(FrameStream { child, images, words: words.ok() })
    }

    fn command(&self, path: &Path, before: &[&str]) -> Command {
        let mut file = OsString::from("file:");
        file.push(path);
        let mut command = Command::new(&self.program);
        command.args(["-nostdin", "-hide_banner", "-v", "error"]).args(before);
        command.args([
            "-protocol_whitelist",
            "file",
            "-f",
            "mov",
            "-ignore_editlist",
            "1",
            "-noautorotate",
            "-i",
        ]);
        command.arg(file).args(["-map", "0:V:0"]).stdin(Stdio::null());
        command
    }

    fn missing(&self, error: &io::Error) -> String {
        match error.kind() {
            io::ErrorKind::NotFound => format!("there is no {} on this machine", self.program),
            _ => format!("{} does not start: {error}", self.program),
        }
    }
}

fn first_line(words: &[u8]) -> String {
    let words = String::from_utf8_lossy(words);
    format!("ffmpeg: {}", words.lines().next().unwrap_or("it failed without a reason"))
}

/// Frames as they are decoded; the program ends with it.
#[derive(Debug)]
pub(super) struct FrameStream {
    child: Child,
    images: Option<BufReader<ChildStdout>>,
    words: Option<JoinHandle<Vec<u8>>>,
}

impl FrameStream {
    /// The next frame, as BMP; `None` behind the last.
    ///
    /// # Errors
    /// What ffmpeg complains of.
    pub(super) fn next(&mut self) -> Result<Option<Vec<u8>>, String> {
        let Some(images) = &mut self.images else { return Ok(None) };
        let mut image = Vec::new();
        let read = images.by_ref().take(HEAD_BYTES as u64).read_to_end(&mut image);
        read.map_err(|error| error.to_string())?;
        if image.is_empty() {
            return self.finish().map(|()| None);
        }
        let length =
            image.get(2..HEAD_BYTES).and_then(<[u8]>::first_chunk).map_or(0, |n| u32::from_le_bytes(*n));
        let rest = (length as usize).checked_sub(HEAD_BYTES).filter(|_| length as usize <= MOST_BYTES);
        let Some(rest) = rest.filter(|_| image.starts_with(b"BM")) else {
            return Err(format!("ffmpeg gave {image:?}, expected the head of a BMP"));
        };
        image.reserve_exact(rest);
        images.by_ref().take(rest as u64).read_to_end(&mut image).map_err(|error| error.to_string())?;
        if image.len() != length as usize {
            self.finish()?;
            return Err(format!("{} bytes of a frame, expected {length}", image.len()));
        }
        Ok(Some(image))
    }

    /// Waits for the end, of which nothing more comes.
    fn finish(&mut self) -> Result<(), String> {
        self.images = None;
        let status = self.child.wait().map_err(|error| error.to_string())?;
        let words = self.words.take().and_then(|words| words.join().ok()).unwrap_or_default();
        if status.success() { Ok(()) } else { Err(first_line(&words)) }
    }
}

impl Drop for FrameStream {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
