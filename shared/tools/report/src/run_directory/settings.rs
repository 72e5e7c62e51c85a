//! Every setting of a run beside its default.

use crate::Setting;
use tessera_settings::Settings;

/// All settings in the order of `config.toml`.
pub(super) fn of(settings: &Settings) -> Vec<Setting> {
    let defaults = flat(&Settings::default());
    let default = |key: &str| defaults.iter().find(|(own, _)| own == key).map(|(_, value)| value.clone());
    flat(settings).into_iter().map(|(key, value)| Setting { default: default(&key), key, value }).collect()
}

fn flat(settings: &Settings) -> Vec<(String, String)> {
    let mut all = Vec::new();
    if let Ok(table) = toml::Table::try_from(settings) {
        add(&mut all, "", &table);
    }
    all
}

fn add(all: &mut Vec<(String, String)>, prefix: &str, table: &toml::Table) {
    for (name, value) in table {
        let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            toml::Value::Table(inner) => add(all, &key, inner),
            value => all.push((key, value.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_was_changed_differs_from_its_default() {
        let settings = Settings::load(None, &["surface.step=2".to_owned()]).unwrap();
        let all = of(&settings);
        let changed: Vec<_> = all.iter().filter(|s| s.default.as_ref() != Some(&s.value)).collect();
        assert_eq!(changed.len(), 1);
        assert_eq!((changed[0].key.as_str(), changed[0].value.as_str()), ("surface.step", "2"));
        assert!(all.len() > 50);
    }
}
