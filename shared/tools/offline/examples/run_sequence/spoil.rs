//! Faults that are planted in the frames of a sequence.

use std::error::Error;
use tessera_evaluation::Trajectory;
use tessera_offline::RawFrame;

/// Turns time round: the last frame comes first, and the truth goes along.
pub(super) fn reverse(frames: &mut [RawFrame], truth: Option<&mut Trajectory>) {
    let both_ends = |first: Option<i64>, last: Option<i64>| first.unwrap_or(0) + last.unwrap_or(0);
    let sum = both_ends(frames.first().map(|f| f.stamp_nanos), frames.last().map(|f| f.stamp_nanos));
    frames.reverse();
    frames.iter_mut().for_each(|f| f.stamp_nanos = sum - f.stamp_nanos);
    if let Some(truth) = truth {
        truth.stamps_nanos.reverse();
        truth.poses.reverse();
        truth.stamps_nanos.iter_mut().for_each(|stamp| *stamp = sum - *stamp);
    }
}

/// The sequence there and back in turn, so many passes in all: a long recording of what a short one shows, with its
/// truth.
pub(super) fn there_and_back(frames: &mut Vec<RawFrame>, truth: Option<&mut Trajectory>, n_passes: usize) {
    let (Some(first), Some(last)) = (frames.first(), frames.last()) else { return };
    let (begin, end) = (first.stamp_nanos, last.stamp_nanos);
    let span = end - begin + (end - begin) / frames.len() as i64;
    let stamp = |pass: usize, stamp: i64| {
        let within = if pass.is_multiple_of(2) { stamp } else { begin + end - stamp };
        within + pass as i64 * span
    };
    let once = frames.clone();
    for pass in 1..n_passes {
        let mut again = once.clone();
        again.iter_mut().for_each(|frame| frame.stamp_nanos = stamp(pass, frame.stamp_nanos));
        again.sort_by_key(|frame| frame.stamp_nanos);
        frames.extend(again);
    }
    let Some(truth) = truth else { return };
    let rows = truth.stamps_nanos.iter().copied().zip(truth.poses.iter().copied());
    let once: Vec<_> = rows.filter(|(at, _)| (begin..=end).contains(at)).collect();
    let mut all: Vec<_> =
        (0..n_passes).flat_map(|pass| once.iter().map(move |(at, pose)| (stamp(pass, *at), *pose))).collect();
    all.sort_by_key(|(at, _)| *at);
    (truth.stamps_nanos, truth.poses) = all.into_iter().unzip();
}

/// Takes the depth of a share of all pixels away: the same pixels on each run.
pub(super) fn pierce(frames: &mut [RawFrame], share: f64) {
    let limit = (share * 2f64.powi(32)) as u64;
    // Numerical Recipes' linear congruential generator; its high bits are even enough.
    let mut state = 1u64;
    let mut is_hole = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        state >> 32 < limit
    };
    let depth = frames.iter_mut().flat_map(|frame| &mut frame.depth);
    depth.for_each(|depth| *depth = if is_hole() { 0 } else { *depth });
}

/// Plants a fault in all colour images: `off`, `frozen` (the first for all), `late` (of ten frames
/// before), `foreign` (of frames far away in time), `dark` (a 64th), `dim` (half), `halved` (every second image repeated
/// for two seconds), `noise`, or `blurred` (along the rows).
pub(super) fn spoil_colour(
    frames: &mut [RawFrame],
    fault: Option<&str>,
    width: usize,
) -> Result<(), Box<dyn Error>> {
    let Some(fault) = fault else { return Ok(()) };
    let images: Vec<Option<Vec<u8>>> = frames.iter().map(|frame| frame.colour.clone()).collect();
    let mut state = 1u64;
    let mut byte = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 56) as u8
    };
    for (k, frame) in frames.iter_mut().enumerate() {
        frame.colour = match fault {
            "off" => None,
            "frozen" => images[0].clone(),
            "late" => images[k.saturating_sub(10)].clone(),
            "foreign" => images[(k * 37 + images.len() / 2) % images.len()].clone(),
            "dark" => images[k].as_ref().map(|image| image.iter().map(|b| b / 64).collect()),
            // Half the rate from a third of the sequence on for two seconds at 30 Hz, as a camera in the dark.
            "halved" if (images.len() / 3..images.len() / 3 + 60).contains(&k) => images[k - k % 2].clone(),
            "halved" => images[k].clone(),
            "dim" => images[k].as_ref().map(|image| image.iter().map(|b| b / 2).collect()),
            "blurred" => images[k].as_deref().map(|image| blurred(image, width)),
            "noise" => images[k].as_ref().map(|image| image.iter().map(|_| byte()).collect()),
            other => {
                return Err(format!(
                    "--colour is {other}, expected off, frozen, late, foreign, dark, dim, halved, noise or blurred"
                )
                .into());
            }
        };
    }
    Ok(())
}

/// Each pixel the mean of those within 12 px in its row.
fn blurred(image: &[u8], width: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(image.len());
    for row in image.chunks_exact(3 * width) {
        for column in 0..width {
            let span = column.saturating_sub(12)..(column + 13).min(width);
            let sum = |c: usize| span.clone().map(|k| u32::from(row[3 * k + c])).sum::<u32>();
            out.extend((0..3).map(|c| (sum(c) / span.len() as u32) as u8));
        }
    }
    out
}
