#!/usr/bin/env python3
"""A day of simulated time: a robot goes round and round, and memory has a bound.

    scripts/day.py [--hours H] [--source SCENE] [--budget KEYFRAMES]      (24 hours, room, 100 keyframes)
    scripts/day.py --images FOLDER --rate HZ                              (slower images: a day in an hour)

Frames are those of 30 a second for so many hours, worked as fast as the machine can: about 7 hours for a day at 100
frames a second. The camera is small (160x120). TESSERA names the program [target/release/tessera].
With --images they are those of a folder, played to and fro with stamps of so many a second; one of the small camera:

    cargo run --release -p tessera-sources --example write_folder -- room FOLDER 7180 CAMERA

Every four hours of stamps it prints frames, memory and disk; where there is ground truth also the ATE of the poses so
far, as they were tracked.
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
FILES = ("align.journal", "optimise.journal", "keyframes.store")
RATE_HZ = 30
TELL_EVERY_H = 4


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--source", default="room")
    parser.add_argument("--budget", type=int, default=100)
    parser.add_argument("--images", type=pathlib.Path, help="folder in the TUM layout, played to and fro")
    parser.add_argument("--out", type=pathlib.Path, help="folder of the run, which is kept")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a setting of the run")
    parser.add_argument("--rate", type=float, default=1.25, help="images a second of --images, by their stamps")
    arguments = parser.parse_args()
    tessera = os.environ.get("TESSERA", str(pathlib.Path(__file__).resolve().parent.parent / "target/release/tessera"))
    rate_hz = arguments.rate if arguments.images else RATE_HZ
    n_frames = int(arguments.hours * 3600 * rate_hz)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        camera, out, name = folder / "camera.toml", arguments.out or folder / "out", f"day-{os.getpid()}"
        camera.write_text(CAMERA)
        source = played(arguments.images, folder / "day", n_frames, rate_hz) if arguments.images else arguments.source
        command = [tessera, "run", str(source), "--quiet", "--frames", str(n_frames), "--out", str(out)]
        command += [] if arguments.images else ["--camera", str(camera)]
        settings = ["surface.step=2", f"mapping.keyframe.budget={arguments.budget}", *arguments.set]
        command += [word for setting in settings for word in ("--set", setting)] + ["--name", name]
        day = Day(tessera, name, out, rate_hz)
        samples = day.watch(subprocess.Popen(command), min(5.0, 300 * arguments.hours / 24))
        summary = json.loads((out / "summary.json").read_text())
        if arguments.images:
            tell_errors(tessera, out, folder / "day/groundtruth.txt", arguments.hours)
        disk = day.disk()
    failures = judged(summary, samples, disk, n_frames, rate_hz)
    for failure in failures:
        print(failure, file=sys.stderr)
    sys.exit(1 if failures else 0)


def played(images, folder, n_frames, rate_hz):
    """A folder with the images of another, to and fro, so many a second."""
    folder.mkdir()
    rows = lambda name: [line.split() for line in (images / name).read_text().splitlines() if not line.startswith("#")]
    for name in ("depth", "rgb", "camera.toml"):
        (folder / name).symlink_to((images / name).resolve())
    for name in ("depth.txt", "rgb.txt", "groundtruth.txt"):
        of = rows(name)
        lap = [*range(len(of)), *range(len(of) - 2, 0, -1)]
        lines = (f"{k / rate_hz:.6f} {' '.join(of[lap[k % len(lap)]][1:])}\n" for k in range(n_frames))
        (folder / name).write_text("".join(lines))
    return folder


class Day:
    """A run that is watched from outside."""

    def __init__(self, tessera, name, out, rate_hz):
        self.tessera, self.name, self.out, self.rate_hz, self.told_h = tessera, name, out, rate_hz, 0
        self.began = time.monotonic()

    def watch(self, run, interval_s):
        """Runs to the end; bytes of the journal and memory of each stage, again and again."""
        samples = []
        while (status := run.poll()) is None:
            journal = self.out / "align.journal"
            if journal.exists():
                mb = {stage: own_mb(f"stage {stage} --run-dir {self.out}") for stage in STAGES}
                samples.append((journal.stat().st_size, mb))
                self.tell(mb)
            time.sleep(interval_s)
        if status != 0:
            sys.exit(f"tessera ended with {status}")
        return samples

    def disk(self):
        disk = {name: (self.out / name).stat().st_size for name in FILES if (self.out / name).exists()}
        # A store has holes where surfaces were given up.
        return disk | {"keyframes.store": 512 * (self.out / "keyframes.store").stat().st_blocks}

    def tell(self, mb):
        """Prints how far it is, every few hours of stamps."""
        words = [self.tessera, "status", self.name, "--json"]
        status = subprocess.run(words, capture_output=True, text=True)
        stages = json.loads(status.stdout)["stages"] if status.returncode == 0 else []
        frames = max((stage["frames"] for stage in stages if stage["stage"] == "align"), default=0)
        hours = frames / self.rate_hz / 3600
        if hours < self.told_h + TELL_EVERY_H:
            return
        self.told_h = TELL_EVERY_H * int(hours / TELL_EVERY_H)
        own = ", ".join(f"{stage} {mb[stage]:.1f}" for stage in STAGES)
        disk = ", ".join(f"{name} {size / 1e6:.1f}" for name, size in self.disk().items())
        minutes = (time.monotonic() - self.began) / 60
        print(f"{hours:5.1f} h, {frames} frames in {minutes:.0f} min; MB: {own}; on disk: {disk}", flush=True)


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


def tell_errors(tessera, out, truth, hours):
    """ATE of the poses of the first hours, as they were tracked, and of all as they are at the end."""
    rows = [line for line in (out / "trajectory_online.txt").read_text().splitlines() if not line.startswith("#")]
    part = truth.with_name("part.txt")
    for until_h in [h for h in range(TELL_EVERY_H, int(hours), TELL_EVERY_H)] + [hours]:
        part.write_text("".join(f"{row}\n" for row in rows if float(row.split()[0]) <= 3600 * until_h))
        print(f"ATE of the first {until_h:g} h as tracked: {ate_m(tessera, part, truth):.4f} m")
    print(f"ATE of all at the end: {ate_m(tessera, out / 'trajectory.txt', truth):.4f} m")


def ate_m(tessera, estimate, truth):
    words = [tessera, "evaluate", estimate, truth, "--json"]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)["ate_rmse_m"]


def judged(summary, samples, disk, n_frames, rate_hz):
    failures = []
    processed, lost = summary["frames_processed"], summary["frames_untracked"]
    hours = n_frames / rate_hz / 3600
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
