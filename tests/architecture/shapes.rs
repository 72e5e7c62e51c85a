//! The shapes of code: short functions of few arguments, files of one idea, and no large circles of files.

use crate::{all_crates, code, is_for_developers};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The most arguments that a function takes, and the most lines that it has.
const MOST_ARGUMENTS: usize = 7;
const MOST_LINES: usize = 70;
/// The most lines of a file, tests in it aside.
const MOST_LINES_OF_A_FILE: usize = 400;

/// Functions that may take more arguments: `point_row` is a kernel for vector instructions, in which
/// each output is an argument of its own, so that the compiler knows that none overlaps another.
const LARGE_FUNCTIONS: [&str; 1] = ["shared/method/surface/src/filter.rs: point_row"];

/// A function as it stands in the text.
#[derive(Debug, PartialEq)]
struct Function {
    name: String,
    n_arguments: usize,
    n_lines: usize,
}

/// All functions of a formatted file.
fn functions(text: &str) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    for (first, line) in lines.iter().enumerate() {
        let words = line.trim_start();
        let before = words.split("fn ").next().unwrap_or_default();
        let is_function = words.len() > before.len()
            && before
                .split_whitespace()
                .all(|w| ["pub", "pub(crate)", "pub(super)", "const", "unsafe"].contains(&w));
        if !is_function {
            continue;
        }
        let indent = &line[..line.len() - words.len()];
        let ends = |line: &str| ["{", "}", ";"].iter().any(|end| line.ends_with(end));
        let open = first + lines[first..].iter().position(|line| ends(line)).unwrap();
        let close = format!("{indent}}}");
        let last = match lines[open].ends_with('{') {
            true => open + lines[open..].iter().position(|line| **line == close).unwrap(),
            false => open,
        };
        let signature = lines[first..=open].join(" ");
        let after = &signature[signature.find("fn ").unwrap() + 3..];
        let name = after.split(['(', '<']).next().unwrap().to_owned();
        let n_arguments = n_arguments(&after[name.len()..]);
        found.push(Function { name, n_arguments, n_lines: last + 1 - first });
    }
    found
}

/// Arguments in a signature that begins after the function's name.
fn n_arguments(signature: &str) -> usize {
    let (mut depth, mut in_arguments, mut n, mut is_open, mut before) = (0, false, 0, false, ' ');
    for letter in signature.chars() {
        match letter {
            '(' | '[' | '{' | '<' => {
                in_arguments |= depth == 0 && letter == '(';
                is_open |= depth > 0;
                depth += 1;
            }
            ')' | ']' | '}' => depth -= 1,
            '>' if before != '-' => depth -= 1,
            ',' if in_arguments && depth == 1 => (n, is_open) = (n + 1, false),
            _ => is_open |= in_arguments && !letter.is_whitespace(),
        }
        if in_arguments && depth == 0 {
            break;
        }
        before = letter;
    }
    n + usize::from(in_arguments && is_open)
}

#[test]
fn functions_are_short_and_take_few_arguments() {
    let text = "impl X {\n    fn a<T: Fn(u8) -> u8>(&self, b: [T; 2], (c, d): (u8, u8)) -> u8 {\n        1\n    }\n}\nfn e();";
    let expected = [("a", 3, 3), ("e", 0, 1)].map(|(name, n_arguments, n_lines)| Function {
        name: name.to_owned(),
        n_arguments,
        n_lines,
    });
    assert_eq!(functions(text), expected);
    let mut large = Vec::new();
    for (path, text) in
        all_crates().iter().flat_map(|name| code(name)).filter(|(path, _)| !is_for_developers(path))
    {
        for function in functions(&text) {
            let name = format!("{}: {}", path.display(), function.name);
            if function.n_arguments > MOST_ARGUMENTS || function.n_lines > MOST_LINES {
                large.push((name, function));
            }
        }
    }
    large.retain(|(name, _)| !LARGE_FUNCTIONS.contains(&name.as_str()));
    assert!(large.is_empty(), "more than {MOST_ARGUMENTS} arguments or {MOST_LINES} lines: {large:#?}");
}

#[test]
fn files_are_short() {
    let files = all_crates().into_iter().flat_map(|name| code(&name));
    let large: Vec<String> = files
        .filter(|(_, text)| text.lines().count() > MOST_LINES_OF_A_FILE)
        .map(|(path, text)| format!("{}: {} lines", path.display(), text.lines().count()))
        .collect();
    assert!(large.is_empty(), "more than {MOST_LINES_OF_A_FILE} lines: {large:#?}");
}

/// The modules of a crate that each of its modules names by `crate::`.
fn modules(sources: &str) -> BTreeMap<String, BTreeSet<String>> {
    let module = |path: &Path| {
        let path = path.strip_prefix(sources).unwrap().with_extension("");
        let path = path.display().to_string();
        path.strip_suffix("/mod").map_or(path.clone(), str::to_owned)
    };
    let texts: BTreeMap<String, String> = code(sources)
        .into_iter()
        .map(|(path, text)| (module(&path), text))
        .filter(|(module, _)| !["lib", "main"].contains(&module.as_str()) && !module.contains("test"))
        .collect();
    let named = |from: &str, text: &str| {
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let paths = text.split("crate::").skip(1).map(|rest| {
            rest.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':').next().unwrap().to_owned()
        });
        let mut found = BTreeSet::new();
        for path in paths {
            let parts: Vec<&str> = path.split("::").filter(|part| !part.is_empty()).collect();
            let longest = (1..=parts.len()).rev().map(|n| parts[..n].join("/"));
            found.extend(longest.into_iter().find(|module| texts.contains_key(module) && module != from));
        }
        found
    };
    texts.iter().map(|(from, text)| (from.clone(), named(from, text))).collect()
}

/// All modules that can be reached from `from`.
fn reached(modules: &BTreeMap<String, BTreeSet<String>>, from: &str) -> BTreeSet<String> {
    let (mut found, mut next) = (BTreeSet::new(), vec![from.to_owned()]);
    while let Some(module) = next.pop() {
        for other in &modules[&module] {
            if found.insert(other.clone()) {
                next.push(other.clone());
            }
        }
    }
    found
}

#[test]
fn files_form_no_large_circles() {
    let (mut n_edges, mut circles) = (0, BTreeSet::new());
    for name in all_crates() {
        let modules = modules(&format!("{name}/src"));
        n_edges += modules.values().map(BTreeSet::len).sum::<usize>();
        let reached: BTreeMap<&String, BTreeSet<String>> =
            modules.keys().map(|module| (module, reached(&modules, module))).collect();
        for module in modules.keys() {
            let circle: Vec<&str> = reached[module]
                .iter()
                .filter(|other| reached[other].contains(module))
                .map(String::as_str)
                .collect();
            if circle.len() > 2 {
                circles.insert(format!("{name}: {circle:?}"));
            }
        }
    }
    assert!(n_edges > 100, "{n_edges} uses of other files were found");
    assert!(circles.is_empty(), "circles of more than two files: {circles:#?}");
}
