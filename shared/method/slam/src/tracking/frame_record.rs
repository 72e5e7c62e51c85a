//! From an alignment to the record of its frame.

use crate::map::cause::Cause;
use crate::map::records::{
    BlockRecord, EvidenceRecord, FrameRecord, KeyframeRecord, MapChange, PoseRecord, State,
};
use crate::pairs::noise_evidence::{self, FrameEvidence, PairEvidence};
use crate::tracking::alignment::Aligner;
use crate::tracking::covariance;
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use crate::tracking::window::{Member, pose_and_velocity};
use crate::tracking::window_alignment::WindowAlignment;
use tessera_geometry::{Matrix6, Pose, PoseBits, upper_triangle};
use tessera_graph::{PairBlock, Quadratic, entropy_of_covariance, metric_covariance};

/// The record of an accepted alignment.
pub(crate) fn frame_record(
    input: &TrackingInput<'_>,
    aligner: &Aligner,
    aligned: &WindowAlignment,
    new_keyframe: Option<KeyframeRecord>,
) -> FrameRecord {
    let a = &aligned.alignment;
    let own = metric_covariance(&a.information, aligner.metric_factor(input.context));
    let covariance = own.map_or(Vec::new(), |own| {
        let own = covariance::of_world(&input.map, aligned, &own, input.context, input.frame);
        // As it is written down.
        upper_triangle(&own).into_iter().map(|v| f64::from(v as f32)).collect()
    });
    let makes_keyframe = new_keyframe.is_some();
    let mut evidence = noise(input, aligner, aligned, makes_keyframe);
    if let (Some(evidence), Some(own), true) = (&mut evidence, own, a.degenerate.is_empty()) {
        evidence.noise.step_variance = Some(std::array::from_fn(|k| own[(k, k)]));
    }
    let record = record_at(input, &a.world_from_camera);
    FrameRecord {
        state: aligned.state,
        evidence_nats: aligned.evidence_nats,
        causes: causes(aligned),
        pose: PoseRecord {
            covariance,
            n_correspondences: a.n_matches(),
            velocity: a.velocity.to_vector().into(),
            entropy_nats: entropy(input, aligner, aligned).unwrap_or(f64::NAN),
            ..record.pose
        },
        evidence: EvidenceRecord {
            noise: evidence.as_ref().map(|evidence| evidence.noise),
            colour_pose: evidence.and_then(|evidence| evidence.colour),
            readout: a.readout.filter(|_| makes_keyframe),
            blocks: blocks(aligned),
            ..record.evidence
        },
        change: MapChange { new_keyframe, ..MapChange::default() },
        ..record
    }
}

/// The record of the first frame of a submap, from which the map is seen: the origin of its gauge and its
/// first keyframe.
pub(crate) fn first_record(
    input: &TrackingInput<'_>,
    prediction: &Prediction,
    causes: Vec<Cause>,
) -> FrameRecord {
    let frame = input.frame;
    let id = input.map.n_keyframes() as u32;
    let pose = PoseBits::from(&prediction.world_from_camera);
    let place = input.ferns.code(&frame.surface);
    let keyframe = KeyframeRecord::new(id, (frame.index, frame.stamp_nanos), pose, place);
    let record = record_at(input, &prediction.world_from_camera);
    FrameRecord {
        state: State::Tracking,
        causes,
        pose: PoseRecord {
            keyframe: id,
            keyframe_from_camera: PoseBits::IDENTITY,
            covariance: upper_triangle(&Matrix6::zeros()),
            ..record.pose
        },
        change: MapChange { new_keyframe: Some(keyframe), ..MapChange::default() },
        ..record
    }
}

/// The record of a frame that could not be aligned: it holds the prediction and changes nothing.
pub(crate) fn lost_record(
    input: &TrackingInput<'_>,
    prediction: &Prediction,
    causes: Vec<Cause>,
) -> FrameRecord {
    FrameRecord { causes, ..record_at(input, &prediction.world_from_camera) }
}

/// The identity of the frame and its pose; all else as of a lost frame.
fn record_at(input: &TrackingInput<'_>, world_from_camera: &Pose) -> FrameRecord {
    let frame = input.frame;
    let keyframe = input.map.last_keyframe();
    let world_from_keyframe = keyframe.map_or(Pose::identity(), |k| Pose::from(&k.world_from_camera));
    FrameRecord {
        index: frame.index,
        stamp_nanos: frame.stamp_nanos,
        workload: frame.workload,
        state: State::Lost,
        submap: input.map.submap(),
        pose: PoseRecord {
            world_from_camera: PoseBits::from(world_from_camera),
            world_from_odom: input.map.state().world_from_odom.unwrap_or(PoseBits::IDENTITY),
            // None before the first one.
            keyframe: keyframe.map_or(u32::MAX, |k| k.id),
            keyframe_from_camera: PoseBits::from(&(world_from_keyframe.inverse() * world_from_camera)),
            rotation: frame.rotation,
            ..PoseRecord::default()
        },
        evidence: EvidenceRecord { up: frame.up, ..EvidenceRecord::default() },
        ..FrameRecord::default()
    }
}

/// The alignment's causes, and its degenerate directions.
fn causes(aligned: &WindowAlignment) -> Vec<Cause> {
    let mut causes = aligned.causes.clone();
    let motions: Vec<_> = aligned.alignment.degenerate.iter().map(|direction| direction.motion).collect();
    if !motions.is_empty() {
        causes.push(Cause::Degenerate(motions));
    }
    causes
}

/// Sums of the matches with each keyframe of the window.
fn blocks(aligned: &WindowAlignment) -> Vec<BlockRecord> {
    let pairs = aligned.members.iter().zip(&aligned.alignment.blocks);
    let block = |(member, (origin, sums)): (&Member, &(Pose, tessera_graph::BlockSums))| match member {
        Member::Keyframe(keyframe) => Some(BlockRecord {
            keyframe: *keyframe,
            keyframe_from_camera: PoseBits::from(origin).to_single(),
            cost: Quadratic::of(origin, sums).to_numbers(),
            n_matches: sums.n,
        }),
        Member::Recent(_) => None,
    };
    pairs.filter_map(block).collect()
}

/// Evidence of the noise scales, from each reference.
fn noise(
    input: &TrackingInput<'_>,
    aligner: &Aligner,
    aligned: &WindowAlignment,
    makes_keyframe: bool,
) -> Option<FrameEvidence> {
    let a = &aligned.alignment;
    let members = aligned.members.iter().zip(&a.blocks).zip(&a.parts);
    let pairs = members.filter_map(|((member, (origin, _)), (surfaces, features))| {
        let (pose, velocity) = pose_and_velocity(&input.map, member)?;
        Some(PairEvidence {
            target_from_query: pose.inverse() * a.world_from_camera,
            velocities: [a.velocity, velocity],
            surfaces: (origin, surfaces),
            // Colour that is not trusted measures nothing.
            features: features.as_ref().filter(|_| input.context.is_colour_trusted),
        })
    });
    let colour = makes_keyframe.then_some(&input.context.colour);
    noise_evidence::evidence(pairs, aligner.independent_factor(), &input.context.scales, colour)
}

/// Entropy of the pose relative to the last keyframe, nats (eq. 14); `None` where that is not in
/// the window.
fn entropy(input: &TrackingInput<'_>, aligner: &Aligner, aligned: &WindowAlignment) -> Option<f64> {
    let keyframe = input.map.last_keyframe()?;
    let place = aligned.members.iter().position(|m| *m == Member::Keyframe(keyframe.id))?;
    let (origin, sums) = &aligned.alignment.blocks[place];
    let world_from_keyframe = Pose::from(&keyframe.world_from_camera);
    let keyframe_from_camera = world_from_keyframe.inverse() * aligned.alignment.world_from_camera;
    let information = PairBlock::new(origin, sums).linearise(&keyframe_from_camera).0;
    entropy_of_covariance(&information, aligner.independent_factor())
}
