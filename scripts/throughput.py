#!/usr/bin/env python3
"""Frames a second through all processes, frames held in memory, and what of the time the aligner
waited for corrections.

    scripts/throughput.py [--tessera target/release/tessera] [--runs 3] SEQUENCE...

Of each run with --preload and --trace: from the aligner's first frame to its last, and the gaps
before the frames at which corrections took effect (log.txt names them). Needs nothing but Python.
"""

import argparse
import json
import pathlib
import re
import statistics
import subprocess
import tempfile


def measure(tessera, sequence, folder):
    out, trace = folder / "out", folder / "trace.json"
    subprocess.run([tessera, "run", sequence, "--preload", "--quiet", "--out", out, "--trace", trace], check=True)
    events = json.loads(trace.read_text())["traceEvents"]
    align = next(e["pid"] for e in events if e["name"] == "process_name" and e["args"]["name"] == "align")
    frames = sorted(
        (e["args"]["frame"], e["ts"], e["ts"] + e["dur"])
        for e in events
        if e["ph"] == "X" and e["cat"] == "frame" and e["pid"] == align
    )
    log = (out / "log.txt").read_text()
    corrected = {int(frame) for frame in re.findall(r"correction \d+ takes effect frame=(\d+)", log)}
    # A correction at the end of the run comes after the last frame and is in no gap.
    gaps = [later[1] - earlier[2] for earlier, later in zip(frames, frames[1:]) if later[0] in corrected]
    seconds = 1e-6 * (frames[-1][2] - frames[0][1])
    return len(frames) / seconds, 1e3 * seconds, 1e-3 * sum(gaps), len(gaps)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tessera", default="target/release/tessera")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("sequences", nargs="+", metavar="SEQUENCE")
    arguments = parser.parse_args()
    for sequence in arguments.sequences:
        found = []
        for _ in range(arguments.runs):
            with tempfile.TemporaryDirectory() as folder:
                found.append(measure(arguments.tessera, sequence, pathlib.Path(folder)))
        rate, total, waited, n = (statistics.median(column) for column in zip(*found))
        rates = ", ".join(f"{run[0]:.0f}" for run in sorted(found))
        print(
            f"{sequence}: {rate:.0f} frames/s ({rates}), {total:.0f} ms in all, "
            f"{waited:.1f} ms of them before the {n:.0f} frames at which corrections took effect"
        )


if __name__ == "__main__":
    main()
