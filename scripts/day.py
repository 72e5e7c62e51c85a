#!/usr/bin/env python3
"""A day of simulated time: a robot goes round and round, and memory has a bound.

    scripts/day.py [--hours H] [--source SCENE] [--budget KEYFRAMES]      (24 hours, room, 100 keyframes)

Frames are those of 30 a second for so many hours, worked as fast as the machine can: about 7 hours for a day at 100
frames a second. The camera is small (160x120). TESSERA names the program [target/release/tessera].
Ends with 1 where a frame was not tracked, or where the resident memory of a stage was larger at the end than after the
first third by more than a fifth and 4 MB.
"""

import argparse
import itertools
import json
import os
import pathlib
import subprocess
import sys
import tempfile

CAMERA = "width = 160\nheight = 120\nfx = 131.25\nfy = 131.25\ncx = 79.5\ncy = 59.5\nunits_per_metre = 5000.0\n"
STAGES = ("sensor", "reconstruct", "align", "optimise")
RATE_HZ = 30


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--source", default="room")
    parser.add_argument("--budget", type=int, default=100)
    arguments = parser.parse_args()
    tessera = os.environ.get("TESSERA", str(pathlib.Path(__file__).resolve().parent.parent / "target/release/tessera"))
    n_frames = int(arguments.hours * 3600 * RATE_HZ)
    with tempfile.TemporaryDirectory() as folder:
        camera, out = pathlib.Path(folder, "camera.toml"), pathlib.Path(folder, "out")
        camera.write_text(CAMERA)
        command = [tessera, "run", arguments.source, "--quiet", "--frames", str(n_frames), "--camera", str(camera)]
        command += ["--out", str(out), "--set", "surface.step=2", "--set", f"mapping.keyframe.budget={arguments.budget}"]
        command += ["--name", f"day-{os.getpid()}"]
        if (status := subprocess.run(command).returncode) != 0:
            sys.exit(f"tessera ended with {status}")
        summary = json.loads((out / "summary.json").read_text())
        samples = json.loads((out / "timeline.json").read_text())["samples"]
        disk = {name: (out / name).stat().st_size for name in ("align.journal", "optimise.journal", "keyframes.store")}
        # A store has holes where surfaces were given up.
        disk["keyframes.store"] = 512 * (out / "keyframes.store").stat().st_blocks
    failures = judged(summary, samples, disk, n_frames)
    for failure in failures:
        print(failure, file=sys.stderr)
    sys.exit(1 if failures else 0)


def judged(summary, samples, disk, n_frames):
    failures = []
    processed, lost = summary["frames_processed"], summary["frames_untracked"]
    hours = n_frames / RATE_HZ / 3600
    print(f"{processed} of {n_frames} frames, {hours:.2f} h of simulated time, {lost} not tracked")
    if processed != n_frames or lost:
        failures.append(f"{n_frames - processed} frames not processed, {lost} not tracked, expected none of either")
    # Samples count the frames between them.
    reached = itertools.accumulate(sample["stages"]["align"]["frames"] for sample in samples)
    third = next((sample for sample, n in zip(samples, reached) if 3 * n >= n_frames), samples[-1])
    for stage in STAGES:
        early, late = (sample["stages"][stage]["peak_rss_mb"] for sample in (third, samples[-1]))
        print(f"{stage:12} {early:7.1f} MB after a third, {late:7.1f} MB at the end")
        if late > 1.2 * early + 4.0:
            failures.append(f"{stage} took {late:.1f} MB at the end, expected at most {1.2 * early + 4.0:.1f}")
    for name, size in disk.items():
        print(f"{name:18} {size / 1e6:9.1f} MB, {size / n_frames:6.0f} bytes a frame")
    return failures


if __name__ == "__main__":
    main()
