//! Layers of settings, each over the one before, resolved into one checked [`Settings`].

use crate::experiment::{self, merge};
use crate::known::{check_keys, keep_known};
use crate::{PRESETS, Settings, SettingsError, preset};
use serde::Deserialize;
use toml::de::DeTable;
use toml::{Table, Value};

/// Settings as they are put together.
pub struct Layers {
    /// The defaults as they stand in a file: what keys there are, and of what type.
    known: Table,
    /// What was given so far.
    given: Table,
}

impl Default for Layers {
    fn default() -> Self {
        Self::new()
    }
}

impl Layers {
    /// No layer over the defaults yet.
    pub fn new() -> Self {
        let mut known = Settings::default();
        // What has no default is left out of a TOML file; it is known all the same.
        known.simulation.readout_s = Some(0.0);
        // These are plain tables, numbers and words: they always serialise (tested).
        let known = Table::try_from(known).unwrap_or_default();
        Self { known: experiment::to_file(known), given: Table::new() }
    }

    /// Every key that there is, with its default.
    #[cfg(test)]
    pub(crate) fn known(&self) -> &Table {
        &self.known
    }

    /// Adds a preset by name, else a file.
    ///
    /// # Errors
    /// When there is neither, or its text is refused.
    pub fn add_base(&mut self, name_or_path: &str) -> Result<(), SettingsError> {
        if let Some(text) = preset(name_or_path) {
            return self.add_text(text, &format!("preset {name_or_path}"));
        }
        let text = std::fs::read_to_string(name_or_path).map_err(|error| SettingsError::Read {
            path: name_or_path.to_owned(),
            reason: error.to_string(),
            presets: PRESETS.map(|(name, _)| name).join(", "),
        })?;
        self.add_text(&text, name_or_path)
    }

    /// Adds a TOML text; `origin` names it in messages.
    ///
    /// # Errors
    /// Syntax, an unknown key or a value of the wrong type, each with its line.
    pub fn add_text(&mut self, text: &str, origin: &str) -> Result<(), SettingsError> {
        self.add(text, &|offset| {
            let line = text.bytes().take(offset).filter(|&byte| byte == b'\n').count().saturating_add(1);
            format!("{origin}, line {line}")
        })
    }

    /// As [`Self::add_text`], of settings that an earlier version wrote down: without keys that there are no more.
    ///
    /// # Errors
    /// As [`Self::add_text`].
    pub(crate) fn add_recorded(&mut self, text: &str, origin: &str) -> Result<(), SettingsError> {
        let syntax = |reason: String| SettingsError::Syntax { origin: origin.to_owned(), reason };
        let mut table: Table =
            toml::from_str(text).map_err(|error| syntax(error.message().replace('\n', ", ")))?;
        keep_known(&self.known, &mut table);
        let text = toml::to_string(&table).map_err(|error| syntax(error.to_string()))?;
        self.add_text(&text, origin)
    }

    /// Adds `key.path=value`; a value that is not TOML is taken as text.
    ///
    /// # Errors
    /// As [`Self::add_text`], naming the argument.
    pub fn add_override(&mut self, pair: &str) -> Result<(), SettingsError> {
        let Some((key, value)) = pair.split_once('=') else {
            return Err(SettingsError::NotAPair { argument: pair.to_owned() });
        };
        let (key, value) = (key.trim(), value.trim());
        let is_path = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c));
        if !is_path {
            return Err(SettingsError::NotAPair { argument: pair.to_owned() });
        }
        let parsed = toml::from_str::<Table>(&format!("value = {value}"));
        let literal = match parsed {
            Ok(table) if table.len() == 1 => value.to_owned(),
            _ => Value::String(value.to_owned()).to_string(),
        };
        self.add(&format!("{key} = {literal}"), &|_| format!("--set {pair}"))
    }

    /// Puts all layers together and checks every value.
    ///
    /// # Errors
    /// A word or a value that cannot be.
    pub fn resolve(self) -> Result<Settings, SettingsError> {
        let given = Value::Table(experiment::to_structs(self.given));
        let mut settings = Settings::deserialize(given).map_err(|error| SettingsError::Word {
            reason: experiment::renamed_in(&error.to_string().trim().replace('\n', " ")),
        })?;
        settings.check()?;
        settings.set_isa(settings.run.isa);
        Ok(settings)
    }

    fn add(&mut self, text: &str, origin: &dyn Fn(usize) -> String) -> Result<(), SettingsError> {
        let syntax = |error: toml::de::Error| SettingsError::Syntax {
            origin: origin(error.span().map_or(0, |span| span.start)),
            reason: error.message().replace('\n', ", "),
        };
        let parsed = DeTable::parse(text).map_err(syntax)?;
        check_keys(&self.known, parsed.get_ref(), "", &self.known, origin)?;
        let table: Table = toml::from_str(text).map_err(syntax)?;
        merge(&mut self.given, table);
        Ok(())
    }
}
