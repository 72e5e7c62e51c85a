//! Bags of ROS 2 in SQLite: tables `topics` and `messages`, messages in CDR.
//!
//! Tables are read by their pages; nothing is written, no index is used and no query is run.

mod pages;
mod record;
mod table;

use super::{Channel, Channels, Container, Place, Stored, Take};
use crate::error::RecordingError;
use pages::Pages;
use record::{Value, values};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use table::Row;

/// The first bytes of the file.
pub(super) const MAGIC: &[u8] = b"SQLite format 3\0";

/// Place is a leaf of `messages`.
const LEAF: u8 = 0;
/// Place is one of its rows.
const ROW: u8 = 1;
/// Bytes of a row that hold all before its blob: a head and two integers.
const FRONT_BYTES: u64 = 64;
/// Longest row of other tables: a topic with its quality of service.
const MOST_ROW: u64 = 16 << 20;

/// A bag whose tables have been found.
pub(super) struct SqliteBag {
    pages: Pages,
    channels: Channels,
    places: Vec<Place>,
    /// Columns of `messages`.
    topic_column: usize,
    data_column: usize,
    /// Of the time of recording; `None`: there is none.
    time_column: Option<usize>,
}

/// A table by its definition.
struct Table {
    root: u32,
    columns: Vec<String>,
}

impl Table {
    fn column(&self, name: &str) -> Result<usize, RecordingError> {
        let at = self.columns.iter().position(|column| column == name);
        at.ok_or_else(|| no_bag(&format!("no column '{name}' among {}", self.columns.join(", "))))
    }
}

fn no_bag(found: &str) -> RecordingError {
    RecordingError::Database(format!(
        "is an SQLite database with {found}, expected a bag of ROS 2: tables topics and messages"
    ))
}

impl SqliteBag {
    /// Reads the tables of a file that begins with [`MAGIC`].
    pub(super) fn open(file: File, path: &Path) -> Result<Self, RecordingError> {
        let pages = Pages::open(file, path)?;
        let tables = tables(&pages)?;
        let table = |name: &str| {
            let there_are = || tables.keys().cloned().collect::<Vec<_>>().join(", ");
            tables.get(name).ok_or_else(|| no_bag(&format!("tables '{}'", there_are())))
        };
        let channels = channels(&pages, table("topics")?)?;
        let messages = table("messages")?;
        let (topic_column, data_column) = (messages.column("topic_id")?, messages.column("data")?);
        let leaves = pages.leaves(messages.root)?;
        let place = |page| Place { offset: pages.offset(page), len: pages.size as u64, opcode: LEAF };
        let places = leaves.into_iter().map(place).collect();
        let time_column = messages.column("timestamp").ok();
        Ok(Self { pages, channels, places, topic_column, data_column, time_column })
    }

    /// Gives the message of a row.
    fn message(&self, row: &Row, most: u64, take: &mut Take<'_>) -> Result<(), RecordingError> {
        let place = Place { offset: row.offset, len: 0, opcode: ROW };
        let front = self.pages.payload(row, FRONT_BYTES)?;
        let values = values(&front).unwrap_or_default();
        let (topic, data) = (values.get(self.topic_column), values.get(self.data_column));
        let (Some(Value::Integer(topic)), Some(&Value::Blob { start, len })) = (topic, data) else {
            return Err(place.damaged("it is no row of the table messages"));
        };
        let channel = u32::try_from(*topic).map_err(|_| place.damaged(format!("its topic is {topic}")))?;
        let payload = self.pages.payload(row, start.saturating_add(len.min(most)))?;
        let data = usize::try_from(start).ok().and_then(|start| payload.get(start..)).unwrap_or_default();
        if (data.len() as u64) < len.min(most) {
            return Err(place.damaged("its data are longer than itself"));
        }
        let log_nanos = match self.time_column.and_then(|at| values.get(at)) {
            Some(Value::Integer(nanos)) => *nanos,
            _ => 0,
        };
        take(&Stored { channel, place, number: 0, sequence: row.id.unsigned_abs(), log_nanos, data })
    }
}

/// All tables by their names, from `sqlite_schema`: type, name, table, root, definition.
fn tables(pages: &Pages) -> Result<BTreeMap<String, Table>, RecordingError> {
    let mut tables = BTreeMap::new();
    for row in all_rows(pages, 1)? {
        let [Value::Text(kind), Value::Text(name), _, Value::Integer(root), Value::Text(sql)] = &row.1[..]
        else {
            continue;
        };
        let inside = sql.split_once('(').map(|(_, inside)| inside.trim_end_matches(')')).unwrap_or_default();
        let column = |part: &str| {
            let name = part.split_whitespace().next().unwrap_or_default();
            name.trim_matches(['"', '`', '[', ']', '\'']).to_owned()
        };
        if kind == "table" {
            let columns = inside.split(',').map(column).collect();
            tables.insert(name.clone(), Table { root: u32::try_from(*root).unwrap_or(0), columns });
        }
    }
    Ok(tables)
}

/// The channels by the table `topics`.
fn channels(pages: &Pages, topics: &Table) -> Result<Channels, RecordingError> {
    let [name, kind, form] = ["name", "type", "serialization_format"].map(|column| topics.column(column));
    let (name, kind, form) = (name?, kind?, form?);
    let mut channels = Channels::new();
    for (id, row) in all_rows(pages, topics.root)? {
        let text = |at: usize| match row.get(at) {
            Some(Value::Text(text)) => Some(text.clone()),
            _ => None,
        };
        if let (Ok(id), Some(topic), Some(schema), Some(encoding)) =
            (u32::try_from(id), text(name), text(kind), text(form))
        {
            channels.insert(id, Channel { topic, encoding, schema });
        }
    }
    Ok(channels)
}

/// The rows of a small table with their numbers.
fn all_rows(pages: &Pages, root: u32) -> Result<Vec<(i64, Vec<Value>)>, RecordingError> {
    let mut rows = Vec::new();
    for leaf in pages.leaves(root)? {
        for row in pages.rows(leaf)? {
            let payload = pages.payload(&row, MOST_ROW)?;
            rows.push((row.id, values(&payload).unwrap_or_default()));
        }
    }
    Ok(rows)
}

impl Container for SqliteBag {
    fn name(&self) -> &'static str {
        "bag of ROS 2 in SQLite"
    }

    fn channels(&self) -> (Channels, Option<RecordingError>) {
        (self.channels.clone(), None)
    }

    fn places(&self) -> Vec<Place> {
        self.places.clone()
    }

    fn cut(&self) -> Option<&str> {
        None
    }

    fn messages(&self, place: &Place, most: u64, take: &mut Take<'_>) -> Result<(), RecordingError> {
        if place.opcode == ROW {
            return self.message(&self.pages.row_at(place.offset)?, most, take);
        }
        for row in self.pages.rows(self.pages.page_at(place.offset))? {
            self.message(&row, most, take)?;
        }
        Ok(())
    }
}
