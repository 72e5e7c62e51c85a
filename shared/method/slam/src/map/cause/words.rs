//! Causes in words.

use crate::map::cause::{CandidatePlace, Cause, DegenerateMotion, Levelling, MotionKind, ReferenceFit};
use std::fmt::{Display, Formatter, Result};

/// Parts with a separator between them.
pub(in crate::map) fn joined<T: Display>(parts: &[T]) -> String {
    parts.iter().map(T::to_string).collect::<Vec<_>>().join("; ")
}

impl Display for Cause {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::RelocalisationAsked => f.write_str("a relocalisation was asked for"),
            Self::FirstFrame(None) => f.write_str("the first frame"),
            Self::FirstFrame(Some(levelling)) => write!(f, "the first frame; {levelling}"),
            Self::SubmapBegins(submap, None) => write!(f, "submap {submap} begins"),
            Self::SubmapBegins(submap, Some(levelling)) => write!(f, "submap {submap} begins, {levelling}"),
            Self::TooFewPoints { n_points, least } => {
                write!(f, "{n_points} usable points, at least {least} are needed")
            }
            Self::Unsolved => f.write_str("the normal equations could not be solved"),
            Self::FewMatches { share, least } => {
                let [share, least] = [share, least].map(|v| 100.0 * v);
                write!(f, "{share:.1} % of the queries have a match, at least {least:.1} % are needed")
            }
            Self::LargeResidual { sigmas, most } => {
                write!(f, "median residual is {sigmas:.2} standard deviations, at most {most:.2} are allowed")
            }
            Self::LowSupport { fit, least_matched, most_in_front } => {
                let [least, most] = [least_matched, most_in_front].map(|v| 100.0 * v);
                write!(f, "{fit}; at least {least:.0} % matched and at most {most:.0} % in front are needed")
            }
            Self::NotStrict(fit) => fit.fmt(f),
            Self::NoKeyframe => f.write_str("no keyframe is at hand"),
            Self::PlaceRefuted(nats) => write!(f, "the place that was found is refuted: {nats:.1} nats"),
            Self::LostFor(n_frames) => write!(f, "lost for {n_frames} frames"),
            Self::NotFoundFor(n_frames) => write!(f, "not found in the map for {n_frames} frames"),
            Self::NoPlaceFits(n) => write!(f, "none of {n} candidate places fits"),
            Self::Found(place, fit) => write!(f, "found by {place}: {fit}"),
            Self::Confirmed { sum_nats, bound_nats } => {
                write!(f, "confirmed by {sum_nats:.1} of {bound_nats:.1} nats")
            }
            Self::Degenerate(motions) => {
                write!(f, "degenerate, held by the prediction: {}", joined(motions))
            }
            Self::Joined { moved, kept, evidence_nats, overlap, in_front } => {
                let [overlap, in_front] = [overlap, in_front].map(|v| 100.0 * v);
                write!(f, "submap {moved} is joined to {kept}: {evidence_nats:.1} nats, ")?;
                write!(f, "{overlap:.0} % overlap, {in_front:.1} % in front")
            }
            Self::JoinRefused { moved, kept } => {
                write!(f, "submap {moved} is not joined to {kept}: both saw what contradicts it")
            }
            Self::Departure { submap, first, since, nats } => {
                write!(f, "submap {submap} begins with keyframe {first}: since keyframe {since} ")?;
                write!(f, "views of long ago contradict the map by {nats:.1} nats")
            }
            Self::Recorded { words, .. } => f.write_str(words),
        }
    }
}

impl Display for Levelling {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let (by, sigma_rad) = match self {
            Self::Gravity(sigma_rad) => ("gravity", sigma_rad),
            Self::Floor(sigma_rad) => ("the floor", sigma_rad),
            Self::Failed => {
                return f.write_str("not levelled: gravity was not measured, and no floor is seen");
            }
        };
        write!(f, "levelled by {by}, within {:.1} deg", sigma_rad.to_degrees())
    }
}

impl Display for ReferenceFit {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let [in_view, matched, in_front] = [self.in_view, self.matched, self.in_front].map(|v| 100.0 * v);
        write!(f, "{in_view:.0} % of the frame in view, {matched:.0} % within its surface matched, ")?;
        write!(f, "{in_front:.1} % in front, median residual {:.2} sigma", self.residual_sigmas)?;
        self.n_agreeing.map_or(Ok(()), |n| write!(f, ", {n} features agree"))
    }
}

impl Display for CandidatePlace {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::LastPose => f.write_str("the last pose"),
            Self::Start => f.write_str("the start"),
            Self::Features { n, keyframe } => write!(f, "{n} features of keyframe {keyframe}"),
            Self::Similar { keyframe, similarity } => {
                write!(f, "recognising keyframe {keyframe} (similarity {similarity:.2})")
            }
        }
    }
}

impl Display for DegenerateMotion {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let ([x, y, z], sigma) = (self.axis, self.sigma);
        match self.kind {
            MotionKind::Translation => {
                write!(f, "translation along ({x:.2} {y:.2} {z:.2}), sigma {sigma:.3} m")
            }
            MotionKind::Rotation => {
                let sigma_deg = sigma.to_degrees();
                write!(f, "rotation about ({x:.2} {y:.2} {z:.2}), sigma {sigma_deg:.2} deg")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_are_those_that_users_read() {
        let fit = ReferenceFit {
            in_view: 0.98,
            matched: 0.456,
            in_front: 0.0123,
            residual_sigmas: 0.196,
            n_agreeing: None,
        };
        let motion = |kind, sigma| DegenerateMotion { kind, axis: [0.0, -0.125, 0.999], sigma };
        let motions = vec![motion(MotionKind::Translation, 0.0456), motion(MotionKind::Rotation, 0.1)];
        let check = |causes: &[Cause], expected: &str| assert_eq!(joined(causes), expected);
        check(&[], "");
        check(
            &[Cause::RelocalisationAsked, Cause::LostFor(3), Cause::NoPlaceFits(4)],
            "a relocalisation was asked for; lost for 3 frames; none of 4 candidate places fits",
        );
        check(
            &[Cause::FirstFrame(Some(Levelling::Floor(0.02)))],
            "the first frame; levelled by the floor, within 1.1 deg",
        );
        check(
            &[Cause::NotFoundFor(9), Cause::SubmapBegins(1, Some(Levelling::Failed))],
            "not found in the map for 9 frames; submap 1 begins, not levelled: gravity was not measured, and no \
             floor is seen",
        );
        check(
            &[Cause::LowSupport { fit, least_matched: 0.5, most_in_front: 0.25 }],
            "98 % of the frame in view, 46 % within its surface matched, 1.2 % in front, median residual 0.20 \
             sigma; at least 50 % matched and at most 25 % in front are needed",
        );
        check(
            &[
                Cause::LargeResidual { sigmas: 2.346, most: 2.0 },
                Cause::Found(
                    CandidatePlace::Similar { keyframe: 2, similarity: 0.678 },
                    ReferenceFit { n_agreeing: Some(31), ..fit },
                ),
                Cause::Confirmed { sum_nats: 12.04, bound_nats: 13.8 },
                Cause::Degenerate(motions),
            ],
            "median residual is 2.35 standard deviations, at most 2.00 are allowed; found by recognising keyframe \
             2 (similarity 0.68): 98 % of the frame in view, 46 % within its surface matched, 1.2 % in front, \
             median residual 0.20 sigma, 31 features agree; confirmed by 12.0 of 13.8 nats; degenerate, held by \
             the prediction: translation along (0.00 -0.12 1.00), sigma 0.046 m; rotation about (0.00 -0.12 1.00), sigma 5.73 deg",
        );
        check(
            &[
                Cause::Joined { moved: 2, kept: 0, evidence_nats: 14.25, overlap: 0.7, in_front: 0.0 },
                Cause::JoinRefused { moved: 2, kept: 1 },
                Cause::Departure { submap: 3, first: 12, since: 10, nats: 6.25 },
            ],
            "submap 2 is joined to 0: 14.2 nats, 70 % overlap, 0.0 % in front; submap 2 is not joined to 1: both \
             saw what contradicts it; submap 3 begins with keyframe 12: since keyframe 10 views of long ago \
             contradict the map by 6.2 nats",
        );
    }
}
