"""RGB-D SLAM: depth and colour images in, trajectory and map out.

    import tessera

    slam = tessera.Slam(tessera.Camera(640, 480, 525.0, 525.0, 319.5, 239.5, units_per_metre=1000))
    for t, depth, colour in frames:
        frame = slam.track(depth, colour, t)
    stamps, poses = slam.trajectory()

It runs in this process and gives the same numbers as the command `tessera run`. Poses are 4x4
matrices `world_from_camera`, metres; the camera's axes are x right, y down, z forward.
"""

from __future__ import annotations

import json
import pathlib
from typing import NamedTuple

import numpy as np

from . import _tessera
from ._tessera import Camera

__all__ = ["Camera", "Frame", "Map", "Run", "Slam", "Trajectory", "read_run"]


class Frame(NamedTuple):
    """What became of a frame."""

    index: int
    #: `tracking`, or `lost`: the pose is a prediction.
    state: str
    #: 4x4, as first known; `Slam.trajectory` has it with later corrections.
    world_from_camera: np.ndarray
    #: 6x6 of translation and rotation along the camera's axes, m and rad; `None` where it is lost.
    covariance: np.ndarray | None


class Trajectory(NamedTuple):
    """Poses in the order of time."""

    #: Seconds, N.
    stamps: np.ndarray
    #: Nx4x4.
    world_from_camera: np.ndarray


class Map(NamedTuple):
    """Points of the map."""

    #: Nx3, metres.
    positions: np.ndarray
    #: Nx3.
    normals: np.ndarray
    #: Nx3, red, green, blue, 8 bits.
    colours: np.ndarray


class Slam:
    """A run in this process: give it frames, one after the other."""

    def __init__(self, camera: Camera, config: str | None = None, settings: dict[str, object] | None = None):
        """`config`: a preset (`fast`, `onboard`, `paper`) or a file; `settings`: as {"surface.step": 2}."""
        overrides = [f"{key}={_toml(value)}" for key, value in (settings or {}).items()]
        self._slam = _tessera.Slam(camera, config, overrides)
        self._camera = camera

    def track(self, depth, colour=None, t: float | None = None) -> Frame:
        """Processes the next frame.

        `depth`: height x width, uint16 in the camera's units, or floating point in metres; 0, NaN and
        infinity mean no measurement. `colour`: height x width x 3, uint8, red, green, blue, registered
        to depth. `t`: seconds, rising; without it 30 frames a second are assumed.
        """
        if t is None:
            self._next = getattr(self, "_next", -1) + 1
            nanos = round(self._next * 1e9 / 30)
        else:
            nanos = _nanos(t)
        raw = _depth(depth, self._camera)
        rgb = None if colour is None else _colour(colour, self._camera)
        index, state, pose, upper = self._slam.track(raw, rgb, nanos)
        return Frame(index, state, np.array(pose).reshape(4, 4), _covariance(upper))

    def finish(self) -> None:
        """The final optimisation of all keyframes. After it no frame can be given."""
        self._slam.finish()

    def trajectory(self) -> Trajectory:
        """All frames so far with the corrections so far; after `finish` what `trajectory.txt` has."""
        stamps, poses = self._slam.trajectory()
        poses = np.frombuffer(poses, "<f8").reshape(-1, 4, 4).copy()
        return Trajectory(np.array(stamps, np.int64) * 1e-9, poses)

    def map(self) -> Map:
        """The points of `map.ply`. Calls `finish`."""
        positions, normals, colours = self._slam.map()
        floats = lambda data: np.frombuffer(data, "<f4").reshape(-1, 3).copy()
        return Map(floats(positions), floats(normals), np.frombuffer(colours, np.uint8).reshape(-1, 3).copy())


class Run(NamedTuple):
    """What `tessera run` wrote."""

    summary: dict
    trajectory: Trajectory
    keyframes: Trajectory
    map: Map


def read_run(folder) -> Run:
    """Reads the folder of a run: `summary.json`, `trajectory.txt`, `keyframes.txt` and `map.ply`."""
    folder = pathlib.Path(folder)
    summary = json.loads((folder / "summary.json").read_text())
    return Run(summary, _tum(folder / "trajectory.txt"), _tum(folder / "keyframes.txt"), _ply(folder / "map.ply"))


def _toml(value) -> str:
    return json.dumps(value)


def _nanos(t) -> int:
    if not np.isfinite(t) or abs(t) > 9e9:
        raise ValueError(f"t is {t}, expected seconds")
    return round(float(t) * 1e9)


def _depth(depth, camera) -> bytes:
    depth = np.asarray(depth)
    expected = (camera.height, camera.width)
    if depth.shape != expected:
        raise ValueError(f"depth has shape {depth.shape}, expected {expected} as the camera says")
    if depth.dtype == np.uint16:
        return depth.astype("<u2", copy=False).tobytes()
    if not np.issubdtype(depth.dtype, np.floating):
        raise TypeError(f"depth is {depth.dtype}, expected uint16 in units or floating point in metres")
    raw = np.rint(np.nan_to_num(depth, nan=0.0, posinf=0.0, neginf=0.0) * camera.units_per_metre)
    # Behind the camera, or beyond what 16 bits hold: no measurement.
    return np.where((raw >= 1) & (raw < 65535), raw, 0).astype("<u2").tobytes()


def _colour(colour, camera) -> bytes:
    colour = np.asarray(colour)
    expected = (camera.height, camera.width, 3)
    if colour.dtype != np.uint8:
        raise TypeError(f"colour is {colour.dtype}, expected uint8")
    if colour.shape != expected:
        raise ValueError(f"colour has shape {colour.shape}, expected {expected} as the camera says")
    return colour.tobytes()


def _covariance(upper):
    if not upper:
        return None
    covariance = np.zeros((6, 6))
    covariance[np.triu_indices(6)] = upper
    return covariance + np.triu(covariance, 1).T


def _tum(path) -> Trajectory:
    rows = np.loadtxt(path, ndmin=2) if path.stat().st_size else np.zeros((0, 8))
    rows = rows.reshape(-1, 8)
    x, y, z, w = rows[:, 4:].T
    poses = np.zeros((len(rows), 4, 4))
    poses[:, :3, 3], poses[:, 3, 3] = rows[:, 1:4], 1.0
    poses[:, 0, 0], poses[:, 0, 1], poses[:, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    poses[:, 1, 0], poses[:, 1, 1], poses[:, 1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    poses[:, 2, 0], poses[:, 2, 1], poses[:, 2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    return Trajectory(rows[:, 0], poses)


_PLY = {"float": "<f4", "uchar": "u1", "double": "<f8", "int": "<i4", "uint": "<u4"}


def _ply(path) -> Map:
    data = path.read_bytes()
    end = data.find(b"end_header\n")
    head = data[:end].decode("ascii").splitlines()
    if end < 0 or "format binary_little_endian 1.0" not in head:
        raise ValueError(f"{path}: expected binary little-endian PLY")
    n = next(int(line.split()[2]) for line in head if line.startswith("element vertex"))
    fields = [(line.split()[2], _PLY[line.split()[1]]) for line in head if line.startswith("property") and "list" not in line]
    points = np.frombuffer(data, np.dtype(fields), n, end + len("end_header\n"))
    columns = lambda names, kind: np.stack([points[name] for name in names], 1).astype(kind)
    return Map(
        columns(("x", "y", "z"), np.float32),
        columns(("nx", "ny", "nz"), np.float32),
        columns(("red", "green", "blue"), np.uint8),
    )
