//! Vector instructions: what they may change, and that a run keeps its own.

mod common;

use common::{Run, room};
use std::process::Command;

fn finished(arguments: &[&str]) -> Run {
    let run = room().with(arguments);
    assert!(run.finish().success());
    run
}

/// Times and positions of a trajectory, metres.
fn positions(run: &Run, name: &str) -> Vec<[f64; 4]> {
    let text = String::from_utf8(run.output(name)).unwrap();
    let rows = text.lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let numbers: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        [numbers[0], numbers[1], numbers[2], numbers[3]]
    })
    .collect()
}

#[test]
fn portable_code_makes_the_same_surfaces_and_nearly_the_same_poses() {
    let (widest, portable) = (finished(&[]), finished(&["--isa", "baseline"]));
    // The store holds surfaces and nothing else, and both runs chose the same keyframes.
    assert!(widest.output("keyframes.store") == portable.output("keyframes.store"), "the surfaces differ");
    for name in ["trajectory.txt", "trajectory_online.txt"] {
        let (a, b) = (positions(&widest, name), positions(&portable, name));
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(&b) {
            let far = (0..4).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
            assert!(far < 1e-4, "{name}: {a:?} and {b:?}");
        }
    }
    let config = String::from_utf8(portable.output("config.toml")).unwrap();
    assert!(config.contains("isa = \"baseline\""), "{config}");
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
        (Some(_), Some(_)) => return eprintln!("skipped: nothing to switch off in this C library"),
        _ => return eprintln!("skipped: this C library does not say what it uses"),
    }
    let plain = finished(&[]);
    let tuned = room().with_env("GLIBC_TUNABLES", WITHOUT_AVX2);
    assert!(tuned.finish().success());
    tuned.assert_same_bytes(&plain, "glibc without AVX2 and FMA");
}

#[test]
fn a_run_names_its_instructions_and_goes_on_with_no_others() {
    let run = finished(&[]);
    let path = run.out().join("config.toml");
    let config = std::fs::read_to_string(&path).unwrap();
    let line = config.lines().find(|line| line.starts_with("isa = ")).unwrap();
    assert_ne!(line, "isa = \"auto\"", "a run names what it has found");
    // As if it had begun on a machine of another kind.
    let foreign = if cfg!(target_arch = "aarch64") { "isa = \"avx2\"" } else { "isa = \"neon\"" };
    std::fs::write(&path, config.replace(line, foreign)).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).arg("resume").arg(run.out()).output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{words}");
    assert!(words.contains(&foreign[7..11]) && words.contains("another kind of machine"), "{words}");
}

#[test]
fn instructions_that_do_not_exist_are_refused() {
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(["run", "--isa", "mmx"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("expected auto, baseline, avx2, avx512 or neon")
    );
}
