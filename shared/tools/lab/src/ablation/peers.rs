//! Results of other systems, by sequence, each value with its source.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All systems.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Peers {
    system: Vec<System>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct System {
    name: String,
    source: String,
    /// ATE RMSE, metres, by the short name of a sequence.
    ate_m: BTreeMap<String, f64>,
}

/// What one system reaches on one sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PeerResult {
    /// Name of the system.
    pub system: String,
    /// Who says so.
    pub source: String,
    /// ATE RMSE, metres.
    pub ate_m: f64,
}

impl Peers {
    /// The table that comes with the program.
    ///
    /// # Errors
    /// The file is no such table.
    pub fn built_in() -> Result<Self, toml::de::Error> {
        toml::from_str(include_str!("peers.toml"))
    }

    /// What is known of a sequence, in the order of the file.
    pub fn of(&self, sequence: &str) -> Vec<PeerResult> {
        let key = short_name(sequence);
        let known = |s: &System| {
            let ate_m = *s.ate_m.get(&key)?;
            Some(PeerResult { system: s.name.clone(), source: s.source.clone(), ate_m })
        };
        self.system.iter().filter_map(known).collect()
    }
}

/// The name that papers use: `rgbd_dataset_freiburg3_long_office_household` is `fr3_office`.
fn short_name(sequence: &str) -> String {
    let name = sequence.strip_prefix("rgbd_dataset_").unwrap_or(sequence);
    let name = name.strip_prefix("freiburg").map_or(name.to_owned(), |rest| format!("fr{rest}"));
    match name.as_str() {
        "fr3_long_office_household" => "fr3_office".to_owned(),
        "fr3_nostructure_texture_near_withloop" => "fr3_nst".to_owned(),
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tum_s_folders_and_the_papers_short_names_are_one() {
        let peers = Peers::built_in().unwrap();
        assert_eq!(peers.of("rgbd_dataset_freiburg1_desk"), peers.of("fr1_desk"));
        assert_eq!(
            peers.of("rgbd_dataset_freiburg3_long_office_household")[0].ate_m,
            0.035,
            "DVO-SLAM on fr3 office"
        );
        assert!(peers.of("rgbd_dataset_freiburg3_nostructure_texture_near_withloop").len() >= 3);
        assert!(peers.of("room").is_empty());
    }

    #[test]
    fn every_value_is_an_error_in_metres_with_a_source() {
        for system in Peers::built_in().unwrap().system {
            assert!(!system.source.is_empty() && !system.ate_m.is_empty(), "{}", system.name);
            assert!(system.ate_m.values().all(|v| (0.001..1.0).contains(v)), "{}", system.name);
        }
    }

    #[test]
    fn an_excerpt_is_not_compared_with_the_whole_sequence() {
        let peers = Peers::built_in().unwrap();
        let (excerpt, whole) = (peers.of("fr1_rpy_400"), peers.of("fr1_rpy"));
        assert!(excerpt.iter().all(|p| p.source.starts_with("measured")));
        assert!(whole.iter().all(|p| p.source.starts_with("published")));
        assert!(!excerpt.is_empty() && !whole.is_empty());
    }
}
