//! A scene as text: numbers in columns, each in base64, little-endian.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    clippy::indexing_slicing,
    reason = "numbers cut to the bytes that the page has for them, along three axes"
)]

use super::{
    MOST_FRAMES, MOST_KEYFRAMES, MOST_LOOPS, MOST_SUBMAPS, MOST_TRUTH, ReportScene, ScenePart, SceneRobot,
    SceneSubmap,
};
use crate::run::{FrameState, ReportedVerdict};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use tessera_outputs::html::escaped;

/// Steps of a coordinate over the box of all points.
const STEPS: f64 = 65_535.0;

/// Every k-th of n with the smallest k that leaves at most `most`: how many those are.
pub(super) fn every(n: usize, most: usize) -> usize {
    n.div_ceil(stride(n, most))
}

fn stride(n: usize, most: usize) -> usize {
    n.div_ceil(most).max(1)
}

/// The whole scene as JSON. No `<` can appear in it.
pub(super) fn json(scene: &ReportScene) -> String {
    let (low, size) = bounds(scene);
    let parts: Vec<String> = scene.parts.iter().map(part).collect();
    format!(
        "{{\"parts\":[{}],\"submaps\":[{}],\"robots\":[{}],\"voxel_m\":{},\"low\":{},\"size\":{},\"points\":{},\"frames\":{},\"keyframes\":{},\"loops\":{},\"truth\":\"{}\"}}",
        parts.join(","),
        submaps(scene),
        robots(scene),
        number(scene.voxel_m),
        numbers(&low),
        numbers(&size),
        points(scene, &low, &size),
        frames(scene),
        keyframes(scene),
        loops(scene),
        floats(thin(&scene.truth_m, MOST_TRUTH).flatten().copied())
    )
}

fn thin<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> {
    all.iter().step_by(stride(all.len(), most))
}

/// Corner and edges of the box that holds all points.
fn bounds(scene: &ReportScene) -> ([f64; 3], [f64; 3]) {
    let axis = |k: usize| {
        let values = scene.points.iter().map(|point| point.position_m[k]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ranges = [0, 1, 2].map(axis);
    if scene.points.is_empty() {
        return ([0.0; 3], [1.0; 3]);
    }
    (ranges.map(|(low, _)| low), ranges.map(|(low, high)| high - low))
}

fn part(part: &ScenePart) -> String {
    // Names are our own words; escaped all the same, so that none can end the element.
    let name = escaped(&part.name).replace('\\', "");
    let rows: Vec<String> = part.page_from_world.iter().map(|row| numbers(row)).collect();
    format!(
        "{{\"name\":\"{name}\",\"label\":{},\"page_from_world\":[{}],\"n_points\":{}}}",
        numbers(&part.label_m),
        rows.join(","),
        part.n_points
    )
}

fn submaps(scene: &ReportScene) -> String {
    // Their names stand beside what switches them.
    let submap = |submap: &SceneSubmap| format!("{{\"part\":{}}}", submap.part);
    scene.submaps.iter().map(submap).collect::<Vec<_>>().join(",")
}

/// A place in the list of submaps.
fn place(submap: usize) -> u8 {
    submap.min(MOST_SUBMAPS) as u8
}

fn robots(scene: &ReportScene) -> String {
    // Of names that others gave, nothing that could end the element or the word.
    let word = |name: &str| escaped(name).replace(['\\', '\n', '\r'], " ");
    let robot = |robot: &SceneRobot| {
        format!("{{\"name\":\"{}\",\"rgb\":{}}}", word(&robot.name), numbers(&robot.rgb.map(f64::from)))
    };
    scene.robots.iter().map(robot).collect::<Vec<_>>().join(",")
}

fn points(scene: &ReportScene, low: &[f64; 3], size: &[f64; 3]) -> String {
    let points = || scene.points.iter();
    let step = |k: usize, v: f64| if size[k] > 0.0 { (STEPS * (v - low[k]) / size[k]).round() } else { 0.0 };
    let positions = points().flat_map(|p| [0, 1, 2].map(|k| step(k, p.position_m[k]) as u16));
    let stride = stride(scene.keyframes.len(), MOST_KEYFRAMES);
    let keyframes = points().map(|p| (p.keyframe / stride).min(usize::from(u16::MAX)) as u16);
    format!(
        "{{\"position\":\"{}\",\"normal\":\"{}\",\"rgb\":\"{}\",\"keyframe\":\"{}\"}}",
        base64(positions.flat_map(u16::to_le_bytes)),
        base64(points().flat_map(|p| octahedral(&p.normal)).map(|v| v as u8)),
        base64(points().flat_map(|p| p.rgb)),
        base64(keyframes.flat_map(u16::to_le_bytes))
    )
}

/// A direction in two bytes: projected on an octahedron, whose lower half is folded over the upper one
/// (Cigolle et al., JCGT 2014).
fn octahedral(normal: &[f64; 3]) -> [i8; 2] {
    let [x, y, z] = *normal;
    let sum = x.abs() + y.abs() + z.abs();
    if !(sum > 0.0) {
        return [0, 0];
    }
    let (u, v) = (x / sum, y / sum);
    let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
    let (u, v) = if z < 0.0 { ((1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)) } else { (u, v) };
    [(127.0 * u).round() as i8, (127.0 * v).round() as i8]
}

fn frames(scene: &ReportScene) -> String {
    let frames = || thin(&scene.frames, MOST_FRAMES);
    format!(
        "{{\"index\":\"{}\",\"time_s\":\"{}\",\"state\":\"{}\",\"part\":\"{}\",\"submap\":\"{}\",\"robot\":\"{}\",\"position\":\"{}\",\"rotation\":\"{}\",\"std_m\":\"{}\"}}",
        base64(frames().flat_map(|f| u32::try_from(f.index).unwrap_or(u32::MAX).to_le_bytes())),
        floats(frames().map(|f| f.time_s)),
        base64(frames().map(|f| state(f.state))),
        base64(frames().map(|f| f.part.min(255) as u8)),
        base64(frames().map(|f| place(f.submap))),
        base64(frames().map(|f| f.robot.min(255) as u8)),
        floats(frames().flat_map(|f| f.position_m)),
        base64(
            frames()
                .flat_map(|f| f.rotation.map(|v| (32_767.0 * v).round() as i16))
                .flat_map(i16::to_le_bytes)
        ),
        floats(frames().map(|f| f.std_m.unwrap_or(f64::NAN)))
    )
}

/// As `viewer.js` counts states.
fn state(state: FrameState) -> u8 {
    match state {
        FrameState::Tracking => 0,
        FrameState::Lost => 1,
        FrameState::Relocalising => 2,
        FrameState::Dropped => 3,
    }
}

fn keyframes(scene: &ReportScene) -> String {
    let keyframes = || thin(&scene.keyframes, MOST_KEYFRAMES);
    format!(
        "{{\"position\":\"{}\",\"submap\":\"{}\",\"of_map\":\"{}\",\"std_m\":\"{}\"}}",
        floats(keyframes().flat_map(|k| k.position_m)),
        base64(keyframes().map(|k| place(k.submap))),
        base64(keyframes().map(|k| u8::from(k.is_of_map))),
        floats(keyframes().map(|k| k.std_m.unwrap_or(f64::NAN)))
    )
}

fn loops(scene: &ReportScene) -> String {
    let loops = || thin(&scene.loops, MOST_LOOPS);
    let verdict = |verdict| match verdict {
        ReportedVerdict::Accepted => 0,
        ReportedVerdict::Untested => 1,
        ReportedVerdict::Refused => 2,
        ReportedVerdict::Outvoted => 3,
    };
    format!(
        "{{\"ends\":\"{}\",\"submap\":\"{}\",\"verdict\":\"{}\"}}",
        floats(loops().flat_map(|l| l.ends_m).flatten()),
        base64(loops().flat_map(|l| l.submaps).map(place)),
        base64(loops().map(|l| verdict(l.verdict)))
    )
}

fn base64(bytes: impl Iterator<Item = u8>) -> String {
    STANDARD.encode(bytes.collect::<Vec<u8>>())
}

fn floats(values: impl Iterator<Item = f64>) -> String {
    base64(values.flat_map(|v| (v as f32).to_le_bytes()))
}

/// A number as JSON has it, which knows no infinity.
fn number(value: f64) -> String {
    if value.is_finite() { format!("{value}") } else { "0".into() }
}

fn numbers(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|v| number(*v)).collect();
    format!("[{}]", words.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{ScenePoint, VIEWER};

    #[test]
    fn positions_are_kept_to_a_step_of_the_box() {
        let point = |x, y, z| ScenePoint { position_m: [x, y, z], ..ScenePoint::default() };
        let points = vec![point(-1.0, 2.0, 5.0), point(3.0, 2.0, 5.5), point(0.1, 2.0, 5.25)];
        let scene = ReportScene { points, ..ReportScene::default() };
        let (low, size) = bounds(&scene);
        assert_eq!((low, size), ([-1.0, 2.0, 5.0], [4.0, 0.0, 0.5]));
        let text = super::points(&scene, &low, &size);
        let column = text.split('"').nth(3).unwrap();
        let bytes = STANDARD.decode(column).unwrap();
        let steps: Vec<u16> = bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        assert_eq!(steps, [0, 0, 0, 65_535, 0, 65_535, 18_022, 0, 32_768]);
    }

    #[test]
    fn directions_come_back_to_a_degree() {
        for k in 0..200 {
            let (a, b) = (0.11 * f64::from(k), 0.37 * f64::from(k));
            let normal = [a.cos() * b.cos(), a.sin() * b.cos(), b.sin()];
            let [u, v] = octahedral(&normal).map(|v| f64::from(v) / 127.0);
            // As the shader of the points unfolds them.
            let z = 1.0 - u.abs() - v.abs();
            let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
            let (x, y) =
                if z < 0.0 { ((1.0 - v.abs()) * sign(u), (1.0 - u.abs()) * sign(v)) } else { (u, v) };
            let length = (x * x + y * y + z * z).sqrt();
            let cosine = (x * normal[0] + y * normal[1] + z * normal[2]) / length;
            assert!(cosine > 1f64.to_radians().cos(), "{normal:?}: {cosine}");
        }
        assert_eq!(octahedral(&[0.0; 3]), [0, 0]);
    }

    #[test]
    fn many_frames_are_thinned_evenly() {
        assert_eq!([every(0, 10), every(10, 10), every(11, 10), every(100, 10)], [0, 10, 6, 10]);
        let all: Vec<usize> = (0..25).collect();
        assert_eq!(thin(&all, 10).copied().collect::<Vec<_>>(), [0, 3, 6, 9, 12, 15, 18, 21, 24]);
    }

    #[test]
    fn the_script_reads_each_column_that_is_written() {
        let robots = vec![SceneRobot { name: "</script>\"\\".into(), rgb: [1, 2, 3] }];
        let text = json(&ReportScene { parts: vec![ScenePart::default()], robots, ..ReportScene::default() });
        let keys = text
            .split('"')
            .filter(|word| !word.is_empty() && word.chars().all(|c| c.is_alphanumeric() || c == '_'));
        // For programs that compare the page with the files of the run.
        for key in keys.filter(|key| !["n_points", "page_from_world", "lt", "script"].contains(key)) {
            assert!(VIEWER.contains(key), "{key}: {text}");
        }
        assert!(!text.contains('<'));
    }
}
