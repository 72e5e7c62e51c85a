//! The command line.

mod ablate;
mod calibrate;
mod chaos;
mod evaluate;
mod export;
mod passed_on;
mod profile;
mod run;
mod top;
mod topics;
mod view;

use crate::terminal::WIDTH;
pub(crate) use ablate::AblateArguments;
pub(crate) use calibrate::CalibrateArguments;
pub(crate) use chaos::ChaosArguments;
use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
pub(crate) use evaluate::EvaluateArguments;
pub(crate) use export::ExportArguments;
pub(crate) use passed_on::PassedOn;
pub(crate) use profile::{ProfileArguments, RecordArguments};
pub(crate) use run::{RunArguments, Speech};
use std::path::PathBuf;
pub(crate) use top::TopArguments;
use topics::TopicArguments;
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
  6    with --strict: the verdict on the run is doubtful
  7    with --strict: the verdict on the run is failed
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
    /// Read everything of a run and tell what is whole
    Verify(VerifyArguments),
    /// Write the outputs of a run again, even after a crash
    Export(ExportArguments),
    /// Write a report of one or several runs, a page for a browser
    Report(ReportArguments),
    /// Compare a trajectory with the ground truth
    Evaluate(EvaluateArguments),
    /// Show the processes of a run without disturbing it
    Status(StatusArguments),
    /// Watch a run as it goes on
    Top(TopArguments),
    /// Show a run in Rerun
    View(ViewArguments),
    /// Join a ROS 2 network: its camera in, odometry and transforms out
    #[command(after_help = passed_on::ROS2)]
    Ros2(PassedOn),
    /// On a robot: make a run available to a base
    #[command(after_help = passed_on::FLEET)]
    Uplink(PassedOn),
    /// Make one map of the runs of many robots, or of many days
    #[command(after_help = passed_on::FLEET)]
    Base(PassedOn),
    /// Run one stage by hand, for a debugger or a profiler
    Stage(StageArguments),
    /// Look at a source before running it: sizes, camera, depth, pairing, gaps
    Check(CheckArguments),
    /// Find the camera's parameters from the frames themselves
    Calibrate(CalibrateArguments),
    /// Kill, freeze and damage a run on purpose, and check that its results keep their bytes
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
    /// Write the manual pages of all commands
    #[command(after_help = "Examples:\n  tessera man ~/.local/share/man/man1")]
    Man {
        /// The folder to write them into; it is made
        folder: PathBuf,
    },
}

/// `tessera resume`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  tessera resume room-1\n  tessera resume results/desk")]
pub(crate) struct ResumeArguments {
    /// Name of the run, or its folder
    pub(crate) run: String,
    /// Where a file of the run is damaged, go on without what lies behind; a copy stays beside it
    #[arg(long)]
    pub(crate) drop_damaged: bool,
    /// Faults on purpose, as those of `tessera run`
    #[arg(long, value_name = "PLAN", hide = true)]
    pub(crate) faults: Option<String>,
    #[command(flatten)]
    pub(crate) speech: Speech,
}

/// `tessera verify`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Changes nothing; also of a copied folder, of a base's copy, and of a run that goes on.
Exit code 3: something that was recorded is lost.

Examples:
  tessera verify room-1
  tessera verify results/desk --json")]
pub(crate) struct VerifyArguments {
    /// Name of the run, or its folder
    pub(crate) run: String,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
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
    /// A recording (folder of images, bag of ROS 1 or 2, FILE.mcap), or a simulated world
    pub(crate) source: String,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl, 7scenes, primesense [default: the source's own]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    #[command(flatten)]
    pub(crate) topics: TopicArguments,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
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
