#!/usr/bin/env python3
"""Which constants of the method decide: each is multiplied in turn, and all else stays as it is.

    scripts/sensitivity.py                        # every constant of slam times 2, on four sequences
    scripts/sensitivity.py --factor 0.5 --only motion_filter same_place

A copy of the committed sources is made in a temporary folder, in which each numeric constant of
shared/method/slam/src reads its factor from the environment; it is built in release, once more for what is left out. Sequences are those
of TESSERA_SHARED (default ../shared) /data. A constant is printed with the errors that it makes, the worst ratio to
those with all constants as they are first; one that no sequence asks is counted, not printed. Constants that sizes
of arrays or other constants are made of are left out, and named. Takes some twenty minutes of one core.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
METHOD = "shared/method/slam/src"
KEYS = ["ate_final_m", "ate_online_m", "normalised_error"]
# Name, arguments of run_sequence.
SEQUENCES = {
    "fr1_desk_200": ["{data}/fr1_desk_200", "--seeds", "2"],
    "fr1_rpy_400": ["{data}/fr1_rpy_400", "--frames", "300"],
    "kitchen_exact_120": ["{data}/kitchen_exact_120"],
    "d435_office_400, colour halved": ["{data}/d435_office_400", "--frames", "150", "--colour", "halved"],
}
CONSTANT = re.compile(
    r"^( *)(pub(?:\(crate\))? )?const ([A-Z][A-Z0-9_]*): (f64|f32|u32|u64|i64|usize|i32) = ([^;{]*);", re.M
)
# What no name is replaced in: imports, comments, strings.
KEPT = re.compile(r'(^ *(?:pub(?:\(crate\))? )?use [^;]*;|//[^\n]*|"(?:[^"\\]|\\.)*")', re.M)
READER = """
pub(crate) fn value(name: &str, value: f64) -> f64 {
    let factor = std::env::var("TESSERA_FACTOR").ok();
    let factor = factor.as_deref().and_then(|f| f.split_once('=')).filter(|(n, _)| *n == name);
    factor.map_or(value, |(_, f)| value * f.parse::<f64>().expect("NAME=FACTOR"))
}
"""


def rewritten(text, path, names, left_out):
    """The text of a file with its constants as functions, and the names of these."""

    def function(match):
        indent, visible, name, kind, value = match.groups()
        if name in left_out:
            return match[0]
        key = f"{path}::{name}"
        names.append(key)
        body = f'{{ let usual: {kind} = {value}; crate::sensitivity::value("{key}", usual as f64) as {kind} }}'
        once = f"static V: std::sync::OnceLock<{kind}> = std::sync::OnceLock::new(); *V.get_or_init(|| {body})"
        # `##`: a name that is defined is not called.
        return f"{indent}#[allow(non_snake_case)]\n{indent}{visible or ''}fn {name}##() -> {kind} {{ {once} }}"

    return CONSTANT.sub(function, text)


def with_calls(text, names):
    parts = KEPT.split(text)
    for k in range(0, len(parts), 2):
        for name in names:
            parts[k] = re.sub(rf"\b{name}\b(?!##)(?!\()", f"{name}()", parts[k])
    return "".join(parts).replace("##", "")


def copy_with_factors(folder, left_out):
    """Copies the committed sources with constants that can be multiplied; their names."""
    tree = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", folder], input=tree, check=True)
    sources = folder / METHOD
    texts = {path: path.read_text() for path in sorted(sources.rglob("*.rs"))}
    declared = {p: [m for m in CONSTANT.finditer(t) if m[3] not in left_out] for p, t in texts.items()}
    # Modules below see what a folder's own file has for itself.
    public = {m[3] for path, found in declared.items() for m in found if m[2] or path.name == "mod.rs"}
    names = []
    for path, text in texts.items():
        own = {m[3] for m in declared[path]}
        changed = rewritten(text, path.relative_to(sources).with_suffix(""), names, left_out)
        path.write_text(with_calls(changed, public | own))
    library = sources / "lib.rs"
    text = re.sub(r"#!\[(?:deny|forbid|warn)[^\]]*\]", "", library.read_text())
    library.write_text(text + "\n#[allow(missing_docs)]\nmod sensitivity;\n")
    (sources / "sensitivity.rs").write_text(READER)
    # Elsewhere the settings' constants are read.
    for path in (folder / "shared/tools/offline/src").rglob("*.rs"):
        parts = KEPT.split(path.read_text())
        for k in range(0, len(parts), 2):
            of_method = rf"((?:Global|Window|Loop|Relocalise)Settings::(?:{'|'.join(sorted(public))}))\b(?!\()"
            parts[k] = re.sub(of_method, r"\1()", parts[k])
        path.write_text("".join(parts))
    return names


def build(folder):
    """Builds the copy; constants that a constant is made of are named by the compiler."""
    command = ["cargo", "build", "--release", "-p", "tessera-offline", "--example", "run_sequence"]
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    environment = os.environ | {"CARGO_TARGET_DIR": str(target)}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    in_constants = r"cannot call non-const (?:associated )?function `(?:\w+::)*([A-Z0-9_]+)(?: as[^`]*)?`"
    found = set(re.findall(in_constants, done.stderr))
    if done.returncode != 0 and not found:
        raise SystemExit(done.stderr)
    return target / "release/examples/run_sequence", found


def measure(program, factor):
    data = pathlib.Path(os.environ.get("TESSERA_SHARED", ROOT.parent / "shared")).resolve() / "data"
    figures = {}
    for name, arguments in SEQUENCES.items():
        command = [str(program), *(a.format(data=data) for a in arguments), "--json"]
        environment = os.environ | {"TESSERA_FACTOR": factor}
        out = subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True).stdout
        for seed, line in enumerate(line for line in out.splitlines() if line.startswith("{")):
            figures[f"{name} {seed}"] = [json.loads(line)[key] for key in KEYS]
    return figures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--factor", type=float, default=2.0)
    parser.add_argument("--only", nargs="+", default=[""], help="constants whose name contains one of these")
    arguments = parser.parse_args()
    left_out = {"N_UPPER", "WIDTH", "HEIGHT", "N_FERNS", "N_QUERIES", "NO_KEYFRAME", "REQUEST"}
    with tempfile.TemporaryDirectory() as folder:
        while True:
            # Each round starts anew, for the names of what is left out are in all files.
            copy = pathlib.Path(folder) / str(len(left_out))
            copy.mkdir()
            names = copy_with_factors(copy, left_out)
            program, more = build(copy)
            if not more - left_out:
                break
            left_out |= more
        usual = measure(program, "")
        print("left out:", ", ".join(sorted(left_out)), flush=True)
        rows, n_alike = [], 0
        for name in (n for n in names if any(only in n for only in arguments.only)):
            figures = measure(program, f"{name}={arguments.factor}")
            if figures == usual:
                n_alike += 1
                continue
            ratios = [max(f[k] / u[k] for f, u in zip(figures.values(), usual.values())) for k in range(2)]
            rows.append((max(ratios), name, figures))
            print(f"{max(ratios):.2f} {name}", flush=True)
    print(f"{n_alike} change nothing here. The others by their worst ratio of an error to the usual one:")
    for ratio, name, figures in sorted(rows, reverse=True):
        errors = "  ".join(f"{f[0]:.4f}/{f[1]:.4f}/{f[2]:.2f}" for f in figures.values())
        print(f"{ratio:.2f}  {name}  {errors}")


if __name__ == "__main__":
    main()
