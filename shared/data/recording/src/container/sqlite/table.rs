//! A table: a b-tree of pages, whose leaves hold rows.
//!
//! Source: sqlite.org/fileformat2.html, sections 1.5 (freelists are not visited), 1.6 and 1.7.

use super::pages::{HEADER_BYTES, Pages, short, word};
use super::record::varint;
use crate::container::MOST_BYTES;
use crate::error::RecordingError;

const INTERIOR: u8 = 5;
const LEAF: u8 = 13;
/// Deepest tree: with two children a page, more pages than there can be.
const MOST_LEVELS: usize = 32;

/// The pages of a database as tables.
impl Pages {
    fn damaged(&self, page: u32, reason: impl Into<String>) -> RecordingError {
        RecordingError::Damaged { offset: self.offset(page), reason: reason.into() }
    }

    /// The leaf pages of the table whose root is `root`, in the order of its rows.
    pub(super) fn leaves(&self, root: u32) -> Result<Vec<u32>, RecordingError> {
        let mut leaves = Vec::new();
        let mut n_left = self.n;
        let mut to_visit = vec![(root, 1)];
        while let Some((page, level)) = to_visit.pop() {
            // No page is in a tree twice.
            n_left = n_left
                .checked_sub(1)
                .ok_or_else(|| self.damaged(root, "a table has more pages than the file"))?;
            let bytes = self.read(page)?;
            match bytes.get(start(page)).copied().unwrap_or_default() {
                LEAF => leaves.push(page),
                INTERIOR if level < MOST_LEVELS => {
                    let mut children = self.children(page, &bytes)?;
                    children.reverse();
                    to_visit
                        .extend(children.into_iter().map(|child| (child, usize::saturating_add(level, 1))));
                }
                kind => {
                    let reason = format!("page {page} is of kind {kind}, expected a table's (5 or 13)");
                    return Err(self.damaged(page, reason));
                }
            }
        }
        Ok(leaves)
    }

    /// The children of an interior page from left to right.
    fn children(&self, page: u32, bytes: &[u8]) -> Result<Vec<u32>, RecordingError> {
        let torn = || self.damaged(page, format!("page {page} of a table is not whole"));
        let mut children = Vec::new();
        for cell in cells(page, bytes).ok_or_else(torn)? {
            children.push(word(bytes, cell).ok_or_else(torn)?);
        }
        children.push(word(bytes, start(page).saturating_add(8)).ok_or_else(torn)?);
        Ok(children)
    }

    /// The rows of a leaf: their offsets in the file.
    pub(super) fn rows(&self, page: u32) -> Result<Vec<Row>, RecordingError> {
        let bytes = self.read(page)?;
        let torn = || self.damaged(page, format!("page {page} of a table is not whole"));
        if bytes.get(start(page)) != Some(&LEAF) {
            return Err(torn());
        }
        cells(page, &bytes)
            .ok_or_else(torn)?
            .map(|cell| self.row(page, &bytes, cell).ok_or_else(torn))
            .collect()
    }

    /// The row at an offset of the file.
    pub(super) fn row_at(&self, offset: u64) -> Result<Row, RecordingError> {
        let page = self.page_at(offset);
        let bytes = self.read(page)?;
        let within = usize::try_from(offset.saturating_sub(self.offset(page))).unwrap_or(usize::MAX);
        self.row(page, &bytes, within)
            .ok_or_else(|| self.damaged(page, format!("page {page} of a table is not whole")))
    }

    fn row(&self, page: u32, bytes: &[u8], cell: usize) -> Option<Row> {
        let (len, n_len) = varint(bytes.get(cell..)?)?;
        let id_at = cell.checked_add(n_len)?;
        let (id, n_id) = varint(bytes.get(id_at..)?)?;
        let at = id_at.checked_add(n_id)?;
        let n_local = self.local_bytes(len);
        let end = at.checked_add(n_local)?;
        let local = bytes.get(at..end)?.to_vec();
        let overflow = if n_local as u64 == len { 0 } else { word(bytes, end)? };
        let offset = self.offset(page).saturating_add(cell as u64);
        Some(Row { offset, id: id as i64, len, local, overflow })
    }

    /// Bytes of a payload that stand in its leaf; the rest overflows.
    #[expect(
        clippy::arithmetic_side_effects,
        clippy::cast_possible_truncation,
        reason = "a page has 480 usable bytes at least (Pages::open), and the result is less than a page"
    )]
    fn local_bytes(&self, len: u64) -> usize {
        let usable = self.usable as u64;
        let most = usable - 35;
        if len <= most {
            return len as usize;
        }
        let least = (usable - 12) * 32 / 255 - 23;
        let whole = least + (len - least) % (usable - 4);
        (if whole <= most { whole } else { least }) as usize
    }

    /// The first `most` bytes of a row's payload.
    pub(super) fn payload(&self, row: &Row, most: u64) -> Result<Vec<u8>, RecordingError> {
        let n = row.len.min(most);
        let damaged = |reason| RecordingError::Damaged { offset: row.offset, reason };
        if n > MOST_BYTES {
            return Err(damaged(format!("a row has {n} bytes, expected at most {MOST_BYTES}")));
        }
        let n = usize::try_from(n).unwrap_or(usize::MAX);
        let mut payload = row.local.clone();
        payload.truncate(n);
        let mut next = row.overflow;
        while payload.len() < n {
            let n_left = n.saturating_sub(payload.len());
            if next == 0 {
                return Err(damaged(format!("a row ends {n_left} bytes before its size")));
            }
            let bytes = self.read(next)?;
            next = word(&bytes, 0).unwrap_or(0);
            payload.extend(bytes.iter().skip(4).take(n_left));
        }
        Ok(payload)
    }
}

/// A row of a table.
pub(super) struct Row {
    /// Where it begins in the file.
    pub(super) offset: u64,
    /// Its number: the value of an INTEGER PRIMARY KEY.
    pub(super) id: i64,
    /// Bytes of its payload.
    len: u64,
    /// Those that stand in the leaf.
    local: Vec<u8>,
    /// The first page of the others; 0: none.
    overflow: u32,
}

/// Where the b-tree's part of a page begins.
fn start(page: u32) -> usize {
    if page == 1 { HEADER_BYTES } else { 0 }
}

/// Where the cells of a page begin.
fn cells(page: u32, bytes: &[u8]) -> Option<impl Iterator<Item = usize> + '_> {
    let head = bytes.get(start(page)..)?;
    let n = usize::from(short(head, 3)?);
    let n_head = if head.first() == Some(&INTERIOR) { 12 } else { 8 };
    let pointers = head.get(n_head..)?.as_chunks().0.get(..n)?;
    Some(pointers.iter().map(|pair| usize::from(u16::from_be_bytes(*pair))))
}
