//! Several runs in one table, from their `summary.json`.

use crate::ToolError;
use serde_json::Value;
use std::path::Path;

/// Heads of the columns.
const HEAD: [&str; 7] = ["run", "frames", "not tracked", "ATE m", "CPU ms/frame", "frames/s", "verdict"];

/// A row for each run, with columns as wide as their widest cell. ATE is that of `trajectory.txt`
/// against the ground truth, `-` without one; CPU time is that of all stages.
///
/// # Errors
/// Names the summary that cannot be read.
pub fn comparison(run_folders: &[&Path]) -> Result<String, ToolError> {
    let mut rows = vec![HEAD.map(str::to_owned)];
    for folder in run_folders {
        let path = folder.join("summary.json");
        let wrong = |error: &dyn std::fmt::Display| ToolError::Input(format!("{}: {error}", path.display()));
        let text = std::fs::read(&path).map_err(|error| wrong(&error))?;
        let summary: Value = serde_json::from_slice(&text).map_err(|error| wrong(&error))?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        rows.push(row(&name, &summary));
    }
    let mut widths = [0; HEAD.len()];
    for row in &rows {
        widths.iter_mut().zip(row).for_each(|(width, cell)| *width = cell.chars().count().max(*width));
    }
    let [first_width, widths @ ..] = widths;
    let mut table = String::new();
    for row in &rows {
        // Names to the left, numbers to the right; what follows the verdict is nothing.
        let [first, numbers @ .., last] = row;
        let mut line = format!("  {first:<width$}", width = first_width);
        for (cell, width) in numbers.iter().zip(&widths) {
            line.push_str(&format!("  {cell:>width$}"));
        }
        table.push_str(&format!("{line}  {last}\n"));
    }
    Ok(table)
}

fn row(name: &str, summary: &Value) -> [String; HEAD.len()] {
    let number = |key: &str| summary.get(key).and_then(Value::as_f64).unwrap_or(0.0);
    let stages = summary.get("cpu_ms_per_frame").and_then(Value::as_object).into_iter().flatten();
    // From 0, for the sum of nothing is -0.
    let cpu_ms = stages.filter_map(|(_, ms)| ms.as_f64()).fold(0.0, |sum, ms| sum + ms);
    let (processed, wall_s) = (number("frames_processed"), number("wall_s"));
    let rate = if wall_s > 0.0 { format!("{:.1}", processed / wall_s) } else { "-".to_owned() };
    let ate = summary.pointer("/final/ate_rmse_m").and_then(Value::as_f64);
    let verdict = summary.pointer("/verdict/grade").and_then(Value::as_str).unwrap_or("-");
    [
        name.to_owned(),
        processed.to_string(),
        number("frames_untracked").to_string(),
        ate.map_or("-".to_owned(), |metres| format!("{metres:.4}")),
        format!("{cpu_ms:.1}"),
        rate,
        verdict.to_owned(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_run_has_its_row_and_columns_stand_below_their_heads() {
        let folder = tempfile::tempdir().unwrap();
        let run = |name: &str, text: &str| {
            let run = folder.path().join(name);
            std::fs::create_dir(&run).unwrap();
            std::fs::write(run.join("summary.json"), text).unwrap();
            run
        };
        let long = run(
            "kitchen-1",
            r#"{"frames_processed": 450, "frames_untracked": 3, "wall_s": 9.0, "final": {"ate_rmse_m": 0.02352},
                "cpu_ms_per_frame": {"align": 8.25, "sensor": 2.0}, "verdict": {"grade": "doubtful"}}"#,
        );
        let short = run("a", r#"{"frames_processed": 9, "verdict": {"grade": "good"}}"#);
        let table = comparison(&[&long, &short]).unwrap();
        let expected = "  run        frames  not tracked   ATE m  CPU ms/frame  frames/s  verdict\n  \
                          kitchen-1     450            3  0.0235          10.2      50.0  doubtful\n  \
                          a               9            0       -           0.0         -  good\n";
        assert_eq!(table, expected, "{table}");
        let gone = comparison(&[folder.path()]).unwrap_err().to_string();
        assert!(gone.contains("summary.json"), "{gone}");
    }
}
