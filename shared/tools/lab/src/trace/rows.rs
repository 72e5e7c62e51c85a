//! The rows of a trace: for each stage one of frames and one for each step, and more where things
//! overlap, as decoding on several threads does.

use tessera_messages::Stage;
use tessera_stage::TraceEvent;

/// What one process wrote.
#[derive(Clone, Debug)]
pub(super) struct Process {
    pub(super) stage: String,
    pub(super) pid: u32,
    pub(super) events: Vec<TraceEvent>,
}

/// Something that took time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Slice {
    /// Step or phase; empty for the frame as a whole.
    pub(super) row: String,
    pub(super) index: u64,
    pub(super) from: u64,
    pub(super) to: u64,
    /// The process, among those that the stage had.
    pub(super) pid: u32,
    /// Whether the process died over it.
    pub(super) is_cut: bool,
}

/// Everything that a stage did, over all its lives; a life ends where `deaths` say.
pub(super) fn slices(stage: Stage, processes: &[Process], deaths: &[u64]) -> Vec<Slice> {
    let mut slices = Vec::new();
    for process in processes.iter().filter(|process| process.stage == stage.name()) {
        let slice = |row: &str, index, from, to| Slice {
            row: row.to_owned(),
            index,
            from,
            to,
            pid: process.pid,
            is_cut: false,
        };
        let mut last_began = None;
        for event in &process.events {
            match event {
                TraceEvent::Begun { index, at } => last_began = Some((*index, *at)),
                TraceEvent::Done { index, from, to } => {
                    last_began = None;
                    slices.push(slice("", *index, *from, *to));
                }
                TraceEvent::Part { index, name, from, to } => slices.push(slice(name, *index, *from, *to)),
                TraceEvent::Mark { .. } => {}
            }
        }
        // What was in hand when the process died.
        if let Some((index, from)) = last_began
            && let Some(to) = deaths.iter().copied().filter(|at| *at >= from).min()
        {
            slices.push(Slice { is_cut: true, ..slice("", index, from, to) });
        }
    }
    slices.sort_by(|a, b| (a.from, b.to).cmp(&(b.from, a.to)));
    slices
}

/// A lane for each slice of one row, so that no two in a lane overlap; slices come in order.
pub(super) fn lanes(slices: &[&Slice]) -> Vec<usize> {
    let mut ends: Vec<u64> = Vec::new();
    slices
        .iter()
        .map(|slice| {
            let lane = ends.iter().position(|end| *end <= slice.from).unwrap_or(ends.len());
            ends.resize(ends.len().max(lane + 1), 0);
            ends[lane] = slice.to;
            lane
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dead_process_leaves_its_last_frame_cut() {
        let life = |pid, events| Process { stage: "align".into(), pid, events };
        let processes = [
            life(
                7,
                vec![
                    TraceEvent::Begun { index: 1, at: 10 },
                    TraceEvent::Part { index: 1, name: "search".into(), from: 11, to: 12 },
                    TraceEvent::Done { index: 1, from: 10, to: 15 },
                    TraceEvent::Begun { index: 2, at: 20 },
                ],
            ),
            life(
                8,
                vec![TraceEvent::Begun { index: 2, at: 50 }, TraceEvent::Done { index: 2, from: 50, to: 60 }],
            ),
        ];
        let found = slices(Stage::Align, &processes, &[30]);
        let short: Vec<_> = found.iter().map(|s| (s.row.as_str(), s.index, s.from, s.to, s.is_cut)).collect();
        let expected = [
            ("", 1, 10, 15, false),
            ("search", 1, 11, 12, false),
            ("", 2, 20, 30, true),
            ("", 2, 50, 60, false),
        ];
        assert_eq!(short, expected);
        assert!(slices(Stage::Sensor, &processes, &[30]).is_empty());
    }

    #[test]
    fn what_overlaps_lies_in_lanes_of_its_own() {
        let slice = |from, to| Slice { row: String::new(), index: 0, from, to, pid: 1, is_cut: false };
        let all = [slice(0, 10), slice(5, 7), slice(7, 20), slice(10, 12), slice(11, 13)];
        assert_eq!(lanes(&all.iter().collect::<Vec<_>>()), [0, 1, 1, 0, 2]);
    }
}
