#!/usr/bin/env python3
"""Tessera beside others' alignments: the same frames, one thread, CPU time, in one run.

    python3 -m venv target/peers && target/peers/bin/pip install small_gicp open3d opencv-python-headless
    cargo build --release --bin tessera
    target/peers/bin/python scripts/compare_peers.py ../shared/data/kitchen_450 --frames 60

A peer whose wheel is not installed is left out, and the output says so.
CPU times are medians over consecutive pairs of frames; image decoding is apart. Tessera's is the mean
over its run through all processes: reconstruct, align and optimise, with the final optimisation.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

STEP = 4


def depth_files(folder):
    """Depth images in the order of depth.txt."""
    lines = (folder / "depth.txt").read_text().splitlines()
    return [folder / line.split()[1] for line in lines if line.strip() and not line.startswith("#")]


def load(folder, n_frames):
    """Depth in metres, float32, 0 where there is none; and the camera."""
    import cv2
    import numpy

    camera = tomllib.loads((folder / "camera.toml").read_text())
    frames = []
    for path in depth_files(folder)[:n_frames]:
        raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if raw is None:
            sys.exit(f"compare_peers: {path} is no image")
        depth = raw.astype(numpy.float32) / camera["units_per_metre"]
        depth[(raw == 65535) | (depth > 8.0)] = 0.0
        frames.append(depth)
    return frames, camera


def cloud(depth, camera):
    """Points of every STEP-th pixel, metres."""
    import numpy

    rows, columns = numpy.mgrid[0 : depth.shape[0] : STEP, 0 : depth.shape[1] : STEP]
    z = depth[::STEP, ::STEP].astype(numpy.float64)
    x = (columns - camera["cx"]) / camera["fx"] * z
    y = (rows - camera["cy"]) / camera["fy"] * z
    return numpy.stack([x, y, z], axis=-1)[z > 0.0]


def median_ms(pairs, align):
    """Median CPU time of `align` over pairs, milliseconds."""
    times = []
    for pair in pairs:
        before = time.process_time()
        align(*pair)
        times.append(1e3 * (time.process_time() - before))
    return statistics.median(times)


def small_gicp_rows(frames, camera):
    import small_gicp

    clouds = [cloud(depth, camera) for depth in frames]
    pairs = list(zip(clouds, clouds[1:]))

    def align(target, source, **kind):
        return small_gicp.align(target, source, num_threads=1, max_correspondence_distance=0.1, **kind)

    for size in (0.05, 0.02):
        name = f"small_gicp GICP, frame to frame, {100 * size:.0f} cm voxels"
        yield name, median_ms(pairs, lambda t, s: align(t, s, registration_type="GICP", downsampling_resolution=size))


def open3d_rows(frames, camera):
    import open3d
    import open3d.t.pipelines.odometry as odometry

    core = open3d.core
    matrix = core.Tensor([[camera["fx"], 0.0, camera["cx"]], [0.0, camera["fy"], camera["cy"]], [0.0, 0.0, 1.0]])

    def image(depth):
        colour = core.Tensor.ones((*depth.shape, 3), core.uint8)
        return open3d.t.geometry.RGBDImage(open3d.t.geometry.Image(colour), open3d.t.geometry.Image(core.Tensor(depth)))

    images = [image(depth) for depth in frames]
    pairs = list(zip(images, images[1:]))
    method = odometry.Method.PointToPlane

    def align(target, source):
        odometry.rgbd_odometry_multi_scale(source, target, matrix, depth_scale=1.0, depth_max=8.0, method=method)

    yield "Open3D tensor odometry, point to plane", median_ms(pairs, align)


def opencv_rows(frames, camera):
    import cv2
    import numpy

    cv2.setNumThreads(1)
    matrix = numpy.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]], numpy.float32)
    settings = cv2.OdometrySettings()
    settings.setCameraMatrix(matrix)
    odometry = cv2.Odometry(cv2.ODOMETRY_TYPE_DEPTH, settings, cv2.ODOMETRY_ALGO_TYPE_COMMON)
    holed = [numpy.where(depth > 0.0, depth, numpy.nan) for depth in frames]

    def align(target, source):
        target, source = (cv2.OdometryFrame(depth=depth) for depth in (target, source))
        odometry.prepareFrames(source, target)
        odometry.compute(source, target)

    yield "OpenCV Odometry, depth", median_ms(list(zip(holed, holed[1:])), align)


def tessera_ms(program, folder, n_frames):
    """CPU of Tessera's stages without the sensor, milliseconds a frame."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "out"
        line = [program, "run", folder, "--frames", str(n_frames), "--preload", "--quiet"]
        line += ["--name", f"peers-{os.getpid()}", "--out", out]
        subprocess.run(line, check=True)
        cpu = json.loads((out / "summary.json").read_text())["cpu_ms_per_frame"]
    return {stage: cpu[stage] for stage in ("reconstruct", "align", "optimise")}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=Path, help="a folder in the TUM layout with camera.toml")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--tessera", type=Path, default=Path("target/release/tessera"))
    arguments = parser.parse_args()
    if not (arguments.sequence / "depth.txt").is_file():
        sys.exit(f"compare_peers: {arguments.sequence}/depth.txt is not there")
    if not arguments.tessera.is_file():
        sys.exit(f"compare_peers: {arguments.tessera} is not there, run cargo build --release --bin tessera")
    own = tessera_ms(arguments.tessera, arguments.sequence, arguments.frames)
    total = sum(own.values())
    parts = ", ".join(f"{stage} {ms:.2f}" for stage, ms in own.items())
    print("| System | CPU ms a frame | Times Tessera's |\n|-|-|-|")
    print(f"| Tessera ({parts}) | {total:.2f} | 1 |", flush=True)
    try:
        frames, camera = load(arguments.sequence, arguments.frames)
    except ImportError as missing:
        print(f"skipped: all peers, {missing} (pip install opencv-python-headless)", file=sys.stderr)
        return
    for rows in (small_gicp_rows, open3d_rows, opencv_rows):
        try:
            for name, ms in rows(frames, camera):
                print(f"| {name} | {ms:.1f} | {ms / total:.1f} |", flush=True)
        except ImportError as missing:
            print(f"skipped: {missing}", file=sys.stderr)


if __name__ == "__main__":
    main()
