#!/usr/bin/env python3
"""Runs all sequences and writes what came out beside the committed baseline.

    scripts/accuracy.py                     # all, five seeds; compares with tests/data/accuracy.toml
    scripts/accuracy.py --only fr1_desk_200 room --seeds 3
    scripts/accuracy.py --write             # makes the result the baseline, and writes it into the pages
    scripts/accuracy.py --pages             # writes the baseline into the pages, without a run

In docs/accuracy.md that is the table; elsewhere each number behind <!-- median of SEQUENCE: KEY -->.

Sequences are the folders of TESSERA_SHARED (default ../shared) /data and the simulated worlds; those that are
not there are named and left out. A sequence passes where each median is within the baseline's spread
(least to most over its seeds) or better. Leaves 1 as its exit code where one does not.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys

import medians
from medians import ROOT

BASELINE = ROOT / "tests/data/accuracy.toml"
PAGE = ROOT / "docs/accuracy.md"
HEADER = "# Written by scripts/accuracy.py --write: median, least and most over the seeds."

# Name, arguments of run_sequence; `{data}` is the folder of recordings.
SEQUENCES = {
    "fr1_desk_200": ["{data}/fr1_desk_200"],
    "fr1_desk_200, camera freiburg1": ["{data}/fr1_desk_200", "--camera", "freiburg1"],
    "fr1_rpy_400": ["{data}/fr1_rpy_400"],
    "d435_office_400": ["{data}/d435_office_400"],
    "kitchen_450": ["{data}/kitchen_450"],
    "kitchen_exact_120": ["{data}/kitchen_exact_120"],
    "room": ["room", "--frames", "300"],
    "room with a person": ["room", "--frames", "300", "--simulation", "person = true"],
    "wall": ["wall", "--frames", "300"],
    "corridor": ["corridor", "--frames", "300"],
    "house": ["house", "--frames", "300"],
}
for _fault, _arguments in {
    "colour blurred": ["--colour", "blurred"],
    "colour halved": ["--colour", "halved"],
    "exposure halved": ["--colour", "dim"],
    "90 % of depth missing": ["--holes", "0.9"],
}.items():
    for _name in ["fr1_desk_200", "fr1_rpy_400", "d435_office_400", "room"]:
        SEQUENCES[f"{_name}, {_fault}"] = SEQUENCES[_name] + _arguments
# A rolling shutter of 30 ms that no file states; the D435 has none, and one is stated.
SEQUENCES |= {
    "fr1_rpy_400, readout unstated": SEQUENCES["fr1_rpy_400"] + ["--readout", "0"],
    "room, readout unstated": SEQUENCES["room"] + ["--simulation", "readout_s = 0.03", "--readout", "0"],
    "d435_office_400, readout of 30 ms stated": SEQUENCES["d435_office_400"] + ["--readout", "0.03"],
}

# Figures: column, key, decimals, whether less is better.
FIGURES = [
    ("ATE final, m", "ate_final_m", 4, True),
    ("ATE online, m", "ate_online_m", 4, True),
    ("RPE online, m/s", "rpe_online_m_per_s", 4, True),
    ("within 3 deviations", "within_3_sigma", 3, False),
    ("normalised error", "normalised_error", 2, None),
    ("untracked", "untracked", 0, True),
    ("in other maps", "apart", 0, True),
]


def build():
    command = ["cargo", "build", "--release", "-p", "tessera-offline", "--example", "run_sequence"]
    subprocess.run(command, cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target / "release/examples/run_sequence"


def measure(program, arguments, seeds):
    command = [str(program), *arguments, "--seeds", str(seeds), "--json"]
    out = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return medians.spreads(FIGURES, [json.loads(line) for line in out.splitlines() if line.startswith("{")])


def table(results):
    return medians.table(FIGURES, "sequence", results)


def write_pages(known):
    medians.write_pages(FIGURES, known, PAGE, "accuracy.py", table(known))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--write", action="store_true", help="make the result the baseline, and write it into the pages")
    parser.add_argument("--pages", action="store_true", help="write the baseline into the pages, without a run")
    options = parser.parse_args()
    known = medians.read(BASELINE)
    if options.pages:
        return write_pages(known)
    data = pathlib.Path(os.environ.get("TESSERA_SHARED", ROOT.parent / "shared")) / "data"
    unknown = set(options.only or []) - set(SEQUENCES)
    if unknown:
        sys.exit(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(SEQUENCES)}")
    program = build()
    results = {}
    for name in options.only or SEQUENCES:
        arguments = [argument.replace("{data}", str(data)) for argument in SEQUENCES[name]]
        if "/" in arguments[0] and not pathlib.Path(arguments[0]).is_dir():
            print(f"{name}: left out, there is no {arguments[0]}", file=sys.stderr)
            continue
        results[name] = measure(program, arguments, options.seeds)
        cells = [f"{column} {medians.cell(results[name].get(key), decimals)}" for column, key, decimals, _ in FIGURES]
        print(f"{name}: {'; '.join(cells)}", file=sys.stderr, flush=True)
    print(table(results))
    if options.write:
        known = {name: results.get(name, known.get(name)) for name in SEQUENCES if name in results or name in known}
        medians.write_file(BASELINE, HEADER, known)
        return write_pages(known)
    faults = {name: medians.worse(FIGURES, result, known[name]) for name, result in results.items() if name in known}
    for name, found in faults.items():
        for fault in found:
            print(f"worse: {name}: {fault}")
    sys.exit(1 if any(faults.values()) else 0)


if __name__ == "__main__":
    main()
