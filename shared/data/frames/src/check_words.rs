//! What a source is, in words for people.

use crate::CheckReport;
use std::fmt::Write;
use tessera_geometry::Camera;

impl CheckReport {
    /// A line for each fact, warnings last.
    pub fn for_people(&self) -> String {
        let mut text = String::new();
        let camera = &self.camera;
        let frames = self.n_frames.map_or("without an end".to_owned(), |n| n.to_string());
        let depth = self.depth.median_m.map_or("none".to_owned(), |m| format!("{m:.3} m"));
        let truth = match self.ground_truth_poses {
            0 => "none".to_owned(),
            n => format!("{n} poses over {:.1} % of the frames", 100.0 * self.ground_truth_share),
        };
        for (name, value) in &self.description {
            // Writing to a String cannot fail, here and below.
            let _ = writeln!(text, "  {name:<16} {value}");
        }
        let lines = [
            ("frames", format!("{frames} in {:.1} s", self.duration_s)),
            ("images", format!("{}x{} px", camera.width, camera.height)),
            ("focal length", format!("{} x {} px", camera.fx, camera.fy)),
            ("principal point", format!("{} x {} px", camera.cx, camera.cy)),
            (
                "field of view",
                format!("{:.1} x {:.1} degrees", self.horizontal_fov_deg, self.vertical_fov_deg),
            ),
            (
                "distortion",
                if camera.is_distorted() { format!("{:?}", camera.distortion) } else { "none".into() },
            ),
            ("rolling shutter", format!("{:.1} ms", 1e3 * camera.readout_s)),
            ("colour camera", colour(camera)),
            ("depth units", format!("{} a metre", camera.units_per_metre)),
            ("median depth", depth),
            ("valid pixels", format!("{:.1} %", 100.0 * self.depth.valid_share)),
            ("pairs", pairs(self)),
            ("gaps", gaps(self)),
            ("ground truth", truth),
        ];
        for (name, value) in lines {
            let _ = writeln!(text, "  {name:<16} {value}");
        }
        for warning in &self.warnings {
            let _ = writeln!(text, "  warning: {warning}");
        }
        text
    }
}

/// How colour lies against depth, as the camera file has it.
fn colour(camera: &Camera) -> String {
    if !camera.colour_registered {
        return "of another camera".into();
    }
    let (lag_ms, ratio) = (1e3 * camera.colour_lag_s, camera.colour_focal_ratio);
    format!("{lag_ms:.1} ms newer than depth, {ratio} times its focal length")
}

fn pairs(report: &CheckReport) -> String {
    let late = match -1e3 * report.taken_after_s {
        late_ms if late_ms > 0.0 => format!("; depth is taken {late_ms:.1} ms before its stamps"),
        _ => String::new(),
    };
    format!(
        "{} of {} depth and {} colour images, at most {:.1} ms apart{late}",
        report.n_pairs,
        report.n_depth,
        report.n_colour,
        1e3 * report.largest_pair_difference_s
    )
}

fn gaps(report: &CheckReport) -> String {
    let gaps = &report.gaps;
    let median = 1e3 * gaps.median_interval_s;
    if gaps.n_gaps == 0 {
        return format!("none, a frame each {median:.1} ms");
    }
    format!(
        "{} among intervals of {median:.1} ms, the longest {:.1} ms after frame {}",
        gaps.n_gaps,
        1e3 * gaps.longest_s,
        gaps.longest_after_frame
    )
}
