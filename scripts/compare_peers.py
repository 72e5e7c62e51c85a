#!/usr/bin/env python3
"""Tessera beside others' alignments: the same frames, one thread, CPU time, in one run.

    python3 -m venv target/peers && target/peers/bin/pip install small_gicp open3d opencv-python-headless
    cargo build --release --bin tessera
    target/peers/bin/python scripts/compare_peers.py ../shared/data/kitchen_450 --frames 60

A peer whose wheel is not installed is left out, and the output says so.
CPU times are medians over consecutive frames; image decoding is apart. Each peer keeps what it made of the
last frame, where its interface allows that: a frame is preprocessed once, and its cost counts once. Each starts
from the last motion. For each, several settings are tried; the output has all of them, with the error of the
motion from frame to frame where the sequence has a ground truth: a setting is good only if that is small.
Tessera's time is the mean over its run through all processes: reconstruct, align and optimise, with the final
optimisation.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import argparse
import json
import math
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


def stamps(folder, n_frames):
    """Stamps of depth.txt, seconds."""
    lines = (folder / "depth.txt").read_text().splitlines()
    return [float(line.split()[0]) for line in lines if line.strip() and not line.startswith("#")][:n_frames]


def poses_at(path, at):
    """Pose of a trajectory at each stamp as a 4x4 matrix, by the nearest row within 20 ms, or none; none at all
    without the file."""
    import numpy

    if not path.is_file():
        return None
    rows = [line.split() for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    rows = numpy.array(rows, dtype=numpy.float64)
    poses = []
    for stamp in at:
        row = rows[numpy.argmin(numpy.abs(rows[:, 0] - stamp))]
        if abs(row[0] - stamp) > 0.02:
            poses.append(None)
            continue
        x, y, z, w = row[4:8] / numpy.linalg.norm(row[4:8])
        pose = numpy.eye(4)
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        pose[:3, 3] = row[1:4]
        poses.append(pose)
    return poses


def step_error_mm(poses, motions):
    """Root mean square of the error of motions in translation, millimetres: the k-th leads to frame k + 1."""
    import numpy

    errors = []
    for before, after, motion in zip(poses or [], (poses or [])[1:], motions):
        if before is not None and after is not None and motion is not None:
            true = numpy.linalg.inv(before) @ after
            errors.append(numpy.linalg.norm((numpy.linalg.inv(true) @ motion)[:3, 3]))
    return 1e3 * (sum(e * e for e in errors) / len(errors)) ** 0.5 if errors else float("nan")


def measure(inputs, prepare, align, poses):
    """Median CPU time of a frame, milliseconds, and the root mean square of its error in translation, millimetres.

    `prepare` turns an input into what `align` takes two of, with the last motion as the initial guess.
    """
    import numpy

    times, motions = [], []
    last, motion = prepare(inputs[0]), numpy.eye(4)
    for item in inputs[1:]:
        before = time.process_time()
        prepared = prepare(item)
        motion = align(last, prepared, motion)
        times.append(1e3 * (time.process_time() - before))
        motions.append(motion)
        last = prepared
    return statistics.median(times), step_error_mm(poses, motions)


def small_gicp_rows(frames, camera, poses):
    import small_gicp

    clouds = [cloud(depth, camera) for depth in frames]

    def align(kind):
        def of_pair(target, source, guess):
            result = small_gicp.align(
                target[0],
                source[0],
                target_tree=target[1],
                init_T_target_source=guess,
                registration_type=kind,
                max_correspondence_distance=0.1,
                num_threads=1,
            )
            return result.T_target_source

        return of_pair

    for kind in ("GICP", "PLANE_ICP"):
        for size in (0.1, 0.05, 0.02):
            name = f"small_gicp {kind}, frame to frame, {100 * size:.0f} cm voxels"
            prepare = lambda points: small_gicp.preprocess_points(points, downsampling_resolution=size, num_threads=1)
            yield name, *measure(clouds, prepare, align(kind), poses)


def open3d_rows(frames, camera, poses):
    import open3d
    import open3d.t.pipelines.odometry as odometry

    core = open3d.core
    matrix = core.Tensor([[camera["fx"], 0.0, camera["cx"]], [0.0, camera["fy"], camera["cy"]], [0.0, 0.0, 1.0]])

    def image(depth):
        colour = core.Tensor.ones((*depth.shape, 3), core.uint8)
        return open3d.t.geometry.RGBDImage(open3d.t.geometry.Image(colour), open3d.t.geometry.Image(core.Tensor(depth)))

    images = [image(depth) for depth in frames]
    criteria = odometry.OdometryConvergenceCriteria

    def align(counts):
        def of_pair(target, source, guess):
            # Its interface makes the pyramids of both frames for each pair.
            result = odometry.rgbd_odometry_multi_scale(
                source,
                target,
                matrix,
                core.Tensor(guess),
                depth_scale=1.0,
                depth_max=8.0,
                criteria_list=[criteria(count) for count in counts],
                method=odometry.Method.PointToPlane,
            )
            return result.transformation.numpy()

        return of_pair

    for counts in ([10, 5, 3], [5, 3, 0]):
        name = f"Open3D tensor odometry, point to plane, {counts} iterations"
        yield name, *measure(images, lambda rgbd: rgbd, align(counts), poses)


def opencv_rows(frames, camera, poses):
    import cv2
    import numpy

    cv2.setNumThreads(1)
    matrix = numpy.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]], numpy.float32)
    holed = [numpy.where(depth > 0.0, depth, numpy.nan) for depth in frames]
    for kind, algorithm in (("common", cv2.ODOMETRY_ALGO_TYPE_COMMON), ("fast", cv2.ODOMETRY_ALGO_TYPE_FAST)):
        settings = cv2.OdometrySettings()
        settings.setCameraMatrix(matrix)
        odometry = cv2.Odometry(cv2.ODOMETRY_TYPE_DEPTH, settings, algorithm)

        def prepare(depth):
            frame = cv2.OdometryFrame(depth=depth)
            odometry.prepareFrame(frame)
            return frame

        def align(target, source, guess):
            # It takes no initial guess.
            is_found, motion = odometry.compute(source, target)
            return motion if is_found else numpy.eye(4)

        try:
            yield f"OpenCV Odometry, depth, {kind}", *measure(holed, prepare, align, poses)
        except cv2.error as error:
            print(f"skipped: OpenCV Odometry, depth, {kind}: {str(error).splitlines()[0]}", file=sys.stderr)


def orb_rows(folder, n_frames):
    """OpenCV's ORB on the colour images in grey, without matching: no odometry, but what features alone cost."""
    import cv2

    cv2.setNumThreads(1)
    if not (folder / "rgb.txt").is_file():
        return
    lines = (folder / "rgb.txt").read_text().splitlines()
    paths = [folder / line.split()[1] for line in lines if line.strip() and not line.startswith("#")]
    images = [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in paths[:n_frames]]
    for n_features in (500, 400):
        orb, times = cv2.ORB_create(nfeatures=n_features), []
        for image in images:
            before = time.process_time()
            orb.detectAndCompute(image, None)
            times.append(1e3 * (time.process_time() - before))
        yield f"OpenCV ORB, {n_features} features, alone", statistics.median(times), float("nan")


def tessera_run(program, folder, n_frames):
    """CPU of Tessera's stages without the sensor, milliseconds a frame; and its online trajectory's motions."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "out"
        line = [program, "run", folder, "--frames", str(n_frames), "--preload", "--quiet"]
        line += ["--name", f"peers-{os.getpid()}", "--out", out]
        subprocess.run(line, check=True)
        cpu = json.loads((out / "summary.json").read_text())["cpu_ms_per_frame"]
        motions = motions_of(out / "trajectory_online.txt", stamps(folder, n_frames))
    return {stage: cpu[stage] for stage in ("reconstruct", "align", "optimise")}, motions


def motions_of(path, at):
    """The motion to each frame from the one before; none where numpy is missing."""
    try:
        import numpy
    except ImportError:
        return []
    poses = poses_at(path, at) or []
    known = lambda pair: pair[0] is not None and pair[1] is not None
    return [numpy.linalg.inv(pair[0]) @ pair[1] if known(pair) else None for pair in zip(poses, poses[1:])]


def written(error_mm):
    return "" if math.isnan(error_mm) else f"{error_mm:.1f}"


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
    own, motions = tessera_run(arguments.tessera, arguments.sequence, arguments.frames)
    total = sum(own.values())
    parts = ", ".join(f"{stage} {ms:.2f}" for stage, ms in own.items())
    print("| System | CPU ms a frame | Times Tessera's | Error a frame, mm |\n|-|-|-|-|")
    own_row = f"| Tessera ({parts}) | {total:.2f} | 1 |"
    try:
        frames, camera = load(arguments.sequence, arguments.frames)
        poses = poses_at(arguments.sequence / "groundtruth.txt", stamps(arguments.sequence, arguments.frames))
    except ImportError as missing:
        print(f"{own_row} |")
        print(f"skipped: all peers, {missing} (pip install opencv-python-headless)", file=sys.stderr)
        return
    print(f"{own_row} {written(step_error_mm(poses, motions))} |", flush=True)
    peers = [lambda rows=rows: rows(frames, camera, poses) for rows in (small_gicp_rows, open3d_rows, opencv_rows)]
    for rows in [*peers, lambda: orb_rows(arguments.sequence, arguments.frames)]:
        try:
            for name, ms, error_mm in rows():
                print(f"| {name} | {ms:.2f} | {ms / total:.2f} | {written(error_mm)} |", flush=True)
        except ImportError as missing:
            print(f"skipped: {missing}", file=sys.stderr)


if __name__ == "__main__":
    main()
