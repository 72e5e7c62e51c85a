//! `config/default.toml` with what each setting means, taken from the structs' own comments, so
//! that there is one text to keep.

use crate::experiment;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// A field of a settings struct: its comment, and its type.
struct Field {
    comment: Vec<String>,
    type_name: String,
}

/// What the settings crates declare.
#[derive(Default)]
struct Declared {
    /// Fields of each struct, by their names as they stand in TOML.
    structs: BTreeMap<String, BTreeMap<String, Field>>,
    /// Words of each enum without data, as they stand in TOML.
    enums: BTreeMap<String, Vec<String>>,
}

/// The crates that hold settings, below `shared/`.
const CRATES: [&str; 8] = [
    "method/numerics",
    "runtime/settings",
    "method/surface",
    "method/registration",
    "method/slam",
    "method/geometry",
    "data/sources",
    "data/simulation",
];

/// Reads all structs and enums in the crates that hold settings.
fn read_crates() -> Declared {
    let mut declared = Declared::default();
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for name in CRATES {
        let mut folders = vec![shared.join(name).join("src")];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if path.extension().is_some_and(|extension| extension == "rs") {
                    read_file(&std::fs::read_to_string(path).unwrap(), &mut declared);
                }
            }
        }
    }
    declared
}

fn read_file(text: &str, declared: &mut Declared) {
    let (mut inside, mut comment, mut renamed) = (None, Vec::new(), None);
    for line in text.lines().map(str::trim) {
        if let Some(rest) = line.strip_prefix("pub struct ").or_else(|| line.strip_prefix("pub enum ")) {
            inside = rest.strip_suffix(" {").map(str::to_owned);
        } else if line == "}" {
            inside = None;
        } else if let Some(words) = line.strip_prefix("///") {
            comment.push(plain(words.trim()));
            continue;
        } else if let Some(rest) = line.strip_prefix("#[serde(rename = \"") {
            renamed = rest.split('"').next().map(str::to_owned);
            continue;
        } else if line.starts_with("#[") {
            continue;
        } else if let (Some(of), Some(rest)) = (&inside, line.strip_prefix("pub ")) {
            if let Some((name, type_name)) = rest.trim_end_matches(',').split_once(": ") {
                let name = renamed.take().unwrap_or_else(|| name.to_owned());
                let field = Field { comment: std::mem::take(&mut comment), type_name: type_name.to_owned() };
                declared.structs.entry(of.clone()).or_default().insert(name, field);
            }
        } else if let (Some(of), Some(word)) = (&inside, line.strip_suffix(','))
            && word.chars().all(char::is_alphanumeric)
        {
            declared.enums.entry(of.clone()).or_default().push(snake_case(word));
        }
        (comment, renamed) = (Vec::new(), None);
    }
}

fn snake_case(word: &str) -> String {
    let mut text = String::new();
    for letter in word.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.extend(letter.to_lowercase());
    }
    text
}

/// A comment without its links: [`x`](y) and [`Type::x`] become `x`.
fn plain(words: &str) -> String {
    words.replace("[`", "`").replace("`]", "`").replace("StageSettings::", "").replace("Self::", "")
}

/// The text of all defaults with the comment of each field above it.
pub(super) fn with_comments(toml: &str) -> String {
    let Declared { structs, enums } = read_crates();
    let (mut table, mut text, mut is_experiment) = ("Settings".to_owned(), String::new(), false);
    for line in toml.lines() {
        let mut comment: &[String] = &[];
        let mut words = None;
        if let Some(path) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            table = "Settings".to_owned();
            let path = match path.strip_prefix("experiment.") {
                Some(rest) => {
                    if !std::mem::replace(&mut is_experiment, true) {
                        writeln!(text, "{}\n", experiment::COMMENT).unwrap();
                    }
                    rest
                }
                None => path,
            };
            for part in path.split('.') {
                let field = &structs[&table][part];
                (table, comment) = (field.type_name.clone(), &field.comment);
            }
        } else if let Some((key, _)) = line.split_once(" = ") {
            let field = &structs[&table][key];
            comment = &field.comment;
            words = enums.get(&field.type_name);
            assert!(!comment.is_empty(), "{table}.{key} has no comment");
        }
        for sentence in comment {
            writeln!(text, "{}", format!("# {sentence}").trim_end()).unwrap();
        }
        if let Some(words) = words {
            writeln!(text, "# One of: {}.", words.join(", ")).unwrap();
        }
        writeln!(text, "{line}").unwrap();
    }
    text
}
