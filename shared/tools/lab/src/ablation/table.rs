//! Results of an ablation, as data: the rows, their errors, and the average improvement.

use super::columns::{Column, REFERENCE};
use super::parts::{PARTS, Part};
use super::peers::PeerResult;
use serde::Serialize;

/// Least, median and most over the seeds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The middle value; of an even number the mean of the two.
    pub median: f64,
    /// The smallest.
    pub least: f64,
    /// The largest.
    pub most: f64,
}

impl Spread {
    /// Of at least one value.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let (least, most) = (*sorted.first()?, *sorted.last()?);
        let middle = sorted.len() / 2;
        let median =
            if sorted.len() % 2 == 1 { sorted[middle] } else { 0.5 * (sorted[middle - 1] + sorted[middle]) };
        Some(Self { median, least, most })
    }
}

/// The errors of one column on one sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableCell {
    /// RPE over one second, translation, RMSE, metres per second.
    pub rpe_m_per_s: Spread,
    /// Frames that were not tracked, the largest number over the seeds.
    pub frames_untracked: usize,
}

/// The whole system on one sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Whole {
    /// ATE of the final trajectory, RMSE, metres.
    pub ate_m: Spread,
    /// RPE of the trajectory as first published, translation, RMSE, metres per second.
    pub rpe_online_m_per_s: Spread,
    /// Frames that were not tracked, the largest number over the seeds.
    pub frames_untracked: usize,
}

/// One sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AblationRow {
    /// Its name, without the path.
    pub sequence: String,
    /// Frames processed.
    pub frames: u64,
    /// One for each column.
    pub cells: Vec<TableCell>,
    /// All parts together, with loops and the final optimisation.
    pub whole: Whole,
    /// The whole system without each part.
    pub without: Vec<Whole>,
    /// What others reach on the same frames.
    pub peers: Vec<PeerResult>,
}

/// Head of a column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Head {
    /// What it varies.
    pub name: String,
    /// Its settings over the base.
    pub settings: Vec<String>,
}

/// All tables.
#[derive(Clone, Debug, Serialize)]
pub struct Tables {
    /// Preset or file of the first table.
    pub columns_base: String,
    /// Preset or file of the whole system.
    pub whole_base: String,
    /// Sampling seeds.
    pub seeds: u64,
    /// Heads of the first table.
    pub columns: Vec<Head>,
    /// Parts of the whole system that are left out in turn.
    pub parts: Vec<Part>,
    /// A row for each sequence.
    pub rows: Vec<AblationRow>,
    /// By how much a column lowers the RPE of pairwise n = 4 without filter, the mean over the
    /// sequences of the share, percent; negative where it is worse.
    pub average_improvement_percent: Vec<f64>,
}

impl Tables {
    /// Puts the measured rows of all sequences into tables.
    pub fn new(bases: [&str; 2], seeds: u64, columns: &[Column], rows: Vec<AblationRow>) -> Self {
        let head = |c: &Column| Head { name: c.name.clone(), settings: c.overrides.clone() };
        Self {
            columns_base: bases[0].to_owned(),
            whole_base: bases[1].to_owned(),
            seeds,
            columns: columns.iter().map(head).collect(),
            parts: PARTS.to_vec(),
            average_improvement_percent: average_improvement_percent(&rows, columns.len()),
            rows,
        }
    }
}

fn average_improvement_percent(rows: &[AblationRow], n_columns: usize) -> Vec<f64> {
    let rpe = |row: &AblationRow, column: usize| row.cells[column].rpe_m_per_s.median;
    (0..n_columns)
        .map(|column| {
            let sum: f64 = rows.iter().map(|row| 1.0 - rpe(row, column) / rpe(row, REFERENCE)).sum();
            100.0 * sum / rows.len() as f64
        })
        .collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::columns::columns;
    use super::*;

    /// Tables with these errors, a row for each sequence.
    pub(crate) fn tables(rows: &[(&str, [f64; 11])]) -> Tables {
        let spread = |v: f64| Spread { median: v, least: v, most: v };
        let rows = rows
            .iter()
            .map(|(sequence, errors)| AblationRow {
                sequence: (*sequence).to_owned(),
                frames: 100,
                cells: errors.map(|e| TableCell { rpe_m_per_s: spread(e), frames_untracked: 0 }).into(),
                whole: Whole {
                    ate_m: spread(0.0171),
                    rpe_online_m_per_s: spread(0.028),
                    frames_untracked: 0,
                },
                without: vec![
                    Whole {
                        ate_m: spread(0.03),
                        rpe_online_m_per_s: spread(0.04),
                        frames_untracked: 7
                    };
                    PARTS.len()
                ],
                peers: super::super::peers::Peers::built_in().unwrap().of(sequence),
            })
            .collect();
        Tables::new(["paper", "default"], 1, &columns(), rows)
    }

    #[test]
    fn the_improvement_is_the_mean_of_the_shares() {
        let mut first = [0.1; 11];
        let mut second = [0.4; 11];
        (first[10], second[10]) = (0.05, 0.1);
        (first[0], second[0]) = (0.2, 0.4);
        let found = tables(&[("a", first), ("b", second)]).average_improvement_percent;
        let expected = [-50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 62.5];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
    }

    #[test]
    fn a_spread_is_median_least_and_most() {
        let spread = |values: &[f64]| Spread::of(values.iter().copied());
        assert_eq!(spread(&[]), None);
        assert_eq!(spread(&[3.0, 1.0, 2.0]), Some(Spread { median: 2.0, least: 1.0, most: 3.0 }));
        assert_eq!(spread(&[4.0, 1.0]), Some(Spread { median: 2.5, least: 1.0, most: 4.0 }));
    }
}
