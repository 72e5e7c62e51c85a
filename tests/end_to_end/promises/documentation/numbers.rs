//! The numbers of the pages: those of accuracy and speed are the tables', and the README's sample is what comes.

use std::path::{Path, PathBuf};
use std::process::Command;

const MARK: &str = "<!-- median of ";
/// Lines of the sample that no machine changes.
const OF_THE_RUN: [&str; 5] = ["  frames ", "  map ", "  final ", "  online ", "  verdict "];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Median, least and most of each figure of each sequence: `accuracy` or `speed`.
fn table(name: &str) -> toml::Table {
    read(&root().join(format!("tests/data/{name}.toml"))).parse().unwrap()
}

fn figures(table: &toml::Table, sequence: &str, key: &str) -> Option<[f64; 3]> {
    let row = table.get(sequence)?.get(key)?.as_array()?;
    let number = |value: &toml::Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    Some(std::array::from_fn(|at| number(&row[at]).unwrap()))
}

/// As the scripts write it: the median, and the spread where there is one.
fn cell(table: &toml::Table, sequence: &str, key: &str, decimals: usize) -> String {
    let Some(figures) = figures(table, sequence, key) else { return "-".to_owned() };
    let [median, least, most] = figures.map(|value| format!("{value:.decimals$}"));
    if least == most { median } else { format!("{median} ({least} to {most})") }
}

#[test]
fn medians_of_the_pages_are_those_of_the_tables() {
    let tables = ["accuracy", "speed"].map(table);
    let mut n_medians = 0;
    let pages = std::fs::read_dir(root().join("docs")).unwrap().flatten().map(|item| item.path());
    for page in pages.filter(|page| page.extension().is_some_and(|end| end == "md")) {
        for piece in read(&page).split(MARK).skip(1) {
            let (name, rest) = piece.split_once(" -->").unwrap();
            let (sequence, key) = name.split_once(": ").unwrap();
            let number: String = rest.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
            let decimals = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            let found = tables.iter().find_map(|table| figures(table, sequence, key));
            let [median, ..] = found.unwrap_or_else(|| panic!("{}: no {name} in a table", page.display()));
            let expected = format!("{median:.decimals$}");
            let mend = "scripts/accuracy.py --pages; scripts/speed.py --pages";
            assert_eq!(number, expected, "{}: {name}; {mend}", page.display());
            n_medians += 1;
        }
    }
    assert!(n_medians >= 17, "{n_medians}");
}

/// The first columns of each row, with their decimals.
fn has_the_rows_of(name: &str, page: &str, columns: [(&str, usize); 2]) {
    let (table, text) = (table(name), read(&root().join("docs").join(page)));
    for sequence in table.iter().filter(|(_, row)| row.is_table()).map(|(sequence, _)| sequence) {
        let cells = columns.map(|(key, decimals)| cell(&table, sequence, key, decimals));
        let row = format!("| {sequence} | {} |", cells.join(" | "));
        assert!(text.contains(&row), "docs/{page} has no row {row}; scripts/{name}.py --pages");
    }
}

#[test]
fn the_tables_of_the_pages_are_those_of_the_baselines() {
    has_the_rows_of("accuracy", "accuracy.md", [("ate_final_m", 4), ("ate_online_m", 4)]);
    has_the_rows_of("speed", "performance.md", [("reconstruct_cpu_ms", 2), ("align_cpu_ms", 2)]);
}

#[test]
fn the_sample_of_the_readme_is_what_the_command_prints() {
    let out = tempfile::tempdir().unwrap();
    let mut run = Command::new(env!("CARGO_BIN_EXE_tessera"));
    run.args(["run", "room", "--name", &format!("readme-{}", std::process::id()), "--out"])
        .arg(out.path().join("room"));
    let output = run.output().unwrap();
    let printed =
        format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let readme = read(&root().join("README.md"));
    let (_, sample) = readme.split_once("\nroom: done\n").expect("the sample");
    let (sample, _) = sample.split_once("```").unwrap();
    let is_of_the_run = |line: &&str| OF_THE_RUN.iter().any(|name| line.starts_with(name));
    let lines: Vec<&str> = sample.lines().filter(is_of_the_run).collect();
    assert_eq!(lines.len(), OF_THE_RUN.len(), "{sample}");
    for line in lines {
        assert!(printed.lines().any(|found| found == line), "README.md has\n{line}\nand came\n{printed}");
    }
}

/// How far down a page for users its first command, picture or table may be: two screens.
const MOST_LINES: usize = 50;
const MOST_WORDS: usize = 500;

#[test]
fn a_page_for_users_has_a_command_a_picture_or_a_table_within_two_screens() {
    let summary = read(&root().join("docs/SUMMARY.md"));
    let (_, using) = summary.split_once("# Using it").unwrap();
    let (using, _) = using.split_once("\n# ").unwrap();
    let pages: Vec<&str> = using.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert!(pages.len() > 12, "{pages:?}");
    for page in pages.into_iter().chain(["introduction.md", "concepts.md"]) {
        let text = read(&root().join("docs").join(page));
        let is_shown = |line: &str| ["```", "![", "| "].iter().any(|begin| line.trim().starts_with(begin));
        let before: Vec<&str> = text.lines().take_while(|line| !is_shown(line)).collect();
        let n_words: usize = before.iter().map(|line| line.split_whitespace().count()).sum();
        let is_there = before.len() < text.lines().count();
        assert!(
            is_there && before.len() <= MOST_LINES && n_words <= MOST_WORDS,
            "docs/{page}: {} lines and {n_words} words before its first command, picture or table",
            before.len()
        );
    }
}
