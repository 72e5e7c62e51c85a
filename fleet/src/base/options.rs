//! What a base is asked to do, and what it needs of a network.

use crate::copies::arrivals::CopyForm;
use crate::wire::carrier::RobotCarrier;
use std::path::PathBuf;
use std::time::Duration;

/// Robots of a base at a time, at most.
pub const MAX_ROBOTS: usize = 64;
/// What a base is asked to do.
#[derive(Clone, Debug)]
pub struct BaseOptions {
    /// Its folder.
    pub folder: PathBuf,
    /// Run directories to be added from disk.
    pub add: Vec<PathBuf>,
    /// Where it listens, in words.
    pub listens: Option<String>,
    /// Ends once so many runs have come and ended, and their map is made; `None`: goes on.
    pub until: Option<usize>,
    /// How much is copied of runs that come over the network.
    pub form: CopyForm,
    /// Between two maps while runs go on; `None`: a map when a run ends.
    pub map_every: Option<Duration>,
}

/// Carriers for workers: each has its own.
pub trait RobotNetwork {
    /// Names of the robots that can be asked now, and names that were refused since the last call.
    fn robots(&mut self) -> (Vec<String>, Vec<String>);
    /// A carrier for one worker.
    fn carrier(&self) -> Box<dyn RobotCarrier + Send>;
}
