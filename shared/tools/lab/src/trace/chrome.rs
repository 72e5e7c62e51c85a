//! Trace events in the form of Chrome, which Perfetto opens.
//!
//! A stage is a process of the trace, whatever its lives; its rows are threads. Times are
//! microseconds since the first event.

use super::rows::{Process, Slice, lanes, slices};
use serde::Serialize;
use std::collections::BTreeMap;
use tessera_messages::Stage;
use tessera_stage::TraceEvent;

/// Nanoseconds between two slices of a row: microseconds are no whole numbers, and readers that add
/// them leave out a slice that seems to begin before the last has ended.
const APART_NANOS: u64 = 1;
/// Nanoseconds from the beginning of an arrow to the end of its slice, whatever a reader cuts off.
const INSIDE_NANOS: u64 = 4;

/// One event; what a kind has no use for is left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct ChromeEvent {
    /// Kind: `X` slice, `i` instant, `s` `t` `f` arrow, `M` name.
    ph: &'static str,
    name: String,
    cat: &'static str,
    pid: u32,
    tid: usize,
    /// Beginning, microseconds.
    ts: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    dur: Option<f64>,
    /// Arrows of one frame have one number.
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<u64>,
    /// Where an arrow ends: at the slice that encloses it.
    #[serde(skip_serializing_if = "Option::is_none")]
    bp: Option<&'static str>,
    /// Scope of an instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    s: Option<&'static str>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    args: BTreeMap<&'static str, serde_json::Value>,
}

/// A stage with its slices and where each lies.
struct TrackRows {
    stage: Stage,
    slices: Vec<Slice>,
    /// Thread of each slice.
    threads: Vec<usize>,
    /// Names of the threads.
    names: Vec<String>,
}

impl TrackRows {
    fn new(stage: Stage, processes: &[Process], deaths: &[u64]) -> Self {
        let slices = slices(stage, processes, deaths);
        let mut by_row: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (place, slice) in slices.iter().enumerate() {
            by_row.entry(&slice.row).or_default().push(place);
        }
        // Rows in the order in which they first happen; that of frames is empty and comes first.
        let mut order: Vec<(&str, Vec<usize>)> = by_row.into_iter().collect();
        order.sort_by_key(|(row, places)| (!row.is_empty(), places[0]));
        let (mut threads, mut names) = (vec![0; slices.len()], Vec::new());
        for (row, places) in order {
            let of_row: Vec<&Slice> = places.iter().map(|place| &slices[*place]).collect();
            let lanes = lanes(&of_row);
            let first = names.len();
            let row = match row {
                "" if stage == Stage::Optimise => "requests",
                "" => "frames",
                other => other,
            };
            for lane in 0..=lanes.iter().copied().max().unwrap_or(0) {
                names.push(if lane == 0 { row.to_owned() } else { format!("{row} {}", lane + 1) });
            }
            for (place, lane) in places.into_iter().zip(lanes) {
                threads[place] = first + lane;
            }
        }
        Self { stage, slices, threads, names }
    }

    fn pid(&self) -> u32 {
        pid(self.stage)
    }

    /// Whole frames that were done, with their threads.
    fn frames(&self) -> impl Iterator<Item = (&Slice, usize)> {
        let all = self.slices.iter().zip(self.threads.iter().copied());
        all.filter(|(slice, _)| slice.row.is_empty() && !slice.is_cut)
    }

    /// The last slice of a frame that began before a time.
    fn before(&self, index: u64, at: u64) -> Option<(&Slice, usize)> {
        self.frames().filter(|(slice, _)| slice.index == index && slice.from <= at).last()
    }
}

/// Processes of a trace are numbered in the order of the flow.
fn pid(stage: Stage) -> u32 {
    stage.number() + 1
}

/// All events of a run.
pub(super) fn events(processes: &[Process], marks: &[TraceEvent]) -> Vec<ChromeEvent> {
    let marks: Vec<(&str, &str, u64)> = marks
        .iter()
        .filter_map(|mark| match mark {
            TraceEvent::Mark { stage, name, at } => Some((stage.as_str(), name.as_str(), *at)),
            _ => None,
        })
        .collect();
    let rows = Stage::ALL.map(|stage| {
        let is_death = |(of, name, _): &&(&str, &str, u64)| *of == stage.name() && name.contains(" died: ");
        let deaths: Vec<u64> = marks.iter().filter(is_death).map(|mark| mark.2).collect();
        TrackRows::new(stage, processes, &deaths)
    });
    let begins = rows.iter().flat_map(|rows| rows.slices.iter().map(|slice| slice.from));
    let clock = Clock { zero: begins.chain(marks.iter().map(|mark| mark.2)).min().unwrap_or(0) };
    let mut events = Vec::new();
    for rows in &rows {
        names(rows, &mut events);
        events
            .extend(rows.slices.iter().zip(&rows.threads).map(|(slice, tid)| clock.slice(rows, slice, *tid)));
    }
    events.extend(marks.iter().filter_map(|(stage, name, at)| {
        let pid = pid(Stage::from_name(stage)?);
        let (name, ts) = ((*name).to_owned(), clock.micros(*at));
        Some(ChromeEvent { ph: "i", name, cat: "life", pid, ts, s: Some("g"), ..ChromeEvent::default() })
    }));
    clock.arrows(&rows, &mut events);
    events
}

/// The names of a stage and of its rows, and their order.
fn names(rows: &TrackRows, events: &mut Vec<ChromeEvent>) {
    let mut name = |what: &str, tid: usize, key, value: serde_json::Value| {
        events.push(ChromeEvent {
            ph: "M",
            name: what.to_owned(),
            pid: rows.pid(),
            tid,
            args: [(key, value)].into(),
            ..ChromeEvent::default()
        });
    };
    name("process_name", 0, "name", rows.stage.name().into());
    name("process_sort_index", 0, "sort_index", rows.pid().into());
    for (tid, row) in rows.names.iter().enumerate() {
        name("thread_name", tid, "name", row.as_str().into());
        name("thread_sort_index", tid, "sort_index", tid.into());
    }
}

/// Microseconds since the first event.
struct Clock {
    zero: u64,
}

impl Clock {
    fn micros(&self, nanos: u64) -> f64 {
        nanos.saturating_sub(self.zero) as f64 * 1e-3
    }

    fn slice(&self, rows: &TrackRows, slice: &Slice, tid: usize) -> ChromeEvent {
        let what = if rows.stage == Stage::Optimise { "request" } else { "frame" };
        let name = match (slice.row.as_str(), slice.is_cut) {
            ("", false) => format!("{what} {}", slice.index),
            ("", true) => format!("{what} {}, not done", slice.index),
            (row, _) => row.to_owned(),
        };
        ChromeEvent {
            ph: "X",
            name,
            cat: if slice.row.is_empty() { what } else { "step" },
            pid: rows.pid(),
            tid,
            ts: self.micros(slice.from),
            dur: Some(slice.to.saturating_sub(slice.from + APART_NANOS) as f64 * 1e-3),
            args: [(what, slice.index.into()), ("process", slice.pid.into())].into(),
            ..ChromeEvent::default()
        }
    }

    /// Arrows from sensor to reconstruct to align: one chain for each surface that was made.
    fn arrows(&self, rows: &[TrackRows; 4], events: &mut Vec<ChromeEvent>) {
        let [sensor, reconstruct, align, _] = rows;
        let arrow = |ph, rows: &TrackRows, tid, at, id, frame: u64| ChromeEvent {
            ph,
            name: "frame".to_owned(),
            cat: "flow",
            pid: rows.pid(),
            tid,
            ts: self.micros(at),
            id: Some(id),
            bp: (ph == "f").then_some("e"),
            args: [("frame", frame.into())].into(),
            ..ChromeEvent::default()
        };
        let mut followed: BTreeMap<(u64, u64), (&Slice, usize)> = BTreeMap::new();
        for (slice, tid) in align.frames() {
            if let Some((surface, _)) = reconstruct.before(slice.index, slice.from) {
                followed.insert((surface.index, surface.from), (slice, tid));
            }
        }
        for (id, (surface, tid)) in reconstruct.frames().enumerate() {
            let (id, frame) = (id as u64, surface.index);
            let Some((sent, sensor_tid)) = sensor.before(frame, surface.from) else { continue };
            // A slice ends before its end: an arrow that begins there would hang on none.
            let leaves = surface.from.min(sent.to.saturating_sub(INSIDE_NANOS)).max(sent.from);
            events.push(arrow("s", sensor, sensor_tid, leaves, id, frame));
            match followed.get(&(frame, surface.from)) {
                Some((aligned, align_tid)) => {
                    events.push(arrow("t", reconstruct, tid, surface.from, id, frame));
                    events.push(arrow("f", align, *align_tid, aligned.from, id, frame));
                }
                None => events.push(arrow("f", reconstruct, tid, surface.from, id, frame)),
            }
        }
    }
}
