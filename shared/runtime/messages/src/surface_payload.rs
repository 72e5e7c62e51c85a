//! The payload of a surface message, and of a keyframe in the store: the vertices of the grid, row
//! by row, and behind them the features of the frame's colour image, packed into whole vertices.

use crate::message::Refusal;
use tessera_features::Feature;
use tessera_surface::Vertex;

/// Most features of a frame that a message has room for.
pub const MAX_FEATURES: usize = 1000;

/// Vertices that hold `n_features` features.
pub const fn vertices_of_features(n_features: usize) -> usize {
    n_features.saturating_mul(size_of::<Feature>()).div_ceil(size_of::<Vertex>())
}

/// Writes features into the vertices behind the grid; what is left over is zero.
///
/// # Panics
/// Where `tail` is shorter than [`vertices_of_features`].
pub fn write_features(tail: &mut [Vertex], features: &[Feature]) {
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(tail);
    let (filled, rest) = bytes.split_at_mut(size_of_val(features));
    filled.copy_from_slice(bytemuck::cast_slice(features));
    rest.fill(0);
}

/// The features behind the `n_vertices` vertices of a payload: a copy, since a message is not
/// aligned for their descriptors.
pub fn read_features(payload: &[Vertex], n_vertices: usize) -> Vec<Feature> {
    let tail: &[u8] = bytemuck::cast_slice(payload.get(n_vertices..).unwrap_or_default());
    tail.chunks_exact(size_of::<Feature>()).map(bytemuck::pod_read_unaligned).collect()
}

/// Checks features that came from outside this process.
///
/// # Errors
/// A [`Refusal`] that names the frame and what is wrong.
pub(crate) fn check_features(index: u64, features: &[Feature]) -> Result<(), Refusal> {
    let is_sound = |f: &Feature| {
        let numbers = [f.pixel[0], f.pixel[1], f.angle_rad, f.response, f.sigma_px];
        numbers.iter().all(|number| number.is_finite()) && f.sigma_px > 0.0 && f.level < 16
    };
    if features.iter().all(is_sound) {
        return Ok(());
    }
    Err(Refusal::Value {
        index,
        what: "a feature",
        found: "not finite or of an unknown level".into(),
        rule: "finite numbers, a positive deviation and a level below 16 in every feature",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_come_back_from_behind_the_vertices() {
        for n in [0, 1, 3, 7] {
            let features: Vec<Feature> = (0..n)
                .map(|k| Feature {
                    pixel: [k as f32, 2.0],
                    descriptor: [k; 4],
                    sigma_px: 1.0,
                    ..Feature::default()
                })
                .collect();
            let mut payload = vec![Vertex::default(); 5 + vertices_of_features(features.len())];
            write_features(&mut payload[5..], &features);
            assert_eq!(read_features(&payload, 5), features, "{n}");
        }
        assert!(read_features(&[], 5).is_empty());
    }

    #[test]
    fn broken_features_are_refused() {
        let good = Feature { sigma_px: 1.0, ..Feature::default() };
        assert_eq!(check_features(3, &[good]), Ok(()));
        for bad in [
            Feature { pixel: [f32::NAN, 0.0], ..good },
            Feature { sigma_px: 0.0, ..good },
            Feature { level: 200, ..good },
        ] {
            assert!(check_features(3, &[good, bad]).unwrap_err().to_string().contains("frame 3"));
        }
    }
}
