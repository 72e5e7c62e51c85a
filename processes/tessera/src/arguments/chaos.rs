//! The command line of `tessera chaos`.

use clap::Args;
use std::ffi::OsString;
use std::path::PathBuf;

/// `tessera chaos`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Runs the source once undisturbed, then again and again under faults until there
were enough of them, and compares: outputs byte by byte, every frame in the
journal, what is left in shared memory and in the folder. Exit code 0: the
promise was kept; 4: it was not, and the folder of that run stays for a look.

Examples:
  tessera chaos --kills 100                     SIGKILLs of random stages of the room
  tessera chaos FOLDER --kills 100 --seed 7     a recording, another schedule
  tessera chaos --kills 20 --stages group       all at once, then `tessera resume`
  tessera chaos --faults kill,stop,slow,drop,corrupt,segv,abort,memory,full,flip
  tessera chaos --plan FILE                     lines of STAGE INDEX POINT FAULT,
                                                such as `align 12 stored kill`
  tessera chaos --external --live --kills 50    a camera's own program sends the frames
  tessera chaos --attach NAME --stages align    a run that is going on
  tessera chaos --fleet --times 100             a fleet and its network")]
pub(crate) struct ChaosArguments {
    /// A recording, or a simulated world: room, corridor, wall, house, building [default: room]
    #[arg(conflicts_with = "attach")]
    pub(crate) source: Option<String>,
    /// Faults in all, over as many runs as it takes
    #[arg(long, value_name = "N", default_value_t = 100)]
    pub(crate) kills: u64,
    /// Seed of the schedule: who, what, when
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Who is struck: sensor, reconstruct, align, optimise, supervisor, group
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "sensor,reconstruct,align,optimise"
    )]
    pub(crate) stages: Vec<String>,
    /// By what: kill, stop, slow, sleep, segv, abort, memory, full, drop, corrupt, index-jump, sync-fails, flip,
    /// page-zeroed, store-cut, store-lost
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "kill")]
    pub(crate) faults: Vec<String>,
    /// Mean time between two faults
    #[arg(long, value_name = "MS", default_value_t = 300)]
    pub(crate) interval_ms: u64,
    /// One run with exactly these faults
    #[arg(long, value_name = "FILE", conflicts_with_all = ["attach", "live"])]
    pub(crate) plan: Option<PathBuf>,
    /// Disturb a run that is going on, and compare nothing
    #[arg(long, value_name = "NAME")]
    pub(crate) attach: Option<String>,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl, 7scenes, primesense [default: the folder's camera.toml]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// A preset (default, paper, fast, onboard) or a TOML file
    #[arg(long, value_name = "PRESET|FILE")]
    pub(crate) config: Option<String>,
    /// Change one setting; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Process at most so many frames in each run
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<u64>,
    /// Live runs: frames are dropped, so outputs are not compared; what came is counted
    #[arg(long)]
    pub(crate) live: bool,
    /// The frames come from a camera's own program: with --live each once, else each until it was taken
    #[arg(long, conflicts_with = "attach")]
    pub(crate) external: bool,
    /// Folder for the runs [default: a temporary one, removed when the promise was kept]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Longest time for one run, seconds
    #[arg(long, value_name = "S", default_value_t = 600)]
    pub(crate) patience_s: u64,
    /// Print JSON lines: one for each fault, each run, and the total
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
    /// Disturb a fleet instead, and its network; behind it come arguments of its own, such as --help
    #[arg(long, value_name = "ARGUMENTS", num_args = 0.., allow_hyphen_values = true, exclusive = true)]
    pub(crate) fleet: Option<Vec<OsString>>,
}

impl From<ChaosArguments> for tessera_lab::chaos::Campaign {
    fn from(arguments: ChaosArguments) -> Self {
        Self {
            source: arguments.source,
            kills: arguments.kills,
            seed: arguments.seed,
            interval_ms: arguments.interval_ms,
            plan: arguments.plan,
            camera: arguments.camera,
            config: arguments.config,
            overrides: arguments.overrides,
            frames: arguments.frames,
            live: arguments.live,
            external: arguments.external,
            out: arguments.out,
            patience_s: arguments.patience_s,
        }
    }
}
