//! The keys there are, taken from the defaults themselves, and the nearest to a wrong one.

use crate::SettingsError;
use toml::de::DeValue;
use toml::{Table, Value};

/// The name of a value's type, for a message.
pub(crate) fn type_word(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "text in quotes",
        Value::Integer(_) => "a whole number",
        Value::Float(_) => "a number",
        Value::Boolean(_) => "true or false",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "a list",
        Value::Table(_) => "a table",
    }
}

/// Full paths of all leaves of `table`, in order.
pub(crate) fn leaves(table: &Table, prefix: &str, into: &mut Vec<String>) {
    for (key, value) in table {
        let path = join(prefix, key);
        match value {
            Value::Table(inner) => leaves(inner, &path, into),
            _ => into.push(path),
        }
    }
}

/// `prefix.key`, or `key` at the top.
pub(crate) fn join(prefix: &str, key: &str) -> String {
    if prefix.is_empty() { key.to_owned() } else { format!("{prefix}.{key}") }
}

/// The known key nearest to `key`, as a hint: by full path, or by its last part where only the
/// table is missing or wrong.
pub(crate) fn hint(known: &Table, key: &str) -> String {
    let mut paths = Vec::new();
    leaves(known, "", &mut paths);
    paths.extend(known.keys().cloned());
    let last = |path: &str| path.rsplit('.').next().unwrap_or(path).to_owned();
    let score = |path: &String| {
        let whole = strsim::jaro_winkler(key, path);
        let part = strsim::jaro_winkler(&last(key), &last(path));
        // A near miss inside the right table is likelier than the same word elsewhere.
        whole.max(0.95 * part)
    };
    let best =
        paths.iter().map(|path| (score(path), path)).fold(None::<(f64, &String)>, |best, next| match best {
            Some(best) if best.0 >= next.0 => Some(best),
            _ => Some(next),
        });
    match best {
        Some((score, path)) if score > 0.7 => format!("; the nearest known key is `{path}`"),
        _ => format!("; the tables are {}", known.keys().cloned().collect::<Vec<_>>().join(", ")),
    }
}

/// Checks keys and types of `given` against the known table; `line_of` names a place by byte offset.
pub(crate) fn check_keys(
    known: &Table,
    given: &toml::de::DeTable<'_>,
    prefix: &str,
    top: &Table,
    origin: &dyn Fn(usize) -> String,
) -> Result<(), SettingsError> {
    for (key, value) in given {
        let path = join(prefix, key.get_ref());
        let at = || origin(key.span().start);
        let Some(expected) = known.get(key.get_ref().as_ref()) else {
            return Err(SettingsError::UnknownKey { origin: at(), hint: hint(top, &path), key: path });
        };
        match (expected, value.get_ref()) {
            (Value::Table(known), DeValue::Table(given)) => check_keys(known, given, &path, top, origin)?,
            (Value::String(_), DeValue::String(_))
            | (Value::Boolean(_), DeValue::Boolean(_))
            | (Value::Integer(_), DeValue::Integer(_))
            | (Value::Float(_), DeValue::Float(_) | DeValue::Integer(_))
            | (Value::Array(_), DeValue::Array(_)) => {}
            (expected, found) => {
                return Err(SettingsError::Type {
                    origin: at(),
                    key: path,
                    found: describe(found),
                    expected: type_word(expected).to_owned(),
                });
            }
        }
    }
    Ok(())
}

/// Takes out of `given` what is no key.
pub(crate) fn keep_known(known: &Table, given: &mut Table) {
    given.retain(|key, _| known.contains_key(key));
    for (key, value) in given {
        if let (Some(Value::Table(known)), Value::Table(given)) = (known.get(key), value) {
            keep_known(known, given);
        }
    }
}

/// The value as words, for a message.
fn describe(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{text}\""),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}
