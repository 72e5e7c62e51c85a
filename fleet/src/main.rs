//! `tessera-fleet`: the uplink of a robot and the base of a fleet, and faults on purpose for both. `tessera
//! uplink`, `tessera base` and `tessera chaos --fleet` become it.
#![forbid(unsafe_code)]

use clap::Parser;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use tessera_fleet::arguments::{BaseArguments, FleetArguments, FleetCommand, UplinkArguments};
use tessera_fleet::base::base;
use tessera_fleet::base::network::ZenohNetwork;
use tessera_fleet::base::options::{BaseOptions, RobotNetwork};
use tessera_fleet::base::status::Status;
use tessera_fleet::chaos::{FleetChaosArguments, FleetFault, end_with_parent, fleet_campaign};
use tessera_fleet::copies::arrivals::{CopyForm, DISK};
use tessera_fleet::error::FleetError;
use tessera_fleet::looking::look;
use tessera_fleet::robot::uplink::{UplinkOptions, uplink};
use tessera_fleet::wire::session::{FleetEnd, configuration, locators};

fn main() -> ExitCode {
    end_with_parent();
    let arguments = FleetArguments::parse();
    let done = match &arguments.command {
        FleetCommand::Uplink(arguments) => run_uplink(arguments),
        FleetCommand::Base(arguments) => run_base(arguments),
        FleetCommand::Chaos(arguments) => run_chaos(arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("tessera-fleet: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn stop_flag() -> Result<Arc<AtomicBool>, FleetError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(|e| FleetError::Network(format!("signals: {e}")))?;
    }
    Ok(stop)
}

fn run_uplink(arguments: &UplinkArguments) -> Result<(), FleetError> {
    let robot = arguments.robot.clone().unwrap_or_else(host_name);
    if tessera_transport::check_name(&robot).is_err() || robot == DISK {
        return Err(FleetError::Arguments(format!(
            "robot {robot:?}: expected 1 to 64 letters, digits, '.', '_' or '-', and not {DISK:?}"
        )));
    }
    let config = configuration(&FleetEnd::Robot(arguments.to.as_deref()), arguments.config.as_deref())?;
    let options = UplinkOptions {
        folders: vec![Path::new("runs").join(&arguments.run), PathBuf::from(&arguments.run)],
        robot,
        max_bytes_per_s: arguments.max_kbps.map(|kbps| f64::from(kbps) * 125.0),
        is_quiet: arguments.quiet,
    };
    uplink(&options, config, &*stop_flag()?)
}

fn host_name() -> String {
    rustix::system::uname().nodename().to_string_lossy().into_owned()
}

fn run_base(arguments: &BaseArguments) -> Result<(), FleetError> {
    if let Some(action) = arguments.action {
        return look(&arguments.folder, action, &arguments.look);
    }
    let stop = stop_flag()?;
    let is_listening = arguments.add.is_empty() || arguments.listen.is_some() || arguments.config.is_some();
    let mut options = BaseOptions {
        folder: arguments.folder.clone(),
        add: arguments.add.clone(),
        listens: None,
        until: arguments.runs.or((!is_listening).then_some(arguments.add.len())),
        form: if arguments.whole { CopyForm::Whole } else { CopyForm::Kept },
        map_every: (arguments.map_every > 0 && is_listening)
            .then(|| Duration::from_secs(arguments.map_every)),
    };
    if !is_listening {
        base(&options, None, &stop)?;
    } else {
        let end = FleetEnd::Base(arguments.listen.as_deref());
        let config = configuration(&end, arguments.config.as_deref())?;
        let listens = locators(&config, "listen")?.join(", ");
        let is_plain = listens.contains("tcp/");
        let reach = if is_plain { "this machine alone, not encrypted" } else { "TLS" };
        options.listens = Some(format!("listening on {listens} ({reach})"));
        // Before it listens: there is one base of a folder.
        std::fs::create_dir_all(&options.folder).map_err(FleetError::io("make", &options.folder))?;
        let mut network = ZenohNetwork::open(config)?;
        if !arguments.quiet {
            println!("{}", options.listens.as_deref().unwrap_or_default());
        }
        base(&options, Some(&mut network as &mut dyn RobotNetwork), &stop)?;
    }
    if !arguments.quiet {
        print!("{}", Status::read(&options.folder)?.text(false));
    }
    Ok(())
}

fn run_chaos(arguments: &FleetChaosArguments) -> Result<(), FleetError> {
    let program = std::env::current_exe().map_err(|e| FleetError::Network(format!("own program: {e}")))?;
    let is_shown = !arguments.quiet && std::io::stderr().is_terminal();
    let n_faults = arguments.times as usize * FleetFault::ALL.len();
    let mut on_fault = |n: usize, words: &str| {
        if is_shown {
            eprint!("\r\x1b[K{n}/{n_faults} faults: {words}");
        }
    };
    let done = fleet_campaign(&program, arguments, &*stop_flag()?, &mut on_fault);
    if is_shown {
        eprint!("\r\x1b[K");
    }
    let report = done?;
    let text = if arguments.json { report.to_json_lines() } else { report.for_people() };
    println!("{}", text.trim_end());
    report.verdict()
}
