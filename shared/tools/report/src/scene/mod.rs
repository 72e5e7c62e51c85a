//! The map and the trajectory in 3D: data for the script `viewer.js`, which draws them.

mod encode;

use crate::run::{FrameState, ReportedVerdict};
use tessera_outputs::html::escaped;

/// The script that draws; a page has it once.
pub(crate) const VIEWER: &str = include_str!("viewer.js");

/// Most points of the map in a page.
pub(crate) const MOST_POINTS: usize = 60_000;
/// Most frames; of more, every k-th is shown.
const MOST_FRAMES: usize = 10_000;
/// Most keyframes; of more, every k-th is shown.
const MOST_KEYFRAMES: usize = 5_000;
/// Most loops; of more, every k-th is shown.
const MOST_LOOPS: usize = 5_000;
/// Most positions of the ground truth; of more, every k-th is shown.
const MOST_TRUTH: usize = 5_000;
/// Most submaps that can be switched; a page counts them in a byte.
const MOST_SUBMAPS: usize = 255;
/// Most runs of a page that are shown in 3D: browsers draw about 16 such pictures at once.
pub(crate) const MOST_SCENES: usize = 8;

/// A point of the map; axes are right, forward and up, metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScenePoint {
    /// Position.
    pub position_m: [f64; 3],
    /// Unit normal, towards the camera that saw it.
    pub normal: [f64; 3],
    /// Red, green, blue.
    pub rgb: [u8; 3],
    /// Place, in the list of keyframes, of the first that saw it.
    pub keyframe: usize,
}

/// A processed frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneFrame {
    /// As the source counts.
    pub index: u64,
    /// Since the first frame, seconds.
    pub time_s: f64,
    /// Whether it was tracked.
    pub state: FrameState,
    /// Place of its part in the list of parts.
    pub part: usize,
    /// Place of its submap in the list of submaps.
    pub submap: usize,
    /// Place of its robot in the list of robots, where there is one.
    pub robot: usize,
    /// Position of the camera.
    pub position_m: [f64; 3],
    /// From the camera's axes (right, down, forward) to those of the page: x, y, z, w of a quaternion.
    pub rotation: [f64; 4],
    /// Standard deviation of the position as the aligner sees it, metres.
    pub std_m: Option<f64>,
}

/// A keyframe.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneKeyframe {
    /// Position of the camera.
    pub position_m: [f64; 3],
    /// Place of its submap in the list of submaps.
    pub submap: usize,
    /// Whether an earlier run made it.
    pub is_of_map: bool,
    /// Standard deviation of the position as the aligner saw it in that frame, metres.
    pub std_m: Option<f64>,
}

/// A loop pair as a line.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneLoop {
    /// Positions of the newer and the older keyframe.
    pub ends_m: [[f64; 3]; 2],
    /// Places of their submaps; where they differ, it joins both.
    pub submaps: [usize; 2],
    /// What became of it.
    pub verdict: ReportedVerdict,
}

impl SceneLoop {
    /// Whether it joins two submaps.
    pub(crate) fn joins(&self) -> bool {
        self.submaps[0] != self.submaps[1] && self.verdict == ReportedVerdict::Accepted
    }
}

/// What the camera mapped without being lost in between; several that were joined are one part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneSubmap {
    /// What it is called.
    pub name: String,
    /// Place of its part in the list of parts.
    pub part: usize,
}

/// A map with a world frame of its own: the main one, or that of a submap that is apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScenePart {
    /// What it is called.
    pub name: String,
    /// Where its name stands.
    pub label_m: [f64; 3],
    /// Rows of the 3x4 matrix from its world frame, which that of the files is, to the page.
    pub page_from_world: [[f64; 4]; 3],
    /// Its points.
    pub n_points: usize,
}

/// A robot of several in one scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneRobot {
    /// What it is called.
    pub name: String,
    /// Colour of its way: red, green, blue.
    pub rgb: [u8; 3],
}

/// All that is drawn; parts stand beside each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportScene {
    /// The main map first.
    pub parts: Vec<ScenePart>,
    /// Those that can be shown by themselves.
    pub submaps: Vec<SceneSubmap>,
    /// Edge of the voxels that the points are means of, metres.
    pub voxel_m: f64,
    /// Part after part.
    pub points: Vec<ScenePoint>,
    /// In the order of their index.
    pub frames: Vec<SceneFrame>,
    /// By id.
    pub keyframes: Vec<SceneKeyframe>,
    /// As the table of loops has them.
    pub loops: Vec<SceneLoop>,
    /// True positions beside the main map.
    pub truth_m: Vec<[f64; 3]>,
    /// Robots whose frames these are, each with a colour of its own; none where it is one run's.
    pub robots: Vec<SceneRobot>,
    /// Why there is no map, where there is none.
    pub no_map: Option<String>,
}

impl ReportScene {
    /// Whether there is nothing to draw.
    fn is_empty(&self) -> bool {
        self.points.is_empty() && self.frames.is_empty()
    }

    /// The section's inside: a canvas with its controls, or why there is none. The page needs the viewer once.
    pub fn html(&self) -> String {
        let note = |words: &str| format!("<p class=\"note\">{}</p>", escaped(words));
        let missing = match &self.no_map {
            Some(reason) => note(&format!("No map: {reason}")),
            None if self.points.is_empty() => {
                note("The map is empty: no keyframe has a surface within the range of the map.")
            }
            None => String::new(),
        };
        if self.is_empty() {
            return missing;
        }
        let last = self.frames.len().min(encode::every(self.frames.len(), MOST_FRAMES)).saturating_sub(1);
        let apart = if self.parts.len() > 1 {
            note(&format!(
                "{} maps that could not be joined stand beside each other; how they lie to each other is not known.",
                self.parts.len()
            ))
        } else {
            String::new()
        };
        format!(
            "{missing}{apart}<div class=\"scene\">\
             <div class=\"stage\"><canvas aria-label=\"map and trajectory in 3D\"></canvas>\
             <p class=\"fault\" hidden></p></div>\
             <div class=\"walk\"><button type=\"button\" data-do=\"play\">play</button>\
             <input type=\"range\" min=\"0\" max=\"{last}\" value=\"0\" aria-label=\"frame\"><output></output></div>\
             {}{}{}<p class=\"note\">Drag to turn, scroll or pinch to zoom, shift-drag or two fingers to move; \
             click two points for the distance between them. {}</p><script type=\"application/json\">{}</script></div>\
             <noscript><p class=\"note\">The view in 3D needs scripts; the plots below do not.</p></noscript>",
            self.controls(),
            self.submap_controls(),
            self.legend(),
            self.words_of_thinning(),
            encode::json(self)
        )
    }

    /// What can be shown of this scene.
    fn controls(&self) -> String {
        let is_known = self.frames.iter().any(|frame| frame.std_m.is_some());
        let uncertainty = if is_known { "<option value=\"uncertainty\">uncertainty</option>" } else { "" };
        let check = |layer: &str, words: &str, is_there: bool| {
            let check = format!("<input type=\"checkbox\" data-show=\"{layer}\" checked>");
            if is_there { format!("<label>{check} {words}</label>") } else { String::new() }
        };
        CONTROLS
            .replace(UNCERTAINTY, uncertainty)
            .replace(TRUTH, &check("truth", "ground truth", !self.truth_m.is_empty()))
            .replace(KEYFRAMES, &check("keyframes", "keyframes", !self.keyframes.is_empty()))
            .replace(JOINS, &check("joins", "joins", self.loops.iter().any(SceneLoop::joins)))
    }

    /// Each submap on and off, where there are several.
    fn submap_controls(&self) -> String {
        if self.submaps.len() < 2 {
            return String::new();
        }
        let check = |(place, submap): (usize, &SceneSubmap)| {
            let name = escaped(&submap.name);
            format!("<label><input type=\"checkbox\" data-submap=\"{place}\" checked> {name}</label>")
        };
        let checks: String = self.submaps.iter().enumerate().take(MOST_SUBMAPS).map(check).collect();
        format!("<div class=\"controls\">{checks}</div>")
    }

    /// Robots and their colours.
    fn legend(&self) -> String {
        let entry = |robot: &SceneRobot| {
            let [red, green, blue] = robot.rgb;
            let name = escaped(&robot.name);
            format!(
                "<span><i class=\"line\" style=\"background:rgb({red},{green},{blue})\"></i>{name}</span>"
            )
        };
        let entries: String = self.robots.iter().map(entry).collect();
        if entries.is_empty() { entries } else { format!("<p class=\"robots\">{entries}</p>") }
    }

    fn words_of_thinning(&self) -> String {
        if self.points.is_empty() {
            return String::new();
        }
        format!("{} points, one for each {:.0} mm.", self.points.len(), 1e3 * self.voxel_m)
    }
}

/// Where the controls have what not each scene has.
const UNCERTAINTY: &str = "{uncertainty}";
const TRUTH: &str = "{truth}";
const KEYFRAMES: &str = "{keyframes}";
const JOINS: &str = "{joins}";
/// What is shown, in which colours and from where.
const CONTROLS: &str = "<div class=\"controls\">\
    <label>colour <select data-set=\"colour\"><option value=\"image\">image</option>\
    <option value=\"height\">height</option>{uncertainty}</select></label>\
    <label><input type=\"checkbox\" data-show=\"trajectory\" checked> trajectory</label>\
    {truth}{keyframes}\
    <label><input type=\"checkbox\" data-show=\"loops\" checked> loops closed</label>\
    {joins}\
    <label><input type=\"checkbox\" data-show=\"refused\"> loops not closed</label>\
    <label><input type=\"checkbox\" data-show=\"backs\"> walls from behind</label>\
    <button type=\"button\" data-do=\"whole\">whole map</button>\
    <button type=\"button\" data-do=\"above\">from above</button>\
    <button type=\"button\" data-do=\"camera\">through the camera</button>\
    <span class=\"ramp\" hidden><i></i><b></b></span></div>";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_and_a_reason_are_told_in_words() {
        let nothing = ReportScene::default().html();
        assert!(nothing.contains("The map is empty") && !nothing.contains("<canvas"), "{nothing}");
        let gone =
            ReportScene { no_map: Some("the store <x> is gone".into()), ..ReportScene::default() }.html();
        assert!(gone.contains("No map: the store &lt;x&gt; is gone"), "{gone}");
        let frames = vec![SceneFrame::default()];
        let lost = ReportScene { frames, parts: vec![ScenePart::default()], ..ReportScene::default() }.html();
        assert!(lost.contains("The map is empty") && lost.contains("<canvas"), "{lost}");
    }

    #[test]
    fn submaps_that_are_apart_are_told() {
        let parts = vec![ScenePart::default(), ScenePart { name: "submap 3".into(), ..ScenePart::default() }];
        let scene = ReportScene { parts, frames: vec![SceneFrame::default()], ..ReportScene::default() };
        let html = scene.html();
        assert!(html.contains("2 maps that could not be joined") && html.contains("submap 3"), "{html}");
    }

    #[test]
    fn joins_and_submaps_have_their_switches_where_there_are_any() {
        let of = |submaps: [usize; 2], verdict| {
            let pair = SceneLoop { ends_m: [[0.0; 3]; 2], submaps, verdict };
            let submap = |name: &str| SceneSubmap { name: name.into(), part: 0 };
            let submaps = vec![submap("submap 0"), submap("submap <2>")];
            let scene = ReportScene { loops: vec![pair], submaps, ..ReportScene::default() };
            ReportScene { frames: vec![SceneFrame::default()], ..scene }.html()
        };
        let joined = of([0, 1], ReportedVerdict::Accepted);
        assert!(joined.contains("data-show=\"joins\" checked> joins"), "{joined}");
        assert!(joined.contains("data-submap=\"1\" checked> submap &lt;2&gt;"), "{joined}");
        for none in [of([1, 1], ReportedVerdict::Accepted), of([0, 1], ReportedVerdict::Refused)] {
            assert!(!none.contains("data-show=\"joins\""), "{none}");
        }
    }

    #[test]
    fn the_largest_scene_takes_less_than_two_megabytes() {
        let n = 100_000;
        let scene = ReportScene {
            parts: vec![ScenePart::default()],
            points: vec![ScenePoint::default(); MOST_POINTS],
            frames: vec![SceneFrame::default(); n],
            keyframes: vec![SceneKeyframe::default(); n],
            loops: vec![
                SceneLoop {
                    ends_m: [[0.0; 3]; 2],
                    submaps: [0; 2],
                    verdict: ReportedVerdict::Accepted
                };
                n
            ],
            truth_m: vec![[0.0; 3]; n],
            ..ReportScene::default()
        };
        let bytes = scene.html().len() + VIEWER.len();
        assert!((1_000_000..2_000_000).contains(&bytes), "{bytes}");
    }

    #[test]
    fn the_script_loads_nothing_and_ends_where_it_ends() {
        for word in ["http", "fetch", "import ", "XMLHttp", "</script", "eval"] {
            assert!(!VIEWER.contains(word), "{word}");
        }
    }
}
