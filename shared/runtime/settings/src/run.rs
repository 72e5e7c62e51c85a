//! Settings of a run: its source, and how it is read.

use serde::{Deserialize, Serialize};
use tessera_geometry::PoseBits;
use tessera_numerics::Isa;

/// The source and how it is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunSettings {
    /// A recording (a folder of images, a bag of ROS 2, an MCAP file), a simulated world (`room`, `corridor`,
    /// `wall`, `house`, `building`), or `external`: a camera's own program sends the frames.
    pub source: String,
    /// A camera file or the name of a built-in camera; empty: the source's own.
    pub camera: String,
    /// Topic of depth in an MCAP file; empty: the one whose name says so.
    pub depth_topic: String,
    /// Topic of colour in an MCAP file; empty: the one whose name says so; `none`: colour is left
    /// out, of folders too.
    pub color_topic: String,
    /// Frames left out at the beginning.
    pub skip: u64,
    /// Frames to process at most; 0: all.
    pub frames: u64,
    /// Frames come at the source's own rate and the newest wins, instead of each in order.
    pub live: bool,
    /// The run ends where a camera's own program sends nothing usable for so long, seconds.
    pub camera_timeout_s: f64,
    /// Frames are decoded into memory before the first is sent.
    pub preload: bool,
    /// Vector instructions, for diagnosis: results have the same bits with each. A run names in its own
    /// `config.toml` those that it uses.
    pub isa: Isa,
    /// Go on where the source looks wrong (depth units that no room can have).
    pub force: bool,
    /// Align and optimise throw their state away after so many frames and read it back; 0: never.
    /// For tests: the outputs stay the same bytes.
    pub forget_every: u64,
    /// Folder of an earlier run in whose map this one starts; empty: a new map.
    pub map: String,
    /// Where the first frame stands in that map, `tx ty tz qx qy qz qw` (metres, unit quaternion of
    /// world_from_camera); empty: it is found by recognition.
    pub at: String,
    /// Time for which each optimisation of all keyframes is left to the base of a fleet, seconds; behind
    /// it, or with no base in contact, the run's own takes its place. 0: no base is asked.
    pub base_wait_s: f64,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            source: "room".to_owned(),
            camera: String::new(),
            depth_topic: String::new(),
            color_topic: String::new(),
            skip: 0,
            frames: 0,
            live: false,
            camera_timeout_s: 30.0,
            preload: false,
            isa: Isa::Auto,
            force: false,
            forget_every: 0,
            map: String::new(),
            at: String::new(),
            base_wait_s: 0.0,
        }
    }
}

impl RunSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        if self.source.trim().is_empty() {
            return Err("source is empty, expected a folder or one of room, corridor, wall, house, building"
                .to_owned());
        }
        if !(self.camera_timeout_s >= 0.1 && self.camera_timeout_s <= 1e6) {
            let value = self.camera_timeout_s;
            return Err(format!("camera_timeout_s is {value}, expected a number from 0.1 to 1000000"));
        }
        if !(self.base_wait_s >= 0.0 && self.base_wait_s <= 3600.0) {
            let value = self.base_wait_s;
            return Err(format!("base_wait_s is {value}, expected a number from 0 (no base) to 3600"));
        }
        if !self.at.is_empty() && self.map.is_empty() {
            return Err(format!("at is {:?} without a map, expected map = FOLDER with it", self.at));
        }
        self.start().map(drop)
    }

    /// Where the first frame stands in the map, if that was said.
    ///
    /// # Errors
    /// `at is …, expected …`.
    pub fn start(&self) -> Result<Option<PoseBits>, String> {
        if self.at.is_empty() {
            return Ok(None);
        }
        let expected = "seven numbers tx ty tz qx qy qz qw, the last four of length 1";
        let wrong = || format!("at is {:?}, expected {expected}", self.at);
        let words: Vec<&str> = self.at.split_whitespace().collect();
        let numbers: Vec<f64> = words.iter().filter_map(|word| word.parse().ok()).collect();
        let ([tx, ty, tz, qx, qy, qz, qw], 7) =
            (<[f64; 7]>::try_from(numbers).map_err(|_| wrong())?, words.len())
        else {
            return Err(wrong());
        };
        let norm = (qx * qx + qy * qy + qz * qz + qw * qw).sqrt();
        // Files hold a few digits.
        if !(0.99..1.01).contains(&norm) {
            return Err(wrong());
        }
        let rotation_xyzw = [qx, qy, qz, qw].map(|q| q / norm);
        let bits = PoseBits { translation_m: [tx, ty, tz], rotation_xyzw };
        if bits.is_valid() { Ok(Some(bits)) } else { Err(wrong()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wait_for_a_base_is_checked() {
        for bad in [-1.0, 3601.0, f64::NAN] {
            let run = RunSettings { base_wait_s: bad, ..RunSettings::default() };
            let message = run.check().unwrap_err();
            assert!(message.ends_with("expected a number from 0 (no base) to 3600"), "{message}");
        }
    }

    #[test]
    fn a_start_is_seven_numbers_and_belongs_to_a_map() {
        let run = |at: &str| RunSettings { map: "m".into(), at: at.into(), ..RunSettings::default() };
        let start = run("1 -2 3.5 0 0 0.7071 0.7071").start().unwrap().unwrap();
        assert_eq!(start.translation_m, [1.0, -2.0, 3.5]);
        assert!(start.is_valid());
        for bad in
            ["1 2 3", "1 2 3 0 0 0 2", "1 2 3 0 0 0 1 x", "1 2 x 0 0 0 1", "nan 2 3 0 0 0 1", "1 2 3 0 0 0 0"]
        {
            let message = run(bad).check().unwrap_err();
            assert!(message.contains("expected seven numbers"), "{bad}: {message}");
        }
        let alone = RunSettings { map: String::new(), ..run("0 0 0 0 0 0 1") };
        assert!(alone.check().unwrap_err().contains("without a map"));
    }
}
