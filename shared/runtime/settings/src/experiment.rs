//! The second group of settings: variants of the method, which stand below `[experiment]` in files and
//! in `--set`, and beside the others in the structs.

use toml::{Table, Value};

/// The table of the second group.
const GROUP: &str = "experiment";

/// What the group is for, above its first table in `config/default.toml`.
#[cfg(test)]
pub(crate) const COMMENT: &str = "# Variants of the method, for the preset `paper`, `tessera ablate` and tests: no run needs another value.";

/// Paths of the group's keys, as in the structs.
pub(crate) const KEYS: [&str; 6] = [
    "run.forget_every",
    "surface.variant",
    "registration.variant",
    "mapping.loop.request_interval",
    "mapping.loop.delay_frames",
    "mapping.variant",
];

/// The table of the structs as it stands in a file: the group's keys moved below `experiment`.
pub(crate) fn to_file(structs: Table) -> Table {
    let (mut file, mut group) = (structs, Table::new());
    for key in KEYS {
        let path: Vec<&str> = key.split('.').collect();
        if let Some(value) = take(&mut file, &path) {
            put(&mut group, &path, value);
        }
    }
    file.insert(GROUP.to_owned(), Value::Table(group));
    file
}

/// The table of a file as the structs have it: the inverse of [`to_file`].
pub(crate) fn to_structs(file: Table) -> Table {
    let mut structs = file;
    if let Some(Value::Table(group)) = structs.remove(GROUP) {
        merge(&mut structs, group);
    }
    structs
}

/// `part.key is …` with the key as it stands in a file.
pub(crate) fn renamed(part: &str, reason: &str) -> String {
    let message = format!("{part}.{reason}");
    let key = message.split_whitespace().next().unwrap_or_default();
    if KEYS.contains(&key) { format!("{GROUP}.{message}") } else { message }
}

/// A deserialiser's message with its key, in backquotes, as it stands in a file.
pub(crate) fn renamed_in(message: &str) -> String {
    KEYS.iter().fold(message.to_owned(), |text, key| {
        text.replace(&format!("in `{key}`"), &format!("in `{GROUP}.{key}`"))
    })
}

/// Puts `over` on top of `under`, table by table.
pub(crate) fn merge(under: &mut Table, over: Table) {
    for (key, value) in over {
        match (under.get_mut(&key), value) {
            (Some(Value::Table(under)), Value::Table(over)) => merge(under, over),
            (_, value) => {
                under.insert(key, value);
            }
        }
    }
}

/// Removes the value at `path`, and the tables that are empty without it.
fn take(table: &mut Table, path: &[&str]) -> Option<Value> {
    let (first, rest) = path.split_first()?;
    if rest.is_empty() {
        return table.remove(*first);
    }
    let Some(Value::Table(inner)) = table.get_mut(*first) else { return None };
    let value = take(inner, rest);
    if inner.is_empty() {
        table.remove(*first);
    }
    value
}

fn put(table: &mut Table, path: &[&str], value: Value) {
    match path {
        [] => {}
        [last] => {
            table.insert((*last).to_owned(), value);
        }
        [first, rest @ ..] => {
            let inner = table.entry(*first).or_insert_with(|| Value::Table(Table::new()));
            if let Value::Table(inner) = inner {
                put(inner, rest, value);
            }
        }
    }
}
