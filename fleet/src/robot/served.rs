//! The robot's end: a run directory that answers requests. It only reads, and keeps nothing that its
//! successor needs.

use crate::wire::piece::Piece;
use crate::wire::request::{
    Growing, MAX_PIECE_BYTES, MAX_SMALL_BYTES, Offer, PROTOCOL, Request, SMALL_FILES,
};
use crate::wire::surfaces::{WantedSurfaces, append_frame, wire_form};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use tessera_journal::{Chain, MAX_FRAMED_BYTES, RECORD_HEADER_BYTES, StoreView, checksum_in};
use tessera_messages::max_stored_bytes;
use tessera_outputs::read_settings;
pub use tessera_stage::identity_of;
use tessera_stage::{RunFile, RunFiles, journal_slot};
use tessera_surface::Grid;

/// Bytes of a request that are answered at most, however many were asked for.
const MOST_BYTES: u64 = 16 << 20;
/// Bytes of a journal that are looked at at a time.
const LOOK_BYTES: usize = 1 << 20;

/// A run directory and how far its journals are whole.
pub struct Served {
    folder: PathBuf,
    identity: u64,
    align: WholeRecords,
    optimise: WholeRecords,
    /// Of this run.
    grid: Option<Grid>,
    /// Checksums of small files as they were when they were read last.
    small: BTreeMap<&'static str, (FileVersion, u32)>,
}

/// A state of a small file: each is written whole, as a new file.
#[derive(Clone, Copy, PartialEq, Eq)]
struct FileVersion {
    inode: u64,
    n_bytes: u64,
    changed: (i64, i64),
}

impl FileVersion {
    fn of(path: &Path) -> io::Result<Self> {
        let found = std::fs::metadata(path)?;
        Ok(Self { inode: found.ino(), n_bytes: found.len(), changed: (found.ctime(), found.ctime_nsec()) })
    }
}

/// How far a journal is whole.
struct WholeRecords {
    chain: Chain,
    /// Where each record ends, with its checksum; the header first.
    ends: Vec<(u64, u32)>,
}

impl WholeRecords {
    fn new(file: Growing) -> Self {
        Self { chain: Chain::new(file.kind()), ends: Vec::new() }
    }

    /// Whether the last record is in the file still, with its checksum, which goes back to the first.
    fn fits(&self, file: &File, end: u64) -> io::Result<bool> {
        if end < self.chain.len_bytes() {
            return Ok(false);
        }
        let [.., before, last] = self.ends[..] else { return Ok(true) };
        let mut header = [0; RECORD_HEADER_BYTES];
        file.read_exact_at(&mut header, before.0)?;
        Ok(checksum_in(&header) == Some(last.1))
    }

    /// Takes bytes behind the whole ones in; answers how many of them are whole. Others are a record
    /// that is being written, or damage: neither travels.
    fn take(&mut self, bytes: &[u8], path: &Path) -> usize {
        let mut used = 0;
        while let Ok(Some(part)) = self.chain.step(bytes.get(used..).unwrap_or_default(), path) {
            used = used.saturating_add(part.len);
            self.ends.push((self.chain.len_bytes(), self.chain.checksum()));
        }
        used
    }
}

impl Served {
    /// The run in a folder.
    ///
    /// # Errors
    /// Where it has no `run.json` yet.
    pub fn open(folder: &Path) -> io::Result<Self> {
        let identity = identity_of(&small_file(folder, "run.json")?);
        let [align, optimise] = [Growing::Align, Growing::Optimise].map(WholeRecords::new);
        let (folder, small) = (folder.to_owned(), BTreeMap::new());
        Ok(Self { folder, identity, align, optimise, grid: None, small })
    }

    fn begin(&mut self, identity: u64) {
        self.identity = identity;
        self.grid = None;
        [self.align, self.optimise] = [Growing::Align, Growing::Optimise].map(WholeRecords::new);
    }

    /// The run directory.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The identity of the run that is there now: another run of the same name may have taken the place of
    /// the one before.
    ///
    /// # Errors
    /// Where `run.json` cannot be read.
    pub fn current(&mut self) -> io::Result<u64> {
        let identity = identity_of(&small_file(&self.folder, "run.json")?);
        if identity != self.identity {
            self.begin(identity);
        }
        Ok(identity)
    }

    /// Answers a request; `give` says `false` where the asker is gone.
    pub fn answer(&mut self, request: &Request, give: &mut dyn FnMut(Piece) -> bool) {
        let identity = match self.current() {
            Ok(identity) => identity,
            Err(error) => {
                give(Piece::refused(self.identity, &format!("run.json: {error}")));
                return;
            }
        };
        let answered = match request {
            Request::Offer => self.offer().map(|offer| give_small(identity, offer, give)),
            Request::Small { file } => {
                small_file(&self.folder, file).map(|bytes| give_small(identity, bytes, give))
            }
            Request::Bytes { identity: asked, .. } | Request::Surfaces { identity: asked, .. }
                if *asked != identity =>
            {
                Err(io::Error::other(format!("run {asked:016x} is not here: it is {identity:016x}")))
            }
            Request::Bytes { file: Growing::Store, from, max, .. } => self.give_store(*from, *max, give),
            Request::Bytes { file, from, checksum, max, .. } => {
                self.give_journal(*file, (*from, *checksum), *max, give)
            }
            Request::Surfaces { max, wanted, .. } => self.give_surfaces(wanted, *max, give),
            Request::Answer { .. } => Err(io::Error::other("a run directory that is read alone")),
        };
        if let Err(error) = answered {
            give(Piece::refused(identity, &error.to_string()));
        }
    }

    fn offer(&mut self) -> io::Result<Vec<u8>> {
        self.look(Growing::Align)?;
        self.look(Growing::Optimise)?;
        let mut small = BTreeMap::new();
        for name in SMALL_FILES {
            if self.folder.join(name).is_file() {
                small.insert(name.to_owned(), self.checksum_of_small(name)?);
            }
        }
        let run: serde_json::Value = serde_json::from_slice(&small_file(&self.folder, "run.json")?)?;
        let text = |key: &str| run.get(key).and_then(|value| value.as_str()).unwrap_or_default().to_owned();
        let offer = Offer {
            protocol: PROTOCOL,
            version: text("version"),
            run: text("name"),
            identity: self.identity,
            align_bytes: self.align.chain.len_bytes(),
            optimise_bytes: self.optimise.chain.len_bytes(),
            store_bytes: len(&self.folder.join(Growing::Store.file()))?,
            small,
        };
        Ok(serde_json::to_vec(&offer)?)
    }

    /// CRC-32 of a small file, read anew where it is another one than before.
    fn checksum_of_small(&mut self, name: &'static str) -> io::Result<u32> {
        let version = FileVersion::of(&self.folder.join(name))?;
        if let Some((_, checksum)) = self.small.get(name).filter(|(known, _)| *known == version) {
            return Ok(*checksum);
        }
        let checksum = crc32fast::hash(&small_file(&self.folder, name)?);
        self.small.insert(name, (version, checksum));
        Ok(checksum)
    }

    /// Goes through what a journal has gained. A journal that was cut or replaced, as that of a run that
    /// is resumed after a power loss, is gone through again.
    fn look(&mut self, file: Growing) -> io::Result<()> {
        let path = self.folder.join(file.file());
        let whole = if file == Growing::Align { &mut self.align } else { &mut self.optimise };
        let end = len(&path)?;
        if end == 0 {
            *whole = WholeRecords::new(file);
            return Ok(());
        }
        let open = File::open(&path)?;
        if !whole.fits(&open, end)? {
            *whole = WholeRecords::new(file);
        }
        let mut n_look = LOOK_BYTES;
        loop {
            let from = whole.chain.len_bytes();
            let n = usize::try_from(end.saturating_sub(from)).unwrap_or(n_look).min(n_look);
            let mut bytes = vec![0; n];
            open.read_exact_at(&mut bytes, from)?;
            let is_all = from.saturating_add(n as u64) == end;
            match whole.take(&bytes, &path) {
                // A record larger than what was looked at.
                0 if !is_all && n_look <= MAX_FRAMED_BYTES => n_look = n_look.saturating_mul(4),
                // Of another version, or no journal: nothing of it will ever travel.
                0 if from == 0 => {
                    let found = whole.chain.step(&bytes, &path);
                    return found.map(|_| ()).map_err(|error| io::Error::other(error.to_string()));
                }
                0 => return Ok(()),
                _ => {}
            }
        }
    }

    /// Gives surfaces as they travel, one at least and no more once `max` bytes are reached.
    fn give_surfaces(
        &mut self,
        wanted: &WantedSurfaces,
        max: u64,
        give: &mut dyn FnMut(Piece) -> bool,
    ) -> io::Result<()> {
        let grid = match self.grid {
            Some(grid) => grid,
            None => *self.grid.insert(grid_of(&self.folder).map_err(io::Error::other)?),
        };
        let most = max_stored_bytes(grid) as u64;
        let view = StoreView::open(&self.folder.join(Growing::Store.file())).map_err(io::Error::other)?;
        let mut stream = Vec::new();
        for slot in wanted.slots() {
            if !stream.is_empty() && stream.len() as u64 >= max.min(MOST_BYTES) {
                break;
            }
            // Damaged or given up: it is gone either way.
            let stored = (slot.len <= most).then(|| view.read(&journal_slot(slot)).ok()).flatten().flatten();
            let form = stored.and_then(|stored| wire_form(grid, &stored).ok());
            append_frame(&mut stream, form.as_deref());
        }
        let mut at = 0;
        for bytes in stream.chunks(MAX_PIECE_BYTES) {
            if !give(Piece::packed(self.identity, at, bytes.to_vec())) {
                return Ok(());
            }
            at = u64::saturating_add(at, bytes.len() as u64);
        }
        give(Piece::end(self.identity, at));
        Ok(())
    }

    fn give_journal(
        &mut self,
        file: Growing,
        (from, checksum): (u64, u32),
        max: u64,
        give: &mut dyn FnMut(Piece) -> bool,
    ) -> io::Result<()> {
        self.look(file)?;
        let ends = if file == Growing::Align { &self.align.ends } else { &self.optimise.ends };
        let behind = match ends.binary_search_by_key(&from, |end| end.0) {
            Ok(place) if ends.get(place).is_some_and(|end| end.1 == checksum) => {
                ends.get(place.saturating_add(1)..)
            }
            Err(0) if from == 0 => Some(&ends[..]),
            _ => return Err(io::Error::other(format!("{REPLACED}: {} at {from}", file.file()))),
        };
        let behind = behind.unwrap_or_default();
        let limit = from.saturating_add(max.min(MOST_BYTES));
        let n_within = behind.partition_point(|end| end.0 <= limit);
        // One record at least, however large.
        let last = behind.get(n_within.saturating_sub(1));
        let to = last.map_or(from, |end| end.0);
        self.give_range(file, from..to, give)
    }

    fn give_store(&self, from: u64, max: u64, give: &mut dyn FnMut(Piece) -> bool) -> io::Result<()> {
        let end = len(&self.folder.join(Growing::Store.file()))?;
        let to = end.min(from.saturating_add(max.min(MOST_BYTES)));
        self.give_range(Growing::Store, from..to.max(from), give)
    }

    fn give_range(
        &self,
        file: Growing,
        range: std::ops::Range<u64>,
        give: &mut dyn FnMut(Piece) -> bool,
    ) -> io::Result<()> {
        let mut at = range.start;
        if at < range.end {
            let open = File::open(self.folder.join(file.file()))?;
            while at < range.end {
                let n =
                    usize::try_from(range.end.saturating_sub(at)).unwrap_or(usize::MAX).min(MAX_PIECE_BYTES);
                let mut bytes = vec![0; n];
                open.read_exact_at(&mut bytes, at)?;
                if !give(Piece::data(self.identity, at, bytes)) {
                    return Ok(());
                }
                at = at.saturating_add(n as u64);
            }
        }
        give(Piece::end(self.identity, at));
        Ok(())
    }
}

/// The shape of a run's surfaces, as its own files say.
///
/// # Errors
/// Where they cannot be read.
pub(crate) fn grid_of(folder: &Path) -> Result<Grid, String> {
    let files = RunFiles::new(folder);
    let run = RunFile::read_recorded(&files).map_err(|error| error.to_string())?;
    let settings = read_settings(&files).map_err(|error| error.to_string())?;
    Ok(run.layout(&settings).grid)
}

/// How a refusal begins where the base has other bytes than the robot.
pub const REPLACED: &str = "other records";

fn give_small(identity: u64, bytes: Vec<u8>, give: &mut dyn FnMut(Piece) -> bool) {
    let n = bytes.len() as u64;
    if give(Piece::data(identity, 0, bytes)) {
        give(Piece::end(identity, n));
    }
}

fn small_file(folder: &Path, name: &str) -> io::Result<Vec<u8>> {
    let path = folder.join(name);
    let n = std::fs::metadata(&path)?.len();
    if n > MAX_SMALL_BYTES as u64 {
        return Err(io::Error::other(format!("{name} has {n} bytes, at most {MAX_SMALL_BYTES} travel")));
    }
    std::fs::read(path)
}

fn len(path: &Path) -> io::Result<u64> {
    match std::fs::metadata(path) {
        Ok(found) => Ok(found.len()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(0),
        Err(error) => Err(error),
    }
}
