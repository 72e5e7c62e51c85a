//! Vector instructions: they change no byte, also where a run is resumed with others.

use crate::common::{Run, room, signal};
use crate::requirements::missing;
use std::process::Command;

fn finished(arguments: &[&str]) -> Run {
    let run = room().with(arguments);
    assert!(run.finish().success());
    run
}

#[test]
fn portable_code_writes_the_same_bytes() {
    let (widest, portable) = (finished(&[]), finished(&["--isa", "baseline"]));
    portable.assert_same_bytes(&widest, "portable code");
    let config = String::from_utf8(portable.output("config.toml")).unwrap();
    assert!(config.contains("isa = \"baseline\""), "{config}");
}

/// Interrupts a run, writes other instructions into its `config.toml` and resumes it: the outputs
/// must be those of an undisturbed run.
fn resume_with(isa: &str, arguments: &[&str], frames: u64) -> String {
    let reference = room().frames(frames).with(arguments);
    assert!(reference.finish().success());
    let run = room().frames(frames).with(arguments);
    let mut child = run.start();
    run.wait_until_busy();
    signal(child.id(), "INT");
    // Fast machines may have finished already.
    assert!(matches!(child.wait().unwrap().code(), Some(0 | 130)));
    let path = run.out().join("config.toml");
    let config = std::fs::read_to_string(&path).unwrap();
    let line = isa_line(&config);
    assert_ne!(line, "isa = \"auto\"", "a run names what it has found");
    std::fs::write(&path, config.replace(line, &format!("isa = \"{isa}\""))).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).arg("resume").arg(run.out()).output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{isa}: {words}");
    run.assert_same_bytes(&reference, &format!("resumed with {isa} and {arguments:?}"));
    isa_line(&std::fs::read_to_string(&path).unwrap()).to_owned()
}

fn isa_line(config: &str) -> &str {
    config.lines().find(|line| line.starts_with("isa = ")).unwrap()
}

#[test]
fn a_run_goes_on_with_other_instructions() {
    assert_eq!(resume_with("baseline", &[], 60), "isa = \"baseline\"");
    // As if it had begun on a machine of another kind: it goes on with what this one has.
    let foreign = if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" };
    assert!(!resume_with(foreign, &[], 60).contains(foreign));
}

#[test]
fn a_run_that_solves_for_the_camera_goes_on_with_other_instructions() {
    assert_eq!(resume_with("baseline", &["--refine-camera"], 120), "isa = \"baseline\"");
}

/// What keeps the C library from using AVX2 and FMA, under its present and its former names.
const WITHOUT_AVX2: &str = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable";

/// The instructions that the C library uses, as its loader says; `None` where it cannot be asked.
fn instructions_in_use(tunables: Option<&str>) -> Option<String> {
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let path = |line: &str| line.find('/').map(|at| line[at..].to_owned());
    let loader = maps.lines().filter_map(path).find(|path| path.contains("/ld-"))?;
    let mut command = Command::new(loader);
    command.arg("--list-diagnostics").env_remove("GLIBC_TUNABLES");
    if let Some(tunables) = tunables {
        command.env("GLIBC_TUNABLES", tunables);
    }
    let text = String::from_utf8(command.output().ok()?.stdout).ok()?;
    let active: Vec<&str> = text.lines().filter(|line| line.contains("active")).collect();
    (!active.is_empty()).then(|| active.join("\n"))
}

#[test]
fn the_c_librarys_choice_of_instructions_changes_no_byte() {
    match (instructions_in_use(None), instructions_in_use(Some(WITHOUT_AVX2))) {
        (Some(plain), Some(tuned)) if plain != tuned => {}
        (Some(_), Some(_)) => return missing("glibc", "nothing to switch off in this C library"),
        _ => return missing("glibc", "this C library does not say what it uses"),
    }
    let plain = finished(&[]);
    let tuned = room().with_env("GLIBC_TUNABLES", WITHOUT_AVX2);
    assert!(tuned.finish().success());
    tuned.assert_same_bytes(&plain, "glibc without AVX2 and FMA");
}

#[test]
fn instructions_that_do_not_exist_are_refused() {
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(["run", "--isa", "mmx"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("expected auto, baseline, avx2, avx512 or neon")
    );
}
