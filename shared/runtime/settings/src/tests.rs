//! Presets load, layers override, and each wrong setting gets its message.

mod documented;

use super::*;

/// The message that a text of settings is refused with.
fn refusal(text: &str) -> String {
    match Settings::from_toml(text, "my.toml") {
        Ok(_) => panic!("accepted: {text}"),
        Err(error) => error.to_string(),
    }
}

/// Every key that a file may hold.
fn known_keys() -> Vec<String> {
    let mut keys = Vec::new();
    crate::known::leaves(Layers::new().known(), "", &mut keys);
    keys
}

#[test]
fn every_file_in_config_loads() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../config");
    let mut n_files = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let path = path.to_str().unwrap();
            Settings::load(Some(path), &[]).unwrap_or_else(|error| panic!("{path}: {error}"));
            n_files += 1;
        }
    }
    assert_eq!(n_files, PRESETS.len(), "each file in config/ is a preset and the other way round");
}

/// `TESSERA_UPDATE=1 cargo test -p tessera-settings` writes the file anew after a default changed.
#[test]
fn default_toml_lists_every_default() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../config/default.toml");
    let header = "# Every setting with its default: those for users, then, below [experiment], variants of the method.\n\
                  # A file for --config holds what differs, for instance:\n# [surface]\n# step = 8\n\n";
    let defaults = Settings::default().to_toml().unwrap();
    let expected = format!("{header}{}", documented::with_comments(&defaults));
    if std::env::var_os("TESSERA_UPDATE").is_some() {
        std::fs::write(path, &expected).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), expected, "set TESSERA_UPDATE=1 to write it anew");
    assert_eq!(Settings::load(Some(path), &[]).unwrap(), Settings::default());
}

#[test]
fn defaults_hold_their_own_rules_and_survive_a_round_trip() {
    let settings = Settings::default();
    settings.check().unwrap();
    let text = settings.to_toml().unwrap();
    assert_eq!(Settings::from_toml(&text, "text").unwrap(), settings);
}

#[test]
fn each_layer_covers_the_one_before() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("mine.toml");
    std::fs::write(&path, "[output]\nmap_voxel_m = 0.05\nmap_max_depth_m = 3\n").unwrap();
    let overrides = ["output.map_voxel_m=0.02", "run.source=house", "run.live=true"].map(str::to_owned);
    let settings = Settings::load(path.to_str(), &overrides).unwrap();
    assert_eq!(settings.output, OutputSettings { map_voxel_m: 0.02, map_max_depth_m: 3.0, report: true });
    assert_eq!(settings.run.source, "house");
    assert!(settings.run.live);
}

#[test]
fn what_has_no_default_can_be_set() {
    let overrides = ["simulation.readout_s=0.03", "run.frames=7", "run.camera=icl"].map(str::to_owned);
    let settings = Settings::load(None, &overrides).unwrap();
    assert_eq!(settings.simulation.readout_s, Some(0.03));
    let (spec, options) = settings.source();
    assert_eq!(spec.to_string(), "room");
    assert_eq!((options.camera.as_deref(), options.frames), (Some("icl"), Some(7)));
    assert_eq!(options.simulation, settings.simulation);
}

#[test]
fn there_are_few_keys_in_two_groups() {
    let known = known_keys();
    assert!(known.len() <= 60, "{} keys", known.len());
    for key in crate::experiment::KEYS {
        let path = format!("experiment.{key}");
        assert!(known.contains(&path) && !known.iter().any(|k| k == key), "{key}");
    }
    let n_experiment = known.iter().filter(|key| key.starts_with("experiment.")).count();
    assert_eq!(n_experiment, crate::experiment::KEYS.len());
}

#[test]
fn an_experiment_is_read_and_its_errors_have_its_name() {
    let text = "[experiment.surface]\nvariant = \"paper\"\n[experiment.mapping.loop]\nrequest_interval = 8\n";
    let settings = Settings::from_toml(text, "my.toml").unwrap();
    assert!(settings.surface.variant.is_paper());
    assert_eq!(settings.mapping.loops.request_interval, 8);
    assert_eq!(Settings::from_toml(&settings.to_toml().unwrap(), "text").unwrap(), settings);
    assert_eq!(
        refusal("[experiment.mapping.loop]\nrequest_interval = 0\n"),
        "configuration: experiment.mapping.loop.request_interval is 0, expected a number from 1 to 1000000"
    );
    let word = refusal("[experiment.surface]\nvariant = \"mine\"\n");
    assert!(word.ends_with("in `experiment.surface.variant`"), "{word}");
}

#[test]
fn an_unknown_key_names_its_line_and_the_nearest() {
    assert_eq!(
        refusal("[output]\nmap_max_depth_m = 2.0\nmap_voxl_m = 0.01\n"),
        "my.toml, line 3: unknown key `output.map_voxl_m`; the nearest known key is `output.map_voxel_m`"
    );
    assert!(refusal("map_voxel_m = 0.01").contains("the nearest known key is `output.map_voxel_m`"));
    assert!(refusal("[outptu]\n").contains("the nearest known key is `output`"));
    assert!(refusal("zzz = 1").contains("the tables are"));
}

#[test]
fn wrong_types_and_values_name_key_value_and_rule() {
    assert_eq!(
        refusal("[output]\nmap_voxel_m = \"small\"\n"),
        "my.toml, line 2: `output.map_voxel_m` is the text \"small\", expected a number"
    );
    assert_eq!(
        refusal("[output]\nmap_voxel_m = nan\n"),
        "configuration: output.map_voxel_m is NaN, expected a number from 0.001 to 1"
    );
    assert_eq!(
        refusal("[run]\nframes = -3\n"),
        "configuration: invalid value: integer `-3`, expected u64 in `run.frames`"
    );
    assert!(refusal("[run\n").starts_with("my.toml, line 1: not valid TOML"));
}

#[test]
fn overrides_that_are_no_pair_or_no_key_are_refused() {
    let message = |pair: &str| Settings::load(None, &[pair.to_owned()]).unwrap_err().to_string();
    assert!(message("run.live").contains("expected key=value"));
    assert!(message("a b=1").contains("expected key=value"));
    assert_eq!(
        message("run.liv=true"),
        "--set run.liv=true: unknown key `run.liv`; the nearest known key is `run.live`"
    );
    assert!(message("run.live=maybe").contains("expected true or false"));
    // A line break in a value cannot smuggle a second key in.
    let smuggled = Settings::load(None, &["run.source=\"a\"\nrun.live=true".to_owned()]);
    assert_eq!(smuggled.map(|s| s.run.live), Ok(false));
}

#[test]
fn a_missing_file_names_the_presets() {
    let message = Settings::load(Some("nowhere.toml"), &[]).unwrap_err().to_string();
    assert!(message.starts_with("nowhere.toml: cannot read the configuration"), "{message}");
    assert!(message.contains("default, paper, fast, onboard"), "{message}");
}

#[test]
fn the_settings_of_a_run_of_an_earlier_version_are_read_without_what_is_no_more() {
    let text =
        "[surface]\nstep = 2\ngone = 14.0\n\n[stages.align]\nnice = 5\n\n[mapping.window]\nradius_m = 0.4\n";
    assert!(refusal(text).contains("unknown key `surface.gone`"), "{}", refusal(text));
    let settings = Settings::from_run(text, "config.toml").unwrap();
    assert_eq!(settings.surface.step, 2);
    let defaults = Settings::from_toml("[surface]\nstep = 2\n", "text").unwrap();
    assert_eq!(settings, defaults, "what has come since has its default");
    let refused = |text: &str| Settings::from_run(text, "config.toml").unwrap_err().to_string();
    assert!(refused("[surface]\nstep = \"two\"\n").contains("expected a whole number"));
    assert!(refused("[surface\n").contains("config.toml: not valid TOML"));
}
