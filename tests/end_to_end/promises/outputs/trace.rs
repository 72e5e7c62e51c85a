//! A trace of a run: every frame in every stage, arrows that follow it, and a kill as a mark.

use crate::common::room;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

struct Trace {
    events: Vec<Value>,
    /// Numbers of the processes, by name.
    pids: BTreeMap<String, u64>,
}

impl Trace {
    fn read(path: &Path) -> Self {
        let whole: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
        let events = whole["traceEvents"].as_array().unwrap().clone();
        let named = events.iter().filter(|e| e["name"] == "process_name");
        let pids = named
            .map(|e| (e["args"]["name"].as_str().unwrap().to_owned(), e["pid"].as_u64().unwrap()))
            .collect();
        Self { events, pids }
    }

    fn of_kind<'a>(&'a self, kind: &'a str) -> impl Iterator<Item = &'a Value> {
        self.events.iter().filter(move |e| e["ph"] == kind)
    }

    /// Slices of a stage, of the category `frame` or `step`.
    fn slices(&self, stage: &str, category: &str) -> Vec<&Value> {
        let pid = self.pids[stage];
        self.of_kind("X").filter(|e| e["pid"] == pid && e["cat"] == category).collect()
    }

    /// Slices of a row are apart, as a sum of microseconds finds it: Chrome's own reader leaves
    /// out what overlaps by less than nothing.
    fn assert_apart(&self) {
        let mut rows: BTreeMap<(u64, u64), Vec<(f64, f64)>> = BTreeMap::new();
        for slice in self.of_kind("X") {
            let whole = |key: &str| slice[key].as_u64().unwrap();
            let micros = |key: &str| slice[key].as_f64().unwrap();
            let ends = (micros("ts"), micros("ts") + micros("dur"));
            rows.entry((whole("pid"), whole("tid"))).or_default().push(ends);
        }
        for ((pid, tid), mut slices) in rows {
            slices.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
            for pair in slices.windows(2) {
                assert!(pair[0].1 <= pair[1].0, "process {pid}, row {tid}: {pair:?} overlap");
            }
        }
    }

    /// Whether an arrow's end lies in a slice of its frame.
    fn is_held(&self, stage: &str, arrow: &Value) -> bool {
        let at = arrow["ts"].as_f64().unwrap();
        arrow["pid"] == self.pids[stage]
            && self.slices(stage, "frame").iter().any(|slice| {
                let from = slice["ts"].as_f64().unwrap();
                let to = from + slice["dur"].as_f64().unwrap();
                slice["args"]["frame"] == arrow["args"]["frame"]
                    && slice["tid"] == arrow["tid"]
                    && (from - 1e-3..=to + 1e-3).contains(&at)
            })
    }
}

#[test]
fn a_trace_follows_each_frame_and_marks_a_kill() {
    let plan = "align=computed:20;reconstruct=computed:9";
    let run = room().with_faults(plan);
    let file = run.dir.path().join("trace.json");
    let run = run.with(&["--trace", file.to_str().unwrap()]);
    assert!(run.finish().success());
    let trace = Trace::read(&file);
    trace.assert_apart();
    let n_frames: u64 = crate::common::FRAMES.parse().unwrap();
    for stage in ["sensor", "reconstruct", "align"] {
        let slices = trace.slices(stage, "frame");
        for frame in 0..n_frames {
            let done = |e: &&&Value| e["args"]["frame"] == frame && e["name"] == format!("frame {frame}");
            assert!(slices.iter().any(|e| done(&e)), "frame {frame} in {stage}");
        }
    }
    for (stage, steps) in [
        ("sensor", &["decode"][..]),
        ("reconstruct", &["cloud", "mesh", "normals", "filter", "vertices", "computing"]),
        ("align", &["sampling", "search", "solve", "journal", "send", "publishing"]),
    ] {
        let slices = trace.slices(stage, "step");
        let rows: Vec<(u64, &str)> = trace
            .of_kind("M")
            .filter(|e| e["name"] == "thread_name" && e["pid"] == trace.pids[stage])
            .map(|e| (e["tid"].as_u64().unwrap(), e["args"]["name"].as_str().unwrap()))
            .collect();
        for step in steps {
            let tid = rows.iter().find(|(_, name)| name == step).unwrap_or_else(|| panic!("no row {step}")).0;
            assert!(slices.iter().any(|e| e["tid"] == tid && e["name"] == *step), "{stage}: {step}");
        }
    }
    for frame in 0..n_frames {
        let of = |kind: &'static str| trace.of_kind(kind).filter(move |e| e["args"]["frame"] == frame);
        let is_chained = of("f").filter(|end| trace.is_held("align", end)).any(|end| {
            let through = of("t").find(|e| e["id"] == end["id"]);
            let begin = of("s").find(|e| e["id"] == end["id"]);
            through.is_some_and(|e| trace.is_held("reconstruct", e))
                && begin.is_some_and(|e| trace.is_held("sensor", e))
                && begin.unwrap()["ts"].as_f64() <= through.unwrap()["ts"].as_f64()
                && through.unwrap()["ts"].as_f64() <= end["ts"].as_f64()
        });
        assert!(is_chained, "no arrows follow frame {frame} to align");
    }
    for (stage, frame) in [("align", 20), ("reconstruct", 9)] {
        let marks: Vec<&str> = trace
            .of_kind("i")
            .filter(|e| e["pid"] == trace.pids[stage])
            .map(|e| e["name"].as_str().unwrap())
            .collect();
        let died = format!("{stage} died: signal 9 (SIGKILL)");
        assert_eq!(marks, [format!("{stage} starts"), died, format!("{stage} starts again")]);
        let cut = format!("frame {frame}, not done");
        assert!(trace.slices(stage, "frame").iter().any(|e| e["name"] == cut.as_str()), "{cut}");
    }
    let untraced = room();
    assert!(untraced.finish().success());
    run.assert_same_bytes(&untraced, "a trace, and kills");
    assert!(!run.out().join("trace").exists());
}

#[test]
fn a_trace_that_cannot_be_written_is_told_before_the_run() {
    let run = room().with(&["--trace", "/proc/no/such/file.json"]);
    let output = run.command().output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--trace /proc/no/such/file.json: "));
    assert!(!run.out().exists());
}
