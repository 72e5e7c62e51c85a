//! Median time of extraction, matching and pose over the images of a folder, milliseconds a frame on
//! one core: `cargo run --release -p tessera-features --example time_features -- FOLDER [N_IMAGES]`.

use std::time::Instant;
use tessera_features::{
    Correspondence, ExtractWorkspace, Feature, FeatureSettings, Gate, MatchSettings, MatchWorkspace,
    Observation, Picture, PointEstimate, PoseSettings, PoseWorkspace, estimate_pose, extract, match_features,
};

/// Repetitions of each step, of which the fastest counts.
const REPETITIONS: usize = 5;

/// Radius of the gates.
const GATE_PX: f32 = 40.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("expected a folder of images")?;
    let n_images: usize = arguments.next().map_or(Ok(50), |n| n.parse())?;
    let mut paths: Vec<_> =
        std::fs::read_dir(folder)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
    paths.sort();
    let step = (paths.len() / n_images.max(1)).max(1);
    let (settings, mut workspace) = (FeatureSettings::default(), ExtractWorkspace::new(pulp::Arch::new()));
    let mut matching = MatchWorkspace::new(pulp::Arch::new());
    let mut estimation = PoseWorkspace::new(pulp::Arch::new());
    let mut times: [Vec<f64>; 4] = Default::default();
    let (mut n_features, mut n_matches, mut n_inliers) = (0, 0, 0);
    let mut last: Vec<Feature> = Vec::new();
    for path in paths.iter().step_by(step) {
        let image = image::open(path)?.to_rgb8();
        let picture = Picture::rgb(image.width() as usize, image.height() as usize, &image)?;
        let (ms, features) = timed(|| extract(&picture, &settings, &mut workspace));
        times[0].push(ms);
        let match_settings = MatchSettings::default();
        let (ms, matches) = timed(|| match_features(&features, &last, None, &match_settings, &mut matching));
        times[1].push(ms);
        let gates: Vec<Gate> = features.iter().map(|f| Gate { pixel: f.pixel, radius_px: GATE_PX }).collect();
        let (ms, _) =
            timed(|| match_features(&features, &last, Some(&gates), &match_settings, &mut matching));
        times[2].push(ms);
        // All points 2 m away: the pose means nothing, its cost does.
        let observe = |f: &Feature| {
            let ray = [(f64::from(f.pixel[1]) - 320.0) / 525.0, (f64::from(f.pixel[0]) - 240.0) / 525.0];
            let ray_sigma = f64::from(f.sigma_px) / 525.0;
            let point = Some(PointEstimate::on_ray(ray, ray_sigma, 2.0, 0.02));
            Observation { ray, ray_sigma, point }
        };
        let correspondences: Vec<Correspondence> = matches
            .iter()
            .map(|m| Correspondence {
                query: observe(&features[m.query as usize]),
                target: observe(&last[m.target as usize]),
            })
            .collect();
        let (ms, estimate) =
            timed(|| estimate_pose(&correspondences, &[], 1, &PoseSettings::default(), &mut estimation));
        times[3].push(ms);
        n_features += features.len();
        n_matches += matches.len();
        n_inliers += estimate.map_or(0, |estimate| estimate.inliers.len());
        last = features;
    }
    let n = times[0].len();
    println!(
        "{n} images: {} features, {} matches, {} inliers a frame",
        n_features / n,
        n_matches / n,
        n_inliers / n
    );
    for (name, times) in
        ["extract", "match all with all", "match in gates of 40 px", "pose"].into_iter().zip(&mut times)
    {
        times.sort_by(f64::total_cmp);
        println!("{name}: median {:.3} ms, 95 % {:.3} ms", times[n / 2], times[n * 95 / 100]);
    }
    Ok(())
}

fn timed<T>(mut step: impl FnMut() -> T) -> (f64, T) {
    let mut fastest = f64::INFINITY;
    let mut run = || {
        let start = Instant::now();
        let result = step();
        fastest = fastest.min(start.elapsed().as_secs_f64() * 1e3);
        result
    };
    (1..REPETITIONS).for_each(|_| drop(run()));
    let result = run();
    (fastest, result)
}
