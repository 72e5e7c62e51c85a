#!/usr/bin/env python3
"""A day of simulated time: a robot goes round and round, and memory has a bound.

    scripts/day.py [--hours H] [--source SCENE] [--budget KEYFRAMES]      (24 hours, room, 100 keyframes)

Frames are those of 30 a second for so many hours, worked as fast as the machine can: about 7 hours for a day at 100
frames a second. The camera is small (160x120). TESSERA names the program [target/release/tessera].
Ends with 1 where a frame was not tracked, or where a stage took more memory of its own (no mapped files) after the
first third than in it, by more than a fifth and 4 MB, while the run went on. The final optimisation, which solves for all
frames again, is told apart: its memory grows with their number (50 MB for 10,800 frames of the room).
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

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
        samples = watched(subprocess.Popen(command), out, min(5.0, 300 * arguments.hours / 24))
        summary = json.loads((out / "summary.json").read_text())
        disk = {name: (out / name).stat().st_size for name in ("align.journal", "optimise.journal", "keyframes.store")}
        # A store has holes where surfaces were given up.
        disk["keyframes.store"] = 512 * (out / "keyframes.store").stat().st_blocks
    failures = judged(summary, samples, disk, n_frames)
    for failure in failures:
        print(failure, file=sys.stderr)
    sys.exit(1 if failures else 0)


def watched(run, out, interval_s):
    """Runs to the end; bytes of the journal and memory of each stage, again and again."""
    samples = []
    while (status := run.poll()) is None:
        journal = out / "align.journal"
        if journal.exists():
            samples.append((journal.stat().st_size, {stage: own_mb(f"stage {stage} --run-dir {out}") for stage in STAGES}))
        time.sleep(interval_s)
    if status != 0:
        sys.exit(f"tessera ended with {status}")
    return samples


def own_mb(words):
    """Memory of the process with those words that is no mapped file; 0 where it is gone."""
    for process in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            if words in (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"):
                lines = (process / "status").read_text().splitlines()
                return sum(int(line.split()[1]) / 1000 for line in lines if line.startswith("RssAnon"))
        except OSError:
            pass  # It has ended meanwhile.
    return 0.0


def judged(summary, samples, disk, n_frames):
    failures = []
    processed, lost = summary["frames_processed"], summary["frames_untracked"]
    hours = n_frames / RATE_HZ / 3600
    print(f"{processed} of {n_frames} frames, {hours:.2f} h of simulated time, {lost} not tracked")
    if processed != n_frames or lost:
        failures.append(f"{n_frames - processed} frames not processed, {lost} not tracked, expected none of either")
    # The sensor ends with its last frame; what the optimiser then solves for is all frames again.
    frames = max((journal for journal, mb in samples if mb["sensor"]), default=0)
    parts = [
        [mb for journal, mb in samples if mb["sensor"] and 3 * journal <= frames],
        [mb for journal, mb in samples if mb["sensor"] and 3 * journal > frames],
        [mb for journal, mb in samples if not mb["sensor"]],
    ]
    for stage in STAGES:
        early, late, final = (max((mb[stage] for mb in part), default=0.0) for part in parts)
        print(f"{stage:12} {early:7.1f} MB in the first third, {late:7.1f} MB behind it, {final:7.1f} MB at the end")
        if late > 1.2 * early + 4.0:
            failures.append(f"{stage} took {late:.1f} MB of its own, expected at most {1.2 * early + 4.0:.1f}")
    for name, size in disk.items():
        print(f"{name:18} {size / 1e6:9.1f} MB, {size / n_frames:6.0f} bytes a frame")
    return failures


if __name__ == "__main__":
    main()
