#!/usr/bin/env python3
"""What a run says of wrong depth units and of a wrong lens, and whether it is silent with the right camera.

    scripts/wrong_camera.py [--tessera target/release/tessera] [--frames 300] [--focal 1.17]... FOLDER...
    scripts/wrong_camera.py --right [--seeds 5] FOLDER|WORLD...

The first plants errors in the camera of each folder: depth units of five times and a fifth, focal
lengths 10 % too short and too long (or by the factors of --focal alone), with and without the ground truth. The second changes nothing
but the seed of the samples (of the world itself for simulated ones) and counts verdicts. Both print
rows for docs/verdict.md. Needs nothing but Python.
"""

import argparse
import json
import pathlib
import re
import subprocess
import tempfile

# Name, factor on units_per_metre, factor on the focal lengths.
ERRORS = [
    ("none", 1.0, 1.0),
    ("units x 5", 5.0, 1.0),
    ("units / 5", 0.2, 1.0),
    ("focal length -10 %", 1.0, 0.9),
    ("focal length +10 %", 1.0, 1.1),
]


def camera_with(text, units, focal):
    def scaled(keys, factor, text):
        return re.sub(rf"(?m)^({keys})\s*=\s*([0-9.eE+-]+)", lambda m: f"{m[1]} = {float(m[2]) * factor!r}", text)

    return scaled("fx|fy", focal, scaled("units_per_metre", units, text))


def run(tessera, source, folder, *arguments):
    out = folder / "out"
    subprocess.run(["rm", "-rf", out], check=True)
    command = [tessera, "run", source, "--quiet", "--out", out, "--set", "output.report=false", *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    if not (out / "summary.json").is_file():
        words = done.stderr.strip().splitlines()
        return None, "refused: " + words[-1].split(": ", 2)[-1] if words else "refused"
    return json.loads((out / "summary.json").read_text()), ""


def words(summary):
    """The verdict, and in short what it was given for."""
    short = {
        "focal length of about": "lens",
        "positions are off": "positions, by the ground truth",
        "against the ground truth": "units, by the ground truth",
        "unlike a sensor": "units, by depth",
        "camera": "camera, by the name",
        "not tracked": "not tracked",
        "never joined": "submaps",
        "uncertain": "uncertain",
        "degenerate": "degenerate",
        "rejected": "rejected loops",
    }
    verdict = summary["verdict"]
    reasons = [reason["found"] for reason in verdict["reasons"] if reason["grade"] != "good"]
    found = dict.fromkeys(next((s for k, s in short.items() if k in reason), reason) for reason in reasons)
    return f"{verdict['grade']}: {'; '.join(found)}" if found else verdict["grade"]


def metres(summary):
    accuracy = summary.get("final") or summary.get("accuracy") or {}
    return f"{accuracy['ate_rmse_m']:.3f}" if accuracy.get("ate_rmse_m") is not None else "-"


def planted(arguments):
    print("| Sequence | Error planted | ATE (m) | Verdict | Without ground truth | With `--refine-camera` |\n|-|-|-|-|-|-|")
    for sequence in map(pathlib.Path, arguments.sources):
        text = (sequence / "camera.toml").read_text()
        errors = [(f"focal length x {focal}", 1.0, focal) for focal in arguments.focal] or ERRORS
        for name, units, focal in errors:
            with tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                (folder / "camera.toml").write_text(camera_with(text, units, focal))
                # Without its name and its truth a recording can only be judged by its frames.
                blind = folder / "recording"
                blind.mkdir()
                for entry in sequence.iterdir():
                    if entry.name not in ("groundtruth.txt", "camera.toml"):
                        (blind / entry.name).symlink_to(entry.resolve())
                common = ["--camera", folder / "camera.toml", "--frames", str(arguments.frames)]
                cells = [run(arguments.tessera, source, folder, *common) for source in (sequence, blind)]
                cells.append(run(arguments.tessera, blind, folder, *common, "--refine-camera"))
                said = [refused or words(summary) for summary, refused in cells]
                ate = metres(cells[0][0]) if cells[0][0] else "-"
                print(f"| {sequence.name} | {name} | {ate} | {' | '.join(said)} |", flush=True)


def right(arguments):
    print("| Source | Verdicts | Reasons |\n|-|-|-|")
    for source in arguments.sources:
        grades, reasons = {}, {}
        for seed in range(arguments.seeds):
            with tempfile.TemporaryDirectory() as folder:
                key = "registration.seed" if pathlib.Path(source).is_dir() else "simulation.seed"
                seeded = ["--frames", str(arguments.frames), "--set", f"{key}={seed + 1}"]
                summary, refused = run(arguments.tessera, source, pathlib.Path(folder), *seeded)
                said = refused or words(summary)
                grade, _, why = said.partition(": ")
                grades[grade] = grades.get(grade, 0) + 1
                if why:
                    reasons[why] = reasons.get(why, 0) + 1
        count = lambda table: ", ".join(f"{n} x {what}" for what, n in table.items())
        print(f"| {pathlib.Path(source).name} | {count(grades)} | {count(reasons) or 'none'} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", default="target/release/tessera")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--focal", type=float, action="append", default=[], metavar="FACTOR")
    parser.add_argument("--right", action="store_true")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("sources", nargs="+", metavar="SOURCE")
    arguments = parser.parse_args()
    (right if arguments.right else planted)(arguments)


if __name__ == "__main__":
    main()
