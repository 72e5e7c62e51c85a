//! The tables as Markdown.

use super::table::{Spread, Tables, Whole};
use std::collections::BTreeMap;
use std::fmt::Write;

/// The tables with what they mean above each.
pub fn markdown(tables: &Tables) -> String {
    let mut text = String::new();
    initial_alignments(tables, &mut text);
    text.push('\n');
    whole_system(tables, &mut text);
    text.push('\n');
    parts(tables, &mut text);
    text
}

fn initial_alignments(tables: &Tables, text: &mut String) {
    let Tables { columns_base, seeds, .. } = tables;
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    line(format!(
        "RPE RMSE in m/s of the initial alignments, without global optimisation (preset {columns_base})."
    ));
    line("n: every n-th pixel, pairwise, no filter; k: rings of the filter, pairwise, n = 4; w: frames in the window, n = 4, k = 4.".into());
    line("Improvement over pairwise n = 4 without filter, the mean over the sequences.".into());
    line(seed_words(*seeds));
    line(String::new());
    let heads = tables.columns.iter().map(|c| c.name.clone());
    line(row("sequence".into(), heads));
    line(format!("|-|{}", "-|".repeat(tables.columns.len())));
    for r in &tables.rows {
        line(row(
            r.sequence.clone(),
            r.cells
                .iter()
                .map(|cell| number(&cell.rpe_m_per_s, *seeds) + &few(cell.frames_untracked, "lost")),
        ));
    }
    let improvements = tables.average_improvement_percent.iter().map(|p| format!("{p:+.1} %"));
    line(row("average improvement".into(), improvements));
}

fn whole_system(tables: &Tables, text: &mut String) {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "ATE RMSE in m of the whole system (preset {}) and of others.", tables.whole_base);
    let _ = writeln!(text, "{}\n", seed_words(tables.seeds));
    let mut systems: Vec<(&str, &str)> = Vec::new();
    let mut known: BTreeMap<(&str, usize), f64> = BTreeMap::new();
    for (place, r) in tables.rows.iter().enumerate() {
        for peer in &r.peers {
            if !systems.iter().any(|(name, _)| *name == peer.system) {
                systems.push((&peer.system, &peer.source));
            }
            known.insert((&peer.system, place), peer.ate_m);
        }
    }
    let names = tables.rows.iter().map(|r| r.sequence.clone());
    let _ = writeln!(text, "{}", row("system".into(), names.chain(["source".to_owned()])));
    let _ = writeln!(text, "|-|{}-|", "-|".repeat(tables.rows.len()));
    let own = tables.rows.iter().map(|r| &r.whole);
    let own = own.map(|whole| number(&whole.ate_m, tables.seeds) + &few(whole.frames_untracked, "lost"));
    let _ = writeln!(text, "{}", row("Tessera".into(), own.chain(["this run".to_owned()])));
    for (name, source) in systems {
        let values = (0..tables.rows.len())
            .map(|place| known.get(&(name, place)).map_or("–".to_owned(), |ate_m| format!("{ate_m:.4}")));
        let _ = writeln!(text, "{}", row(name.to_owned(), values.chain([source.to_owned()])));
    }
}

fn parts(tables: &Tables, text: &mut String) {
    let Tables { whole_base, seeds, .. } = tables;
    let _ =
        writeln!(text, "ATE RMSE in m / RPE RMSE online in m/s of the whole system (preset {whole_base})");
    let _ = writeln!(text, "without each of its parts.");
    let _ = writeln!(text, "{}\n", seed_words(*seeds));
    let names = tables.rows.iter().map(|r| r.sequence.clone());
    let _ = writeln!(text, "{}", row("without".into(), names));
    let _ = writeln!(text, "|-|{}", "-|".repeat(tables.rows.len()));
    let both = |w: &Whole| {
        let lost = few(w.frames_untracked, "not tracked");
        format!("{} / {}{lost}", number(&w.ate_m, *seeds), number(&w.rpe_online_m_per_s, *seeds))
    };
    let whole = tables.rows.iter().map(|r| both(&r.whole));
    let _ = writeln!(text, "{}", row("nothing".into(), whole));
    for (place, part) in tables.parts.iter().enumerate() {
        let cells = tables.rows.iter().map(|r| r.without.get(place).map_or("–".to_owned(), both));
        let _ = writeln!(text, "{}", row(part.without.to_owned(), cells));
    }
}

fn row(first: String, cells: impl Iterator<Item = String>) -> String {
    let cells: Vec<String> = std::iter::once(first).chain(cells).collect();
    format!("| {} |", cells.join(" | "))
}

/// Frames that something befell, behind a number; nothing where there are none.
fn few(n: usize, what: &str) -> String {
    if n > 0 { format!(", {n} {what}") } else { String::new() }
}

fn number(spread: &Spread, seeds: u64) -> String {
    match seeds {
        1 => format!("{:.4}", spread.median),
        _ => format!("{:.4} ({:.4} to {:.4})", spread.median, spread.least, spread.most),
    }
}

fn seed_words(seeds: u64) -> String {
    match seeds {
        1 => "One sampling seed.".to_owned(),
        n => format!("Median (least to most) over {n} sampling seeds."),
    }
}

#[cfg(test)]
mod tests {
    use super::super::table::tests::tables;
    use super::*;

    #[test]
    fn a_row_for_each_sequence_and_the_improvement_last() {
        let mut errors = [0.04; 11];
        errors[10] = 0.03;
        let text = markdown(&tables(&[("fr1_rpy_400", errors), ("room", [0.01; 11])]));
        let (first, rest) = text.split_once("\nATE").unwrap();
        let (second, third) = rest.split_once("\nATE").unwrap();
        let rows: Vec<&str> = first.lines().filter(|l| l.starts_with('|')).collect();
        assert!(rows[0].starts_with("| sequence | n = 1 | n = 2 | n = 4 | k = 1 |"), "{text}");
        assert!(rows[2].starts_with("| fr1_rpy_400 | 0.0400 |") && rows[2].ends_with("| 0.0300 |"), "{text}");
        assert!(rows[4].starts_with("| average improvement |") && rows[4].ends_with("| +12.5 % |"), "{text}");
        assert_eq!(rows.len(), 5);
        // Every row has as many cells as the head.
        for table in [first, second, third] {
            let counts: Vec<usize> =
                table.lines().filter(|l| l.starts_with('|')).map(|l| l.matches('|').count()).collect();
            assert!(counts.windows(2).all(|pair| pair[0] == pair[1]), "{counts:?}\n{table}");
        }
        assert!(second.contains("| Tessera | 0.0171 | 0.0171 | this run |"), "{second}");
        assert!(second.contains("| ORB-SLAM2 (f2e6f51) | 0.0230 | – | measured"), "{second}");
        assert!(third.contains("| nothing | 0.0171 / 0.0280 |"), "{third}");
        assert!(third.contains("| features | 0.0300 / 0.0400, 7 not tracked |"), "{third}");
        assert!(!second.contains("KinFu"), "a system without a value has no row: {second}");
    }
}
