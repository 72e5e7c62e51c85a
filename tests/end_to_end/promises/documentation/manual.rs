//! The manual: every page is listed, every link leads somewhere, every command line parses, and
//! every setting and file that is named exists.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All pages of the manual.
fn pages() -> Vec<PathBuf> {
    let items = std::fs::read_dir(root().join("docs")).unwrap().flatten().map(|item| item.path());
    let mut pages: Vec<PathBuf> = items.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    pages.sort();
    assert!(pages.len() > 10, "{pages:?}");
    pages
}

/// The manual and the pages at its side.
fn texts() -> Vec<PathBuf> {
    let beside = ["README.md", "ARCHITECTURE.md", "lab/notes.md", "scripts/systemd/README.md"]
        .map(|name| root().join(name));
    pages().into_iter().chain(beside).collect()
}

/// The lines of a text that are no code, and those that are.
fn split(text: &str) -> (Vec<&str>, Vec<&str>) {
    let (mut prose, mut code, mut is_code) = (Vec::new(), Vec::new(), false);
    for line in text.lines() {
        if line.starts_with("```") {
            is_code = !is_code;
        } else if is_code {
            code.push(line);
        } else {
            prose.push(line);
        }
    }
    assert!(!is_code, "a block of code without an end");
    (prose, code)
}

/// Targets of the links and pictures in a line, code taken out.
fn links(line: &str) -> Vec<&str> {
    line.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect()
}

/// What stands between backticks in a line.
fn words_in_code(line: &str) -> Vec<&str> {
    line.split('`').skip(1).step_by(2).collect()
}

/// The anchors of a page, as GitHub and mdBook make them of its headings.
fn anchors(text: &str) -> BTreeSet<String> {
    let heading = |line: &&&str| line.starts_with('#');
    let anchor = |line: &&str| {
        let title = line.trim_start_matches('#').trim().to_lowercase();
        let keep = |c: char| match c {
            ' ' => Some('-'),
            c if c.is_alphanumeric() || "-_".contains(c) => Some(c),
            _ => None,
        };
        title.chars().filter_map(keep).collect::<String>()
    };
    split(text).0.iter().filter(heading).map(anchor).collect()
}

#[test]
fn every_page_is_in_the_summary_once() {
    let summary = root().join("docs/SUMMARY.md");
    let text = read(&summary);
    let listed: Vec<&str> = text.lines().flat_map(links).collect();
    for page in pages().iter().filter(|page| **page != summary) {
        let name = page.file_name().unwrap().to_str().unwrap();
        let n = listed.iter().filter(|link| **link == name).count();
        assert_eq!(n, 1, "{name} stands {n} times in SUMMARY.md");
    }
}

#[test]
fn every_link_leads_somewhere() {
    let mut n_links = 0;
    for page in texts() {
        for link in split(&read(&page)).0.into_iter().flat_map(links) {
            if link.starts_with("http") {
                continue;
            }
            n_links += 1;
            let (file, anchor) = link.split_once('#').map_or((link, None), |(file, a)| (file, Some(a)));
            let target = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(target.exists(), "{}: {link} leads nowhere", page.display());
            // The rendered book has the files of this folder alone: others are named in code.
            let is_in_book = !page.starts_with(root().join("docs")) || !file.contains("..");
            assert!(is_in_book, "{}: {link} leads out of the book", page.display());
            if let Some(anchor) = anchor {
                let there = anchors(&read(&target));
                assert!(there.contains(anchor), "{}: no {link} among {there:?}", page.display());
            }
        }
    }
    assert!(n_links > 50, "{n_links}");
}

#[test]
fn every_command_line_parses() {
    let mut n_commands = 0;
    for page in texts() {
        let text = read(&page);
        let (prose, code) = split(&text);
        let in_prose = prose.iter().flat_map(|line| words_in_code(line)).map(str::to_owned);
        for line in joined(&code).into_iter().chain(in_prose) {
            let Some(words) = command(&line) else { continue };
            n_commands += 1;
            // Help is only printed when everything before it was understood.
            let output =
                Command::new(env!("CARGO_BIN_EXE_tessera")).args(&words).arg("--help").output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{}: `{line}`: {said}", page.display());
        }
    }
    assert!(n_commands > 60, "{n_commands}");
}

/// Lines as a shell reads them: one that ends in a backslash goes on in the next.
fn joined(lines: &[&str]) -> Vec<String> {
    let mut whole: Vec<String> = Vec::new();
    let mut goes_on = false;
    for line in lines {
        let (text, is_cut) = match line.trim_end().strip_suffix('\\') {
            Some(text) => (text.trim_end(), true),
            None => (*line, false),
        };
        match whole.last_mut().filter(|_| goes_on) {
            Some(last) => *last = format!("{last} {}", text.trim_start()),
            None => whole.push(text.to_owned()),
        }
        goes_on = is_cut;
    }
    whole
}

#[test]
fn a_line_that_goes_on_is_one_command() {
    let lines = ["tessera ros2 desk --run \\", "    --network all \\", "    --depth /d", "tessera status"];
    assert_eq!(joined(&lines), ["tessera ros2 desk --run --network all --depth /d", "tessera status"]);
}

/// The words behind `tessera`, as a shell would give them; `None`: no such command line.
fn command(line: &str) -> Option<Vec<String>> {
    let line = line.trim().split(" #").next()?.split(" > ").next()?;
    let rest = line.strip_prefix("tessera ")?;
    if rest.starts_with(char::is_uppercase) || rest.starts_with('…') {
        return None;
    }
    let mut words = vec![String::new()];
    let mut quote = None;
    for c in rest.trim().chars() {
        match (c, quote) {
            (c, Some(q)) if c == q => quote = None,
            ('"' | '\'', None) => quote = Some(c),
            (' ', None) => words.push(String::new()),
            ('[' | ']', None) => {}
            (c, _) => words.last_mut().unwrap().push(c),
        }
    }
    // Placeholders of numbers.
    Some(words.into_iter().map(|word| if word == "N" { "3".to_owned() } else { word }).collect())
}

/// All settings and tables by their full names.
fn settings() -> BTreeSet<String> {
    fn add(names: &mut BTreeSet<String>, prefix: &str, table: &toml::Table) {
        for (key, value) in table {
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            if let toml::Value::Table(table) = value {
                add(names, &name, table);
            }
            names.insert(name);
        }
    }
    let mut names = BTreeSet::new();
    add(&mut names, "", &read(&root().join("config/default.toml")).parse().unwrap());
    names
}

#[test]
fn every_setting_that_is_named_exists() {
    let settings = settings();
    let mut n_settings = 0;
    for page in texts().iter().filter(|page| !page.ends_with("messages.md")) {
        let text = read(page);
        let words = split(&text).0.into_iter().flat_map(words_in_code).flat_map(str::split_whitespace);
        for word in words {
            let name = word.split('=').next().unwrap();
            let parts: Vec<&str> = name.split('.').collect();
            let is_name = parts.iter().all(|part| part.chars().all(|c| c.is_ascii_lowercase() || c == '_'));
            let is_file = ["toml", "json", "txt", "rs", "csv", "md", "journal", "store", "clock", "html"]
                .contains(parts.last().unwrap());
            if parts.len() > 1 && is_name && !is_file && settings.contains(parts[0]) {
                n_settings += 1;
                assert!(settings.contains(name), "{}: there is no setting {name}", page.display());
            }
        }
    }
    assert!(n_settings > 30, "{n_settings}");
}

#[test]
fn every_file_of_the_project_that_is_named_exists() {
    const FOLDERS: [&str; 8] =
        ["shared/", "processes/", "tests/", "scripts/", "config/", "docs/", "benches/", "examples/"];
    let mut n_files = 0;
    for page in texts() {
        let text = read(&page);
        for word in split(&text).0.into_iter().flat_map(words_in_code).flat_map(str::split_whitespace) {
            let word = word.trim_end_matches([',', ':', ';']);
            let is_path = FOLDERS.iter().any(|folder| word.starts_with(folder));
            if !is_path || word.contains(['*', '{', '…']) || word.starts_with("examples/") {
                continue;
            }
            n_files += 1;
            // A file, or a crate's name within its folder.
            assert!(root().join(word).exists(), "{}: there is no {word}", page.display());
        }
    }
    assert!(n_files > 40, "{n_files}");
}

#[test]
fn pictures_are_small_and_need_nothing() {
    let folder = root().join("docs/pictures");
    for item in std::fs::read_dir(folder).unwrap().flatten() {
        let path = item.path();
        let text = read(&path);
        let name = path.display();
        assert!(text.len() < 20_000 && text.contains("<title>"), "{name}");
        let links = text.replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
        assert!(!links.contains("http") && !links.contains("href"), "{name} needs something else");
    }
}
