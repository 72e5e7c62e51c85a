//! The prose of the pages: short sentences, and no words that carry nothing.

use crate::{files, root};
use std::fs;
use std::path::PathBuf;

/// The most words of a sentence.
const MOST_WORDS: usize = 40;

/// Words that carry nothing, and those that make a person of a program: what it prints, reports or has in a file has
/// a verb of its own. Quoted messages and commands are code and not looked at.
const EMPTY_WORDS: [&str; 28] = [
    "actually",
    "and so on",
    "anybody",
    "as it were",
    "basically",
    "in order to",
    "in the place of",
    "it stands",
    "just",
    "no camera",
    "nobody",
    "note that",
    "of course",
    "please",
    "quite",
    "really",
    "said",
    "say",
    "says",
    "simply",
    "somebody",
    "stands where",
    "the like",
    "very",
    "what is of",
    "what stands",
    "whoever",
    "worth noting",
];

/// Pages that one must be able to read at a sitting, with the most words of each.
const MOST_OF_PAGE: [(&str, usize); 2] = [("docs/method.md", 9000), ("docs/fleet.md", 2000)];

/// The manual and the pages at its side; the laboratory's notes are none of them.
fn prose_pages() -> Vec<PathBuf> {
    let items = fs::read_dir(root().join("docs")).unwrap().map(|item| item.unwrap().path());
    let mut pages: Vec<PathBuf> = items.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    pages.extend(["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].map(|name| root().join(name)));
    pages.sort();
    pages
}

/// A line without its code spans and without the targets of its links.
fn plain(line: &str) -> String {
    let mut rest = line;
    let mut kept = String::new();
    while let Some(at) = rest.find('`') {
        let (before, from) = rest.split_at(at);
        let fence = &from[..from.len() - from.trim_start_matches('`').len()];
        kept.push_str(before);
        match from[fence.len()..].split_once(fence) {
            Some((_, after)) => {
                kept.push_str("code");
                rest = after;
            }
            None => rest = &from[fence.len()..],
        }
    }
    kept.push_str(rest);
    let mut pieces = kept.split("](");
    let first = pieces.next().unwrap_or_default().to_owned();
    pieces.fold(first, |text, piece| text + piece.split_once(')').map_or(piece, |(_, after)| after))
}

/// The lines of a page that are no code, with their numbers from 1 on.
fn prose_lines(page: &str) -> Vec<(usize, String)> {
    let (mut lines, mut is_code) = (Vec::new(), false);
    for (number, line) in (1..).zip(page.lines()) {
        if line.starts_with("```") {
            is_code = !is_code;
        } else if !is_code && !line.starts_with("    ") {
            lines.push((number, plain(line)));
        }
    }
    lines
}

/// A line without the marker of a list's item, and whether it had one.
fn item(line: &str) -> (&str, bool) {
    let line = line.trim();
    let after_number = line.trim_start_matches(|c: char| c.is_ascii_digit());
    let is_numbered = after_number.len() < line.len();
    let text = match is_numbered {
        true => after_number.strip_prefix(". "),
        false => line.strip_prefix("- ").or_else(|| line.strip_prefix("* ")),
    };
    (text.unwrap_or(line), text.is_some())
}

fn ends_a_sentence(word: &str) -> bool {
    word.trim_end_matches([')', '"', '*']).ends_with(['.', '!', '?'])
}

/// Lines with the sentences that begin on them and are too long. Headings, tables and pictures are left out; a line
/// that ends within a sentence goes on in the next one.
fn long_sentences(page: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut open: Option<(usize, Vec<String>)> = None;
    let mut end = |sentence: Option<(usize, Vec<String>)>| {
        found.extend(sentence.filter(|(_, words)| words.len() > MOST_WORDS).map(|(n, w)| (n, w.join(" "))));
    };
    for (number, line) in prose_lines(page) {
        let (text, is_item) = item(&line);
        let is_prose = !text.is_empty() && !text.starts_with(['|', '#', '<', '!']);
        if is_item || !is_prose {
            end(open.take());
        }
        if !is_prose {
            continue;
        }
        for word in text.split_whitespace() {
            if word.contains(char::is_alphanumeric) {
                open.get_or_insert((number, Vec::new())).1.push(word.to_owned());
            }
            if ends_a_sentence(word) {
                end(open.take());
            }
        }
        if text.ends_with([':', ';']) {
            end(open.take());
        }
    }
    end(open);
    found
}

/// Lines with the words in them that carry nothing.
fn empty_words(page: &str) -> Vec<(usize, &'static str)> {
    let mut found = Vec::new();
    for (number, line) in prose_lines(page) {
        let lower = line.to_lowercase();
        let words: Vec<&str> = lower
            .split(|c: char| !c.is_alphanumeric() && !['\'', '-', '_'].contains(&c))
            .filter(|word| !word.is_empty())
            .collect();
        let text = format!(" {} ", words.join(" "));
        let here = EMPTY_WORDS.into_iter().filter(|phrase| text.contains(&format!(" {phrase} ")));
        found.extend(here.map(|phrase| (number, phrase)));
    }
    found
}

#[test]
fn long_sentences_and_empty_words_are_found() {
    let long = vec!["word"; MOST_WORDS].join(" ");
    assert_eq!(long_sentences(&format!("{long}.")), []);
    for page in [
        format!("# Title\n\nShort. {long} more.\n"),
        format!("# Title\n\n- {long}\n  more.\n"),
        format!("1. Short.\n2. {long}\nmore `code that is long`"),
    ] {
        let found = long_sentences(&page);
        assert!(found.len() == 1 && found[0].1.contains("word"), "{page}: {found:?}");
    }
    for page in [format!("| {long} | more |"), format!("```\n{long} more\n```"), format!("- {long}:\n- more")]
    {
        assert_eq!(long_sentences(&page), [], "{page}");
    }
    assert_eq!(
        empty_words("It saying.\n`says` ``say `x` said``\nNobody, in the\nIt Says so."),
        [(3, "nobody"), (4, "says")]
    );
    assert_eq!(plain("a [b](c.md#d) `e` f"), "a [b code f");
}

#[test]
fn pages_have_short_sentences_and_no_empty_words() {
    let pages = prose_pages();
    assert!(pages.len() > 20, "{pages:?}");
    let mut faults = Vec::new();
    for path in pages {
        let page = fs::read_to_string(&path).unwrap();
        let name = path.strip_prefix(root()).unwrap().display();
        for (line, sentence) in long_sentences(&page) {
            faults.push(format!("{name}:{line}: a sentence of more than {MOST_WORDS} words: {sentence}"));
        }
        for (line, phrase) in empty_words(&page) {
            faults.push(format!("{name}:{line}: `{phrase}` carries nothing: name what is done"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn long_pages_stay_within_their_limits() {
    for (name, most) in MOST_OF_PAGE {
        let n_words = fs::read_to_string(root().join(name)).unwrap().split_whitespace().count();
        assert!(n_words <= most, "{name}: {n_words} words, expected at most {most}");
    }
}

/// Comments of the method, those of the SLAM crate apart for now.
#[test]
fn comments_of_the_method_have_no_empty_words() {
    let mut faults = Vec::new();
    for (path, text) in files("shared/method") {
        if path.starts_with("shared/method/slam") {
            continue;
        }
        for (number, line) in (1..).zip(text.lines()) {
            let comment = line.trim_start();
            let is_comment = comment.starts_with("//");
            let words = if is_comment { empty_words(comment) } else { Vec::new() };
            faults.extend(words.iter().map(|(_, phrase)| format!("{}:{number}: `{phrase}`", path.display())));
        }
    }
    assert!(faults.is_empty(), "words that carry nothing: {}", faults.join("\n"));
}
