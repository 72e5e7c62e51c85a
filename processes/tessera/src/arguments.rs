//! The command line.

mod chaos;
mod profile;
mod top;
mod view;

use crate::terminal::WIDTH;
pub(crate) use chaos::ChaosArguments;
use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
pub(crate) use profile::{ProfileArguments, RecordArguments};
use std::net::SocketAddr;
use std::path::PathBuf;
use tessera_surface::Isa;
pub(crate) use top::TopArguments;
pub(crate) use view::ViewArguments;

const ABOUT: &str = "RGB-D SLAM in four processes joined by zero-copy shared memory";

const EXAMPLES: &str = "\
Examples:
  tessera                                  the simulated room (the same as `tessera run room`)
  tessera run FOLDER                       a recording in the TUM RGB-D layout
  tessera run FOLDER --camera freiburg1    with a built-in camera
  tessera evaluate trajectory.txt groundtruth.txt

Exit codes:
  0    done
  2    wrong arguments or configuration
  3    unusable input
  4    a stage failed, or an output could not be written
  5    the camera was never found in the map given by --map; the map has not grown
  130  interrupted; the outputs of what was processed are written";

/// The whole command line.
#[derive(Debug, Parser)]
#[command(name = "tessera", version, about = ABOUT, after_help = EXAMPLES, max_term_width = WIDTH)]
pub(crate) struct Arguments {
    /// What to do; without it the simulated room is run.
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Turn frames into a trajectory and a map
    Run(RunArguments),
    /// Go on with a run that was interrupted or killed
    Resume(ResumeArguments),
    /// Write the outputs of a run again, also of one that crashed
    Export(ExportArguments),
    /// Show what came of one run or several, as a page for a browser
    Report(ReportArguments),
    /// Compare a trajectory with the ground truth
    Evaluate(EvaluateArguments),
    /// Show the processes of a run without disturbing it
    Status(StatusArguments),
    /// Watch a run as it goes on
    Top(TopArguments),
    /// Show a run in Rerun
    View(ViewArguments),
    /// Run one stage by hand, for a debugger or a profiler
    Stage(StageArguments),
    /// Look at a source before running it: sizes, camera, depth, pairing, gaps
    Check(CheckArguments),
    /// Find the camera's parameters from the frames themselves
    Calibrate(CalibrateArguments),
    /// Kill, freeze and damage a run on purpose, and prove that it changed nothing
    Chaos(ChaosArguments),
    /// Measure what each part of the method is worth, as the paper's Table I does
    Ablate(AblateArguments),
    /// Write the exact input of one stage to a file
    Record(RecordArguments),
    /// Run one stage alone on its recorded input, and say where its time goes
    Profile(ProfileArguments),
    /// Remove what dead runs left in shared memory, and only that
    #[command(after_help = "Examples:\n  tessera clean")]
    Clean,
    /// Print a completion script for a shell
    #[command(
        after_help = "Examples:\n  tessera completions bash > ~/.local/share/bash-completion/completions/tessera"
    )]
    Completions {
        /// The shell
        shell: Shell,
    },
}

/// `tessera run`.
#[derive(Clone, Debug, Default, Args)]
#[command(args_override_self = true)]
#[command(after_help = "\
Examples:
  tessera run                              the simulated room
  tessera run room --frames 100            its first 100 frames
  tessera run room --person --readout 0.03 with a person and a rolling shutter
  tessera run FOLDER --out results         a recording in the TUM layout
  tessera run FOLDER --config paper        with the values of the paper
  tessera run FOLDER --set surface.step=2  with one setting changed
  tessera run FOLDER --map runs/room-1     in the map of an earlier run
  tessera run FOLDER --live                at the rate of the recording")]
pub(crate) struct RunArguments {
    /// A folder in the TUM layout, FILE.mcap, a simulated world (room, corridor, wall, house), or external: a
    /// camera's own program sends the frames [default: room]
    pub(crate) source: Option<String>,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl [default: the folder's camera.toml]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// In FILE.mcap: the topic of depth [default: the one whose name says so]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) depth_topic: Option<String>,
    /// In FILE.mcap: the topic of colour [default: the one whose name says so]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) color_topic: Option<String>,
    /// A preset (default, paper, fast, onboard) or a TOML file
    #[arg(long, value_name = "PRESET|FILE")]
    pub(crate) config: Option<String>,
    /// Change one setting; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Folder for the outputs [default: runs/NAME]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Name of the run [default: a fresh one, after the source]
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Leave out so many frames at the beginning
    #[arg(long, value_name = "N")]
    pub(crate) skip: Option<u64>,
    /// Process at most so many frames
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<u64>,
    /// In a simulated scene: a person walks about in front of the camera
    #[arg(long)]
    pub(crate) person: bool,
    /// In a simulated scene: a rolling shutter, seconds from the first row to the last
    #[arg(long, value_name = "SECONDS")]
    pub(crate) readout: Option<f64>,
    /// Start in the map of an earlier run (its name or folder), found by recognition, and extend it
    #[arg(long, value_name = "RUN")]
    pub(crate) map: Option<String>,
    /// Where the first frame stands in that map: "tx ty tz qx qy qz qw"
    #[arg(long, value_name = "POSE", requires = "map", allow_hyphen_values = true)]
    pub(crate) at: Option<String>,
    /// At the end of the run its folder and that of the map change places: the map is updated
    #[arg(long, requires = "map")]
    pub(crate) map_update: bool,
    /// The final optimisation solves for the camera too; the outputs are those of the refined camera
    #[arg(long)]
    pub(crate) refine_camera: bool,
    /// Frames come at the source's own rate and the newest wins; drops are counted
    #[arg(long)]
    pub(crate) live: bool,
    /// Prepare and hold the run, or go on with the one of that name, for stages that somebody
    /// else starts: systemd, or `tessera stage`
    #[arg(long, requires = "name")]
    pub(crate) hold: bool,
    /// Go on where the source looks wrong
    #[arg(long)]
    pub(crate) force: bool,
    /// Vector instructions: auto (the machine's widest), baseline (the same bits on all machines), avx2, neon
    #[arg(long, value_parser = isa)]
    pub(crate) isa: Option<Isa>,
    /// Write the run for Rerun too, by the program of `tessera view`
    #[arg(long, value_name = "FILE.rrd")]
    pub(crate) rerun: Option<PathBuf>,
    /// Write down what each process does and when, for Perfetto (ui.perfetto.dev)
    #[arg(long, value_name = "FILE", conflicts_with = "hold")]
    pub(crate) trace: Option<PathBuf>,
    /// Answer Prometheus at this address of the loopback interface while the run lasts
    #[arg(long, value_name = "127.0.0.1:PORT", value_parser = top::loopback)]
    pub(crate) metrics: Option<SocketAddr>,
    /// Decode all frames into memory first
    #[arg(long)]
    pub(crate) preload: bool,
    /// For tests: throw state away after every N frames and read it back
    #[arg(long, value_name = "N")]
    pub(crate) forget_every: Option<u64>,
    #[command(flatten)]
    pub(crate) speech: Speech,
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
}

/// `tessera resume`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  tessera resume room-1\n  tessera resume results/desk")]
pub(crate) struct ResumeArguments {
    /// Name of the run, or its folder
    pub(crate) run: String,
    #[command(flatten)]
    pub(crate) speech: Speech,
}

/// `tessera export`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
With --cloud, --mesh, --kitti, --euroc or --mcap only those files are written, else (or
with --out) all outputs.

Examples:
  tessera export room-1
  tessera export results/desk --out elsewhere
  tessera export room-1 --cloud room.pcd --mesh room.glb --voxel-mm 5
  tessera export room-1 --kitti poses.txt --euroc poses.csv")]
pub(crate) struct ExportArguments {
    /// Name of the run, or its folder
    pub(crate) run: String,
    /// Folder for the outputs [default: the run's own]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) files: ExportFiles,
    #[command(flatten)]
    pub(crate) speech: Speech,
}

/// What other programs read.
#[derive(Clone, Debug, Args)]
pub(crate) struct ExportFiles {
    /// The fused map as coloured points with normals: FILE.ply or FILE.pcd
    #[arg(long, value_name = "FILE")]
    pub(crate) cloud: Option<PathBuf>,
    /// The fused map as coloured triangles: FILE.ply or FILE.glb
    #[arg(long, value_name = "FILE")]
    pub(crate) mesh: Option<PathBuf>,
    /// Edge of the voxels of the fused map, millimetres
    #[arg(long, value_name = "MM", default_value_t = 10.0, value_parser = positive)]
    pub(crate) voxel_mm: f64,
    /// Points farther from their camera are not fused, metres
    #[arg(long, value_name = "M", default_value_t = 4.0, value_parser = positive)]
    pub(crate) max_depth_m: f64,
    /// Memory for voxels at most, megabytes
    #[arg(long, value_name = "MB", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) memory_mb: u32,
    /// The final trajectory as KITTI has it: rows of a 3x4 matrix, without times
    #[arg(long, value_name = "FILE")]
    pub(crate) kitti: Option<PathBuf>,
    /// The final trajectory as EuRoC has it: CSV, nanoseconds, quaternions w x y z
    #[arg(long, value_name = "FILE")]
    pub(crate) euroc: Option<PathBuf>,
    /// Poses, transforms, keyframes and the fused map as messages of ROS 2, for Foxglove too
    #[arg(long, value_name = "FILE")]
    pub(crate) mcap: Option<PathBuf>,
}

/// A length that is more than nothing and less than a hundred thousand.
fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text:?} is no number"))?;
    if value > 0.0 && value < 1e5 { Ok(value) } else { Err(format!("found {value}, expected more than 0")) }
}

/// `tessera report`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
One self-contained file of HTML; each run writes its own when it ends.

Examples:
  tessera report room-1
  tessera report room-1 room-2 --out both.html")]
pub(crate) struct ReportArguments {
    /// Names of runs, or their folders; several stand side by side
    #[arg(required = true, value_name = "RUN")]
    pub(crate) runs: Vec<String>,
    /// The file [default: report.html in the run's folder; of several runs, here]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Do not say where it is
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// What offset of stamps to report beside the standard figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TimeOffset {
    /// The constant offset that fits best.
    Auto,
}

/// `tessera evaluate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
ATE is the absolute trajectory error after rigid alignment, RPE the relative
pose error over one second, both by the definitions of the TUM scripts. Further
figures stand beside the standard ones, never instead.

Examples:
  tessera evaluate runs/room-1/trajectory.txt runs/room-1/groundtruth.txt
  tessera evaluate estimate.txt groundtruth.txt --json
  tessera evaluate estimate.txt groundtruth.txt --time-offset auto --scale")]
pub(crate) struct EvaluateArguments {
    /// The estimated trajectory: lines of `timestamp tx ty tz qx qy qz qw`
    pub(crate) estimate: PathBuf,
    /// The true trajectory, in the same form
    pub(crate) groundtruth: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Report the figures under the best constant offset of the stamps too
    #[arg(long, value_name = "auto")]
    pub(crate) time_offset: Option<TimeOffset>,
    /// Report the ATE with the scale corrected too
    #[arg(long)]
    pub(crate) scale: bool,
}

/// `tessera status`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  tessera status\n  tessera status room-1 --json")]
pub(crate) struct StatusArguments {
    /// Name of the run, or its folder [default: every run in runs/ that is going on]
    pub(crate) run: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `tessera stage`.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Examples:\n  tessera stage align --run room-1\n  tessera stage align --run-dir results/desk"
)]
pub(crate) struct StageArguments {
    /// sensor, reconstruct, align or optimise
    pub(crate) stage: String,
    /// Name of the run
    #[arg(long, value_name = "NAME", required_unless_present = "run_dir", conflicts_with = "run_dir")]
    pub(crate) run: Option<String>,
    /// Folder of the run
    #[arg(long, value_name = "DIR")]
    pub(crate) run_dir: Option<PathBuf>,
}

/// `tessera check`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  tessera check FOLDER\n  tessera check FOLDER --camera freiburg1 --json")]
pub(crate) struct CheckArguments {
    /// A folder in the TUM layout, FILE.mcap, or a simulated world
    pub(crate) source: String,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl [default: the source's own]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// In FILE.mcap: the topic of depth [default: the one whose name says so]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) depth_topic: Option<String>,
    /// In FILE.mcap: the topic of colour [default: the one whose name says so]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) color_topic: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `tessera calibrate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
No target and no ground truth: surfaces seen twice must agree. Focal lengths,
principal point, lens, readout time and depth offset are solved for together
with the poses; what the motion does not determine keeps its start. The global
scale of depth cannot be known from depth and colour and stays as it is. It
takes motion with turns about several axes, near and far.

Examples:
  tessera calibrate FOLDER --out camera.toml
  tessera calibrate FOLDER --camera start.toml --out camera.toml
  tessera calibrate FOLDER --fix k3 --fix depth_offset_m --out camera.toml --json")]
pub(crate) struct CalibrateArguments {
    /// A folder in the TUM layout, or a simulated world
    pub(crate) source: String,
    /// The camera to start from: a file, or freiburg1, freiburg2, freiburg3, icl [default: the source's own]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// The camera file to write
    #[arg(long, value_name = "FILE", default_value = "camera.toml")]
    pub(crate) out: PathBuf,
    /// Keep one parameter at its start; may be repeated
    #[arg(long, value_name = "PARAMETER")]
    pub(crate) fix: Vec<String>,
    /// A preset (default, paper, fast, onboard) or a TOML file
    #[arg(long, value_name = "PRESET|FILE")]
    pub(crate) config: Option<String>,
    /// Change one setting; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Use at most so many frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// `tessera ablate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The first table is the RPE of the initial alignments: pairwise with every n-th
pixel, with the filter over k rings, with a window of w frames; each alignment
stands as it is, without failure tests. The second is the ATE of the whole
system, beside that of others where all frames take part (no --frames). All
runs of a sequence go through one process and give the same bits as `tessera
run`.

Examples:
  tessera ablate room --frames 60
  tessera ablate FOLDER... --out table1.svg
  tessera ablate FOLDER --seeds 5 --json")]
pub(crate) struct AblateArguments {
    /// Folders in the TUM layout with ground truth, or simulated worlds
    #[arg(required = true, value_name = "SEQUENCE")]
    pub(crate) sequences: Vec<String>,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl [default: the folder's camera.toml]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// What the columns of the first table start from
    #[arg(long, value_name = "PRESET|FILE", default_value = "default")]
    pub(crate) config: String,
    /// What the whole system of the second table is run with
    #[arg(long, value_name = "PRESET|FILE", default_value = "default")]
    pub(crate) whole_config: String,
    /// Change one setting of all; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Process at most so many frames of each sequence
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Sampling seeds; more than one give a median and a spread
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// The plot of the first table
    #[arg(long, value_name = "FILE", default_value = "ablation.svg")]
    pub(crate) out: PathBuf,
    /// Print JSON instead of Markdown
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

fn isa(word: &str) -> Result<Isa, String> {
    let all = [Isa::Auto, Isa::Baseline, Isa::Avx2, Isa::Neon];
    all.into_iter()
        .find(|isa| isa.to_string() == word)
        .ok_or("expected auto, baseline, avx2 or neon".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn every_command_has_help_with_examples() {
        for command in Arguments::command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains("Examples:"), "{} has no examples", command.get_name());
            assert!(command.get_about().is_some(), "{} has no description", command.get_name());
        }
    }

    #[test]
    fn a_flag_given_twice_means_the_last_but_settings_add_up() {
        let line = "tessera run --frames 3 --set a=1 --frames 5 --set b=2";
        let arguments = Arguments::try_parse_from(line.split(' ')).unwrap();
        let Some(Command::Run(run)) = arguments.command else { panic!("not a run") };
        assert_eq!(run.frames, Some(5));
        assert_eq!(run.overrides, ["a=1", "b=2"]);
    }
}
