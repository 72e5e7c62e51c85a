#!/usr/bin/env python3
"""CPU time of each stage alone on its recorded input, beside the committed baseline.

    scripts/speed.py                        # compares with tests/data/speed.toml
    scripts/speed.py --tessera OLD --write  # makes the result the baseline of this machine
    scripts/speed.py --against OLD          # two builds in turn on the same input, by medians

CPU time depends on the machine: a baseline holds for the processor that it names, and on another one nothing is
compared but by --against, where a stage passes with at most 3 % more. A stage passes the baseline where its median
is not above the baseline's largest. Leaves 1 as its exit code where one does not pass.
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
BASELINE = ROOT / "tests/data/speed.toml"
STAGES = ["reconstruct", "align", "optimise"]
# A simulated room: every machine has it.
SEQUENCE = ["room", "--frames", "200"]
MOST_MORE = 1.03


def processor():
    """The processor's name as Linux has it."""
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    named = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else "unknown"


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


def measure(builds, rounds):
    """For each build and stage the median, least and most of several rounds, builds in turn."""
    found = {build: {} for build in builds}
    with tempfile.TemporaryDirectory() as folder:
        for stage in STAGES:
            inputs = {build: record(build, stage, pathlib.Path(folder)) for build in builds}
            times = {build: [] for build in builds}
            for _ in range(rounds):
                for build in builds:
                    times[build].append(cpu_ms(build, stage, inputs[build]))
            for build in builds:
                inputs[build].unlink()
                found[build][stage] = (statistics.median(times[build]), min(times[build]), max(times[build]))
    return found


def main():
    """Measures, prints and compares."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", type=pathlib.Path, default=ROOT / "target/release/tessera")
    parser.add_argument("--against", type=pathlib.Path, help="another build, measured in turn")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--write", action="store_true", help="make the result the baseline")
    arguments = parser.parse_args()
    builds = [arguments.tessera] + ([arguments.against] if arguments.against else [])
    found = measure(builds, arguments.rounds)
    for build, stages in found.items():
        for stage, (median, least, most) in stages.items():
            print(f"{build}: {stage}: {median:.3f} ms of CPU a frame, {least:.3f} to {most:.3f}")
    own = found[arguments.tessera]
    if arguments.write:
        rows = "".join(f"{stage} = [{', '.join(f'{value:.3f}' for value in row)}]\n" for stage, row in own.items())
        BASELINE.write_text(
            "# CPU milliseconds of a frame: median, least, most. Written by scripts/speed.py --write.\n"
            f'processor = "{processor()}"\n\n[cpu_ms]\n{rows}'
        )
        return 0
    slower = []
    if arguments.against:
        old = found[arguments.against]
        slower = [stage for stage in STAGES if own[stage][0] > MOST_MORE * old[stage][0]]
    elif not BASELINE.exists():
        print(f"no baseline: {BASELINE.relative_to(ROOT)} is written by --write")
    else:
        baseline = tomllib.loads(BASELINE.read_text())
        if baseline["processor"] != processor():
            print(f"not compared: the baseline is of {baseline['processor']}, this is {processor()}")
        else:
            slower = [stage for stage in STAGES if own[stage][0] > baseline["cpu_ms"][stage][2]]
    if slower:
        print(f"slower than the baseline: {', '.join(slower)}")
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
