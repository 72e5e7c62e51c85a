//! The columns of the paper's Table I, each a handful of settings over one base.

use tessera_settings::{Settings, SettingsError};
use tessera_slam::WindowSettings;

/// One column: what it varies, and the settings that say so.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The value varied, as in the table's head: `n = 4`.
    pub name: String,
    /// `key=value`, over the base.
    pub overrides: Vec<String>,
}

/// The column that the improvements refer to: pairwise, n = 4, no filter.
pub(super) const REFERENCE: usize = 2;

/// All columns, in the paper's order: each frame against the one before, no filter, every n-th pixel; the same with
/// n = 4 and the filter over k rings; each frame against w others, n = 4, k = 4.
pub fn columns() -> Vec<Column> {
    let column = |letter: char, value: u32, settings: [u32; 3]| {
        let [step, rings, window] = settings;
        let mut overrides = vec![
            format!("surface.step={step}"),
            format!("surface.filter_rings={rings}"),
            format!("mapping.window.size={window}"),
        ];
        overrides.extend(INITIAL_ALIGNMENTS.map(str::to_owned));
        if window == 1 {
            // Keyframes then serve a lost camera alone, and few of them take less memory.
            overrides.extend(SPARSE_KEYFRAMES.map(str::to_owned));
        }
        Column { name: format!("{letter} = {value}"), overrides }
    };
    let pairwise = [1, 2, 4].map(|n| column('n', n, [n, 0, 1]));
    let filter = [1, 2, 3, 4].map(|k| column('k', k, [4, k, 1]));
    let window = [2, 3, 4, 5].map(|w| column('w', w, [4, 4, w]));
    pairwise.into_iter().chain(filter).chain(window).collect()
}

/// Initial alignments alone: no loop asks for an optimisation, and each alignment stands as it is,
/// also one that the failure tests would send back.
const INITIAL_ALIGNMENTS: [&str; 1] = ["mapping.loop.min_frames=1000000000"];

/// The failure tests of [`INITIAL_ALIGNMENTS`]: limits that every alignment keeps.
fn accept_all(window: &mut WindowSettings) {
    window.min_match_share = 0.0;
    window.max_residual_sigmas = 1000.0;
    window.min_matched = 0.0;
    window.max_in_front = 1.0;
}

const SPARSE_KEYFRAMES: [&str; 2] =
    ["mapping.keyframe.translation_m=0.5", "mapping.keyframe.rotation_deg=30"];

impl Column {
    /// The column's settings over `base` (a preset or a file) and `overrides`.
    ///
    /// # Errors
    /// As [`Settings::load`].
    pub fn settings(&self, base: &str, overrides: &[String]) -> Result<Settings, SettingsError> {
        let all: Vec<String> = overrides.iter().chain(&self.overrides).cloned().collect();
        let mut settings = Settings::load(Some(base), &all)?;
        accept_all(&mut settings.mapping.window);
        Ok(settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_column_has_the_settings_of_its_head() {
        let all = columns();
        let varied: Vec<(String, u32, u32, u32)> = all
            .iter()
            .map(|c| {
                let s = c.settings("paper", &[]).unwrap();
                assert_eq!(s.mapping.loops.min_frames, 1_000_000_000, "{}", c.name);
                assert_eq!(s.mapping.window.min_match_share, 0.0, "{}", c.name);
                (c.name.clone(), s.surface.step, s.surface.filter_rings, s.mapping.window.size)
            })
            .collect();
        let expected = [
            ("n = 1", 1, 0, 1),
            ("n = 2", 2, 0, 1),
            ("n = 4", 4, 0, 1),
            ("k = 1", 4, 1, 1),
            ("k = 2", 4, 2, 1),
            ("k = 3", 4, 3, 1),
            ("k = 4", 4, 4, 1),
            ("w = 2", 4, 4, 2),
            ("w = 3", 4, 4, 3),
            ("w = 4", 4, 4, 4),
            ("w = 5", 4, 4, 5),
        ];
        let expected: Vec<_> = expected.map(|(name, n, k, w)| (name.to_owned(), n, k, w)).into();
        assert_eq!(varied, expected);
        assert_eq!(all[REFERENCE].name, "n = 4");
    }

    #[test]
    fn a_column_wins_over_what_the_user_set() {
        let settings = columns()[0].settings("default", &["surface.step=8".to_owned()]).unwrap();
        assert_eq!(settings.surface.step, 1);
        assert!(columns()[0].settings("default", &["surface.stepp=8".to_owned()]).is_err());
    }
}
