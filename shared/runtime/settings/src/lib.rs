//! Every setting of Tessera in one typed, checked TOML file.
//!
//! A setting has one default, in the struct beside the algorithm that reads it. On top of it come,
//! in this order, a preset or a file, then `--set key=value`. What results is checked once, here,
//! and written beside the outputs with every value that was used.
//!
//! Keys stand in two groups: those for users, and below `[experiment]` the variants of the method that
//! the preset `paper`, `tessera ablate` and tests need.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod error;
mod experiment;
mod flow;
mod known;
mod layers;
mod output;
mod presets;
mod run;
mod source;
mod stages;

pub use error::SettingsError;
pub use flow::{FlowSettings, Fsync};
pub use layers::Layers;
pub use output::OutputSettings;
pub use presets::{PRESETS, preset};
pub use run::RunSettings;
pub use source::SourceSettings;
pub use stages::{Restart, StageSettings};

use serde::{Deserialize, Serialize};
use tessera_numerics::Isa;
use tessera_registration::RegistrationSettings;
use tessera_slam::MappingSettings;
use tessera_sources::{SimulationOptions, SourceOptions, SourceSpec};
use tessera_surface::SurfaceSettings;
use toml::Table;

/// All settings of a run, one table for each part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// What is run: the source and how it is read.
    pub run: RunSettings,
    /// What a source may have wrong before the run refuses it.
    pub source: SourceSettings,
    /// What the simulated worlds look like; folders have no use for it.
    pub simulation: SimulationOptions,
    /// From a depth image to a surface.
    pub surface: SurfaceSettings,
    /// From surfaces to relative poses.
    pub registration: RegistrationSettings,
    /// Tracking, keyframes, loops and the optimisation of all keyframes.
    pub mapping: MappingSettings,
    /// How frames move between the processes.
    pub flow: FlowSettings,
    /// How the processes are supervised.
    pub stages: StageSettings,
    /// What is written at the end.
    pub output: OutputSettings,
}

impl Settings {
    /// The defaults, then `base` (a preset's name or a file, if given), then `overrides` (`key=value`).
    ///
    /// # Errors
    /// Names the key, where it stands, what was found and what must hold.
    pub fn load(base: Option<&str>, overrides: &[String]) -> Result<Self, SettingsError> {
        let mut layers = Layers::new();
        if let Some(base) = base {
            layers.add_base(base)?;
        }
        for pair in overrides {
            layers.add_override(pair)?;
        }
        layers.resolve()
    }

    /// Reads a `config.toml` that [`Self::to_toml`] wrote, or any other text of settings.
    ///
    /// # Errors
    /// As [`Self::load`]; `origin` names the text in messages.
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, SettingsError> {
        let mut layers = Layers::new();
        layers.add_text(text, origin)?;
        layers.resolve()
    }

    /// Reads the `config.toml` of a run that may have been recorded by an earlier version: settings that there
    /// are no more decide nothing and are left out, those that have come since have their defaults.
    ///
    /// # Errors
    /// As [`Self::load`]; `origin` names the text in messages.
    pub fn from_run(text: &str, origin: &str) -> Result<Self, SettingsError> {
        let mut layers = Layers::new();
        layers.add_recorded(text, origin)?;
        layers.resolve()
    }

    /// The source that these settings name, and how it is opened.
    pub fn source(&self) -> (SourceSpec, SourceOptions) {
        let run = &self.run;
        let options = SourceOptions {
            camera: (!run.camera.is_empty()).then(|| run.camera.clone()),
            depth_topic: (!run.depth_topic.is_empty()).then(|| run.depth_topic.clone()),
            color_topic: (!run.color_topic.is_empty()).then(|| run.color_topic.clone()),
            skip: run.skip,
            frames: (run.frames > 0).then_some(run.frames),
            fps: None,
            simulation: self.simulation.clone(),
        };
        (SourceSpec::parse(&run.source), options)
    }

    /// Whether frames come from a program that is none of ours.
    pub fn is_external(&self) -> bool {
        SourceSpec::parse(&self.run.source) == SourceSpec::External
    }

    /// Sets the vector instructions of all algorithms.
    pub fn set_isa(&mut self, isa: Isa) {
        (self.run.isa, self.surface.isa, self.registration.isa) = (isa, isa, isa);
    }

    /// Every value, in the order of the structs.
    ///
    /// # Errors
    /// When a value cannot stand in a TOML file, which [`Self::check`] excludes.
    pub fn to_toml(&self) -> Result<String, SettingsError> {
        let wrong = |error: toml::ser::Error| SettingsError::Write { reason: error.to_string() };
        toml::to_string(&experiment::to_file(Table::try_from(self).map_err(wrong)?)).map_err(wrong)
    }

    fn check_map(&self) -> Result<(), String> {
        match self.mapping.only_localise && self.run.map.is_empty() {
            true => Err("only_localise is true without a map, expected run.map = FOLDER with it".to_owned()),
            false => Ok(()),
        }
    }

    /// Checks every range; NaN is outside of each.
    ///
    /// # Errors
    /// Names the first key whose value cannot be, the value and the rule.
    pub fn check(&self) -> Result<(), SettingsError> {
        fn words<E: std::fmt::Display>(result: Result<(), E>) -> Result<(), String> {
            result.map_err(|error| error.to_string())
        }
        let parts = [
            ("run", words(self.run.check())),
            ("source", words(self.source.check())),
            ("simulation", words(self.simulation.check())),
            ("surface", words(self.surface.check())),
            ("registration", words(self.registration.check())),
            ("mapping", words(self.mapping.check()).and_then(|()| self.check_map())),
            ("flow", words(self.flow.check())),
            ("stages", words(self.stages.check())),
            ("output", words(self.output.check())),
        ];
        for (part, result) in parts {
            result.map_err(|reason| SettingsError::Value { reason: experiment::renamed(part, &reason) })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
