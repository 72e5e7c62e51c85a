#!/usr/bin/env python3
"""CPU time, frames a second and latency of whole runs, and CPU time of each stage alone on its recorded input.

    scripts/speed.py                        # stages alone, compared with tests/data/speed.toml
    scripts/speed.py --against OLD          # stages alone of two builds in turn, by medians
    scripts/speed.py --write                # stages and whole runs: the baseline of this machine, and the pages
    scripts/speed.py --pages                # writes the baseline into the pages, without a run

In docs/performance.md that is the table; elsewhere each number behind <!-- median of NAME: KEY -->. Whole runs are
those of the folders of TESSERA_SHARED (default ../shared) /data, and --write needs all.

CPU time depends on the machine: a baseline holds for the processor that it names, and on another one nothing is
compared but by --against, where a stage passes with at most 3 % more. A stage passes the baseline where its median
is not above the baseline's largest. Leaves 1 as its exit code where one does not pass.
"""

import argparse
import datetime
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import medians
from medians import ROOT

BASELINE = ROOT / "tests/data/speed.toml"
PAGE = ROOT / "docs/performance.md"
STAGES = ["reconstruct", "align", "optimise"]
# A simulated room: every machine has it.
ALONE, SEQUENCE = "room, each stage alone", ["room", "--frames", "200"]
MOST_MORE = 1.03

RECORDINGS = ["kitchen_450", "fr1_rpy_400", "d435_office_400", "fr1_desk_200"]
SURFACES = ["--set", "mapping.features.enabled=false"]
RUNS = {name: [f"{{data}}/{name}"] for name in RECORDINGS}
RUNS |= {f"{name}, surfaces alone": [*RUNS[name], *SURFACES] for name in RECORDINGS[:2]}

# Figures: column, key, decimals, whether less is better (None: it varies with what else runs, and is not compared).
FIGURES = [
    *((f"{stage}, CPU ms", f"{stage}_cpu_ms", 2, True) for stage in STAGES),
    ("all three", "all_cpu_ms", 2, True),
    ("frames/s from files", "frames_per_s", 0, None),
    ("live p50, ms", "live_p50_ms", 1, None),
    ("live p99, ms", "live_p99_ms", 1, None),
]


def processor():
    """The processor's name as Linux has it, with family and model: virtual machines give several one name."""
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    known = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    name, family, model = (known.get(key, "unknown") for key in ("model name", "cpu family", "model"))
    return f"{name} (family {family}, model {model})"


def record(tessera, stage, folder):
    """The input of a stage, which only the version that recorded it can read."""
    path = folder / f"{stage}-{abs(hash(str(tessera)))}"
    subprocess.run([tessera, "record", *SEQUENCE, "--stage", stage, "--out", path], check=True, capture_output=True)
    return path


def cpu_ms(tessera, stage, path):
    """CPU time of a frame, or of a request, in milliseconds."""
    command = [tessera, "profile", stage, path, "--no-steps", "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)["cpu_ms_per_frame"]


def measure_alone(builds, rounds):
    """For each build the figures of its stages, builds in turn."""
    runs = {build: [{} for _ in range(rounds)] for build in builds}
    with tempfile.TemporaryDirectory() as folder:
        for stage in STAGES:
            inputs = {build: record(build, stage, pathlib.Path(folder)) for build in builds}
            for k in range(rounds):
                for build in builds:
                    runs[build][k][f"{stage}_cpu_ms"] = cpu_ms(build, stage, inputs[build])
            for build in builds:
                inputs[build].unlink()
    return {build: medians.spreads(FIGURES, of) for build, of in runs.items()}


def summary(tessera, arguments):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([tessera, "run", *arguments, "--quiet", "--out", f"{folder}/out"], check=True)
        return json.loads(pathlib.Path(folder, "out/summary.json").read_text())


def measure_run(tessera, arguments):
    """Figures of a sequence: of its frames from memory, from files, and at 30 Hz."""
    memory, files, live = (summary(tessera, [*arguments, *more]) for more in (["--preload"], [], ["--live"]))
    cpu, latency = memory["cpu_ms_per_frame"], live["latency_ms"]["end_to_end"]
    found = {f"{stage}_cpu_ms": cpu[stage] for stage in STAGES}
    found |= {"all_cpu_ms": sum(found.values()), "frames_per_s": files["frames_processed"] / files["wall_s"]}
    return found | {"live_p50_ms": latency["p50"], "live_p99_ms": latency["p99"]}


def commands():
    """Arguments of each sequence; ends the script where one is not here."""
    data = pathlib.Path(os.environ.get("TESSERA_SHARED", ROOT.parent / "shared")) / "data"
    found = {name: [argument.replace("{data}", str(data)) for argument in of] for name, of in RUNS.items()}
    missing = {command[0] for command in found.values() if not pathlib.Path(command[0]).is_dir()}
    if missing:
        sys.exit(f"not written: there is no {', '.join(sorted(missing))}")
    return found


def measure_runs(tessera, sequences, rounds):
    """Figures of each sequence, sequences in turn."""
    runs = {name: [] for name in sequences}
    for _ in range(rounds):
        for name, command in sequences.items():
            runs[name].append(measure_run(tessera, command))
    return {name: medians.spreads(FIGURES, of) for name, of in runs.items()}


def write_pages(known):
    rows = {name: row for name, row in known.items() if isinstance(row, dict)}
    text = f"{known['conditions']}\n\n{medians.table(FIGURES, 'sequence', rows)}"
    medians.write_pages(FIGURES, known, PAGE, "speed.py", text)


def write(found, rounds):
    load = f"load {os.getloadavg()[2]:.1f}"
    conditions = f"{datetime.date.today():%-d %B %Y}, {rounds} rounds, {os.cpu_count()} cores of {processor()}, {load}."
    named = {"processor": processor(), "conditions": conditions}
    lines = ["# Written by scripts/speed.py --write: median, least and most over the rounds."]
    lines += [f"{key} = {json.dumps(value)}" for key, value in named.items()]
    medians.write_file(BASELINE, "\n".join(lines), found)
    write_pages(named | found)


def main():
    """Measures, prints and compares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", type=pathlib.Path, default=ROOT / "target/release/tessera")
    parser.add_argument("--against", type=pathlib.Path, help="another build, measured in turn")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--write", action="store_true", help="make the result the baseline, and write it into the pages")
    parser.add_argument("--pages", action="store_true", help="write the baseline into the pages, without a run")
    arguments = parser.parse_args()
    known = medians.read(BASELINE)
    if arguments.pages:
        return write_pages(known)
    sequences = commands() if arguments.write else {}
    builds = [arguments.tessera] + ([arguments.against] if arguments.against else [])
    alone = measure_alone(builds, arguments.rounds)
    for build, found in alone.items():
        print(f"{build}\n{medians.table(FIGURES[:3], 'sequence', {ALONE: found})}")
    own = alone[arguments.tessera]
    if arguments.write:
        found = {ALONE: own} | measure_runs(arguments.tessera, sequences, arguments.rounds)
        print(medians.table(FIGURES, "sequence", found))
        return write(found, arguments.rounds)
    slower = []
    if arguments.against:
        old = alone[arguments.against]
        slower = [key for key, row in own.items() if row[0] > MOST_MORE * old[key][0]]
    elif ALONE not in known:
        print(f"no baseline of stages alone: {BASELINE.relative_to(ROOT)} is written by --write")
    elif known["processor"] != processor():
        print(f"not compared: the baseline is of {known['processor']}, this is {processor()}")
    else:
        slower = medians.worse(FIGURES, own, known[ALONE])
    if slower:
        print(f"slower than the baseline: {', '.join(slower)}")
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
