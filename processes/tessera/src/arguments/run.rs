//! `tessera run`: its arguments.

use super::topics::TopicArguments;
use clap::{Args, ValueEnum};
use std::net::SocketAddr;
use std::path::PathBuf;
use tessera_numerics::Isa;

/// `tessera run`.
#[derive(Clone, Debug, Default, Args)]
#[command(args_override_self = true)]
#[command(after_help = "\
Examples:
  tessera run                              the simulated room
  tessera run room --frames 100            its first 100 frames
  tessera run room --set simulation.person=true
                                           with a person who walks about
  tessera run FOLDER --out results         a recording
  tessera run FOLDER FOLDER2 FILE.mcap     several, one after the other, and all side by side
  tessera run FOLDER --config paper        with the values of the paper
  tessera run FOLDER --set surface.step=2  with one setting changed
  tessera run FOLDER --map runs/room-1     in the map of an earlier run
  tessera run FOLDER --live                at the rate of the recording")]
pub(crate) struct RunArguments {
    /// A recording (folder of images, bag of ROS 1 or 2, FILE.mcap), a simulated world (room, corridor, wall,
    /// house, building), or external: a camera's own program sends the frames [default: room]. Several are run
    /// one after the other and compared
    #[arg(value_name = "SOURCE")]
    pub(crate) sources: Vec<String>,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl, 7scenes, primesense, or guess [default: the recording's own]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    #[command(flatten)]
    pub(crate) topics: TopicArguments,
    /// A preset (default, paper, fast, onboard) or a TOML file
    #[arg(long, value_name = "PRESET|FILE")]
    pub(crate) config: Option<String>,
    /// Change one setting; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Folder for the outputs, or for those of several [default: runs/NAME]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Name of the run [default: a fresh one, after the source]
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Leave out so many frames at the beginning
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) skip: Option<u64>,
    /// Process at most so many frames
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub(crate) frames: Option<u64>,
    /// Start in the map of an earlier run (its name or folder), found by recognition, and extend it
    #[arg(long, value_name = "RUN", help_heading = "Maps")]
    pub(crate) map: Option<String>,
    /// Where the first frame stands in that map: "tx ty tz qx qy qz qw"
    #[arg(long, value_name = "POSE", requires = "map", allow_hyphen_values = true, help_heading = "Maps")]
    pub(crate) at: Option<String>,
    /// Track in that map and add nothing to it: no keyframe, no loop, no submap
    #[arg(long, requires = "map", conflicts_with = "map_update", help_heading = "Maps")]
    pub(crate) only_localise: bool,
    /// At the end of the run its folder and that of the map change places: the map is updated
    #[arg(long, requires = "map", help_heading = "Maps")]
    pub(crate) map_update: bool,
    /// The final optimisation solves for the camera too; the outputs are those of the refined camera
    #[arg(long)]
    pub(crate) refine_camera: bool,
    /// Frames come at the source's own rate and the newest wins; drops are counted
    #[arg(long)]
    pub(crate) live: bool,
    /// Who optimises all keyframes: this run, or the base of a fleet for run.base_wait_s each time (5 s where that
    /// is 0) and this run behind that [default: local]
    #[arg(long, value_enum, value_name = "WHERE", help_heading = "For a fleet")]
    pub(crate) optimise: Option<OptimiseWhere>,
    /// Prepare and hold the run, or go on with the one of that name, for stages that are
    /// started from outside: by systemd, or `tessera stage`
    #[arg(long, requires = "name", help_heading = "For experts")]
    pub(crate) hold: bool,
    /// Faults on purpose, for `tessera chaos` and tests: `align=stored:12;sensor=sent:3:segv`
    #[arg(long, value_name = "PLAN", hide = true)]
    pub(crate) faults: Option<String>,
    /// Go on where the source looks wrong
    #[arg(long)]
    pub(crate) force: bool,
    /// Vector instructions, all with the same results: auto (the machine's widest), baseline, avx2, avx512, neon
    #[arg(long, value_parser = isa, help_heading = "For experts")]
    pub(crate) isa: Option<Isa>,
    /// Write the run for Rerun too, by the program of `tessera view`
    #[arg(long, value_name = "FILE.rrd", help_heading = "For experts")]
    pub(crate) rerun: Option<PathBuf>,
    /// Write a timeline of all processes, for Perfetto (ui.perfetto.dev)
    #[arg(long, value_name = "FILE", conflicts_with = "hold", help_heading = "For experts")]
    pub(crate) trace: Option<PathBuf>,
    /// Answer Prometheus at this address of the loopback interface while the run lasts
    #[arg(long, value_name = "127.0.0.1:PORT", value_parser = tessera_report::loopback_address, help_heading = "For experts")]
    pub(crate) metrics: Option<SocketAddr>,
    /// Decode all frames into memory first
    #[arg(long, help_heading = "For experts")]
    pub(crate) preload: bool,
    #[command(flatten)]
    pub(crate) speech: Speech,
}

/// Where all keyframes are optimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OptimiseWhere {
    /// By the run's own process
    Local,
    /// By the base of a fleet, where it answers in time
    Remote,
}

impl OptimiseWhere {
    /// Time for which a base is waited for where the settings have none, seconds.
    const WAIT_S: f64 = 5.0;

    /// `run.base_wait_s` in the place of what the settings have.
    pub(crate) fn base_wait_s(self, of_settings: f64) -> f64 {
        match self {
            Self::Local => 0.0,
            Self::Remote if of_settings > 0.0 => of_settings,
            Self::Remote => Self::WAIT_S,
        }
    }
}

/// How much is said, and in what form.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct Speech {
    /// No progress and no summary, errors only
    #[arg(long, short)]
    pub(crate) quiet: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Exit with 6 where the verdict on the run is doubtful, with 7 where it is failed
    #[arg(long)]
    pub(crate) strict: bool,
}

fn isa(word: &str) -> Result<Isa, String> {
    let all = [Isa::Auto, Isa::Baseline, Isa::Avx2, Isa::Avx512, Isa::Neon];
    all.into_iter()
        .find(|isa| isa.to_string() == word)
        .ok_or("expected auto, baseline, avx2, avx512 or neon".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_base_is_waited_for_as_long_as_the_settings_say() {
        let waits = |at: OptimiseWhere| [0.0, 60.0].map(|of_settings| at.base_wait_s(of_settings));
        assert_eq!(waits(OptimiseWhere::Remote), [5.0, 60.0]);
        assert_eq!(waits(OptimiseWhere::Local), [0.0, 0.0]);
    }
}
