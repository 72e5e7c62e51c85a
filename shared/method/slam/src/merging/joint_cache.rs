//! What joint maps of the same runs have in common, from one map to the next.
//!
//! All of it is a function of keyframes with their numbers in the map, so that it makes no difference what is
//! kept and what is found anew: keyframes of runs that came first and have not grown are known again.

use crate::estimation::colour_model::ColourModel;
use crate::map::state::KeyframeState;
use crate::merging::known_looks::identity;
use crate::merging::meeting::KnownMeetings;
use crate::optimise::sample_cache::Drawn;
use crate::pairs::feature_cache::FeatureCache;

/// What is kept of a joint map for the next one, which must have the same settings.
#[derive(Debug, Default)]
pub struct JointCache {
    /// What each number stood for.
    identities: Vec<u64>,
    /// How colour of each run lay, where they have several cameras.
    colours: Vec<Option<ColourModel>>,
    pub(crate) meetings: KnownMeetings,
    pub(crate) drawn: Drawn,
    pub(crate) features: FeatureCache,
}

impl JointCache {
    /// A map of these keyframes begins: what other keyframes had under their numbers is forgotten.
    pub(crate) fn begin(&mut self, keyframes: &[KeyframeState], colours: Vec<Option<ColourModel>>) {
        if self.colours != colours {
            (self.features, self.colours) = (FeatureCache::default(), colours);
        }
        let identities: Vec<u64> = keyframes.iter().map(identity).collect();
        let both = identities.iter().zip(&self.identities);
        let same: Vec<u32> = (0..).zip(both).filter(|(_, (a, b))| a == b).map(|(id, _)| id).collect();
        self.drawn.keep_only(&same);
        self.features.keep_only(&same);
        self.identities = identities;
    }

    /// Keyframes of the last map that were looked for among other runs', and those of which the outcome was
    /// known from the map before it.
    pub fn looks(&self) -> (usize, usize) {
        self.meetings.seen.counts()
    }
}
