//! `imu.txt` (`timestamp gx gy gz [ax ay az]` a line) and `imu.toml` beside it.

use super::{ForceSample, GyroSample, ImuModel, ImuRecording};
use crate::{ListError, SourceError};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::path::Path;
use tessera_evaluation::{format_stamp, parse_stamp, plain_text};

/// No instrument on a hand-held camera measures more, radians per second.
const MOST_RAD_PER_S: f64 = 100.0;

/// No instrument on a hand-held camera measures more, metres per second squared.
const MOST_M_PER_S2: f64 = 500.0;

/// Reads both files of a folder, turned into the camera's axes; `None` where there is no `imu.txt`.
///
/// # Errors
/// Names the file and line, what was found and what was expected.
pub fn load(folder: &Path) -> Result<Option<ImuRecording>, SourceError> {
    let path = folder.join("imu.txt");
    if !path.exists() {
        return Ok(None);
    }
    let read =
        |path: &Path| std::fs::read(path).map_err(|source| SourceError::Io { path: path.to_owned(), source });
    let settings = folder.join("imu.toml");
    let model = match settings.exists() {
        true => parse_settings(&plain_text(&read(&settings)?), &settings)?,
        false => ImuModel::default(),
    };
    let [x, y, z, w] = model.camera_from_imu_xyzw;
    let camera_from_imu = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let (rates, forces) = parse(&plain_text(&read(&path)?), &path)?;
    Ok(Some(ImuRecording { model, rates, forces }.turned(&camera_from_imu)))
}

fn parse_settings(text: &str, path: &Path) -> Result<ImuModel, SourceError> {
    let wrong = |message: String| SourceError::CameraFile { file: path.display().to_string(), message };
    let model: ImuModel =
        toml::from_str(text).map_err(|error| wrong(error.to_string().trim_end().to_owned()))?;
    let length_sq: f64 = model.camera_from_imu_xyzw.iter().map(|v| v * v).sum();
    if !((length_sq - 1.0).abs() < 1e-3) {
        let found = model.camera_from_imu_xyzw;
        return Err(wrong(format!("camera_from_imu_xyzw is {found:?}, expected a quaternion of length 1")));
    }
    for (key, value, most) in [
        ("noise_rad_per_s_sqrt_hz", model.noise_rad_per_s_sqrt_hz, 1.0),
        ("bias_sigma_rad_per_s", model.bias_sigma_rad_per_s, 10.0),
        ("bias_sigma_m_per_s2", model.bias_sigma_m_per_s2, 10.0),
    ] {
        if !(value >= 0.0 && value <= most) {
            return Err(wrong(format!("{key} is {value}, expected a number from 0 to {most}")));
        }
    }
    Ok(model)
}

fn parse(text: &str, path: &Path) -> Result<(Vec<GyroSample>, Vec<ForceSample>), SourceError> {
    let (mut rates, mut forces): (Vec<GyroSample>, Vec<ForceSample>) = Default::default();
    for (at, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (rate, force) = parse_line(line, rates.last()).map_err(|source| SourceError::List {
            path: path.to_owned(),
            line: at.saturating_add(1),
            source,
        })?;
        rates.push(rate);
        forces.extend(force);
    }
    if rates.is_empty() {
        return Err(SourceError::EmptyImu { path: path.to_owned() });
    }
    Ok((rates, forces))
}

fn parse_line(
    line: &str,
    before: Option<&GyroSample>,
) -> Result<(GyroSample, Option<ForceSample>), ListError> {
    let words: Vec<&str> = line.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()).collect();
    let ([stamp, rates @ ..], 4 | 7) = (&words[..], words.len()) else {
        return Err(ListError::ImuColumns { found: line.to_owned() });
    };
    let stamp_nanos = parse_stamp(stamp)?;
    if let Some(before) = before
        && stamp_nanos <= before.stamp_nanos
    {
        let found = format_stamp(stamp_nanos);
        return Err(match stamp_nanos == before.stamp_nanos {
            true => ListError::Repeated { found },
            false => ListError::Unsorted { found, before: format_stamp(before.stamp_nanos) },
        });
    }
    let number = |word: &&str| {
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| ListError::ImuNumber { found: (*word).to_owned() })
    };
    let numbers = rates.iter().map(number).collect::<Result<Vec<f64>, ListError>>()?;
    let vector = |values: &[f64]| Vector3::from_iterator(values.iter().copied());
    let (rate, force) = numbers.split_at(3);
    let rate_rad_per_s = vector(rate);
    if !(rate_rad_per_s.amax() <= MOST_RAD_PER_S) {
        return Err(ListError::ImuRate {
            found: rate_rad_per_s.amax().to_string(),
            most: MOST_RAD_PER_S.to_string(),
        });
    }
    let force_m_per_s2 = (!force.is_empty()).then(|| vector(force));
    if let Some(force) = force_m_per_s2.filter(|force| !(force.amax() <= MOST_M_PER_S2)) {
        return Err(ListError::ImuForce { found: force.amax().to_string(), most: MOST_M_PER_S2.to_string() });
    }
    // Zero is what a recorder writes without the instrument: in free fall nobody maps.
    let force_m_per_s2 = force_m_per_s2.filter(|force| *force != Vector3::zeros());
    let force = force_m_per_s2.map(|force_m_per_s2| ForceSample { stamp_nanos, force_m_per_s2 });
    Ok((GyroSample { stamp_nanos, rate_rad_per_s }, force))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bad_line_is_named() {
        let table = [
            ("# only\n\n", "imu.txt has no measurements"),
            ("1.0 0.1 0.2", "imu.txt, line 1: found '1.0 0.1 0.2', expected: timestamp gx gy gz [ax ay az]"),
            ("1.0 0 0 0\n1.1 0 0 0 9.8", "line 2: found '1.1 0 0 0 9.8'"),
            ("1.0 0 0 0\n1.0 0 0 0", "line 2: timestamp 1.000000 is repeated"),
            ("1.0 0 0 0\n\n0.5 0 0 0", "line 3: timestamp 0.500000 comes after 1.000000"),
            ("1.0 0 nan 0", "line 1: found 'nan', expected a finite number"),
            ("1.0 0 0 0 0 inf 0", "found 'inf', expected a finite number"),
            ("1.0 0 x 0", "found 'x'"),
            ("1.0 0 0 200", "a rate is 200 rad/s, expected at most 100 rad/s: are these degrees?"),
            ("x 0 0 0", "line 1: "),
            ("1.0 0 0 0 0 -501 0", "line 1: a specific force is 501 m/s^2, expected at most 500 m/s^2"),
        ];
        for (text, expected) in table {
            let found = parse(text, Path::new("imu.txt")).unwrap_err().to_string();
            assert!(found.contains(expected), "{text:?}: {found}");
        }
    }

    #[test]
    fn rates_and_forces_are_read_with_comments_and_commas() {
        let text = "# t gx gy gz\n1.0 0.1 -0.2 0.3\n1.005,0,0,1e-3,0.1,9.8,0.2\n1.01 0 0 0 0 0 0\n";
        let (rates, forces) = parse(text, Path::new("imu.txt")).unwrap();
        assert_eq!(rates.len(), 3);
        assert_eq!(rates[0].rate_rad_per_s, Vector3::new(0.1, -0.2, 0.3));
        let stamp_nanos = 1_005_000_000;
        assert_eq!(rates[1], GyroSample { stamp_nanos, rate_rad_per_s: Vector3::z() * 1e-3 });
        let force_m_per_s2 = Vector3::new(0.1, 9.8, 0.2);
        assert_eq!(forces, [ForceSample { stamp_nanos, force_m_per_s2 }]);
    }

    #[test]
    fn the_instrument_s_axes_are_turned_into_the_camera_s() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(load(dir.path()).unwrap(), None);
        std::fs::write(dir.path().join("imu.txt"), "1.0 1 0 0 0 9.8 0\n").unwrap();
        assert_eq!(load(dir.path()).unwrap().unwrap().rates[0].rate_rad_per_s, Vector3::x());
        // A quarter turn about z takes x to y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let settings = |text: String| std::fs::write(dir.path().join("imu.toml"), text).unwrap();
        settings(format!("camera_from_imu_xyzw = [0.0, 0.0, {half}, {half}]\nbias_sigma_rad_per_s = 0.02\n"));
        let ImuRecording { model, rates, forces } = load(dir.path()).unwrap().unwrap();
        assert!((rates[0].rate_rad_per_s - Vector3::y()).norm() < 1e-12);
        assert!((forces[0].force_m_per_s2 - Vector3::new(-9.8, 0.0, 0.0)).norm() < 1e-12);
        assert_eq!(model.bias_sigma_rad_per_s, 0.02);
        for (text, expected) in [
            ("camera_from_imu_xyzw = [0.0, 0.0, 0.0, 2.0]", "expected a quaternion of length 1"),
            ("bias_sigma_rad_per_s = -1.0", "bias_sigma_rad_per_s is -1, expected a number from 0 to 10"),
            ("bias_sigma_m_per_s2 = 11.0", "bias_sigma_m_per_s2 is 11, expected a number from 0 to 10"),
            ("noise_rad_per_s_sqrt_hz = nan", "noise_rad_per_s_sqrt_hz is NaN"),
            ("bias = 1.0", "unknown field `bias`"),
        ] {
            settings(text.to_owned());
            let found = load(dir.path()).unwrap_err().to_string();
            assert!(found.contains("imu.toml: ") && found.contains(expected), "{found}");
        }
    }
}
