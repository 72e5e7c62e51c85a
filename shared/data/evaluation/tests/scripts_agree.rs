//! Our figures against those of the TUM scripts and of evo on real estimates of real frames.

#[path = "../../../../tests/requirements.rs"]
mod requirements;

use serde_json::Value;
use std::path::Path;
use tessera_evaluation::{AteOptions, RpeOptions, ape_evo, ate, read_tum, rpe};

fn number(value: &Value, group: &str, key: &str) -> f64 {
    value[group][key].as_f64().unwrap_or_else(|| panic!("expected.json lacks {group}.{key}"))
}

#[test]
fn figures_agree_with_the_tum_scripts_and_evo() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../tests/data/evaluation");
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let expected: Value = serde_json::from_str(&text).unwrap();
    let cases = expected.as_array().unwrap();
    assert!(cases.len() >= 5);
    for case in cases {
        let name = case["estimate"].as_str().unwrap();
        let sequence = case["sequence"].as_str().unwrap();
        let estimate = read_tum(&folder.join(name)).unwrap();
        let Some(truth) = requirements::data(&format!("{sequence}/groundtruth.txt")) else { continue };
        let truth = read_tum(&truth).unwrap();

        let ate = ate(&estimate, &truth, &AteOptions::default()).unwrap();
        let rpe = rpe(&estimate, &truth, &RpeOptions::default()).unwrap();
        let tum = |key| number(case, "tum_scripts", key);
        assert_eq!(ate.pairs.len() as f64, tum("ate_pairs"), "{name}");
        assert_eq!(rpe.pairs.len() as f64, tum("rpe_pairs"), "{name}");
        let figures = [
            ("ate_rmse_m", ate.statistics_m.rmse),
            ("ate_mean_m", ate.statistics_m.mean),
            ("ate_median_m", ate.statistics_m.median),
            ("ate_max_m", ate.statistics_m.max),
            ("rpe_translation_rmse_m", rpe.translation_m.rmse),
            ("rpe_translation_mean_m", rpe.translation_m.mean),
            ("rpe_rotation_rmse_deg", rpe.rotation_deg.rmse),
        ];
        for (key, found) in figures {
            let six = |value: f64| format!("{value:.6}");
            assert_eq!(six(found), six(tum(key)), "{name}: {key}");
        }

        let evo = |key| number(case, "evo", key);
        let ape = ape_evo(&estimate, &truth, evo("max_diff_s")).unwrap();
        assert_eq!(ape.pairs.len() as f64, evo("ape_pairs"), "{name}");
        for (key, found) in [
            ("ape_translation_rmse_m", ape.statistics_m.rmse),
            ("ape_translation_max_m", ape.statistics_m.max),
        ] {
            assert!((found - evo(key)).abs() < 1e-9, "{name}: {key} is {found}, evo says {}", evo(key));
        }
    }
}
