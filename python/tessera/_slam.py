"""A run in this process."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, List, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _tessera
from ._tessera import Camera
from ._types import Floats, Loop, Map, Mesh, Trajectory, Verdict, cloud, colour_bytes, depth_bytes, mesh, trajectory, verdict

#: A camera; the keys of a camera file; or a built-in camera's name or a camera file.
CameraLike = Union[Camera, Mapping[str, Any], str, "os.PathLike[str]"]

#: Between frames without a time.
FRAME_NANOS = 10**9 / 30


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Frame:
    """What became of a frame."""

    #: Counted from 0.
    index: int
    #: Nanoseconds.
    stamp_nanos: int
    #: `tracking`: the pose was measured. `degenerate`: it was measured but for a direction that the
    #: surfaces do not determine, as along a wall, where it is a prediction. `lost`: all of it is a
    #: prediction. `relocalising`: it was found again, and the next frames must confirm that.
    state: str
    #: Why it is not `tracking`, in words and numbers; docs/messages.md explains them.
    reason: str
    #: 4x4, metres, as first known; `Slam.trajectory` has it with later corrections.
    world_from_camera: Floats
    #: 6x6 of the pose, translation first, along the camera's axes, m and rad; `None` where it is lost.
    covariance: Optional[Floats]

    def __repr__(self) -> str:
        x, y, z = self.world_from_camera[:3, 3]
        return f"Frame({self.index}, {self.state}, at {x:.3f} {y:.3f} {z:.3f} m)"

    @property
    def is_tracked(self) -> bool:
        """Whether the pose was measured, but for a direction at most."""
        return self.state in ("tracking", "degenerate")


def as_camera(camera: CameraLike) -> Camera:
    if isinstance(camera, Camera):
        return camera
    if isinstance(camera, Mapping):
        return Camera.from_dict(dict(camera))
    return Camera.load(os.fspath(camera))


def overrides(settings: Optional[Mapping[str, Any]]) -> list[str]:
    # What JSON and TOML have in common: numbers, truth values, text and lists of them.
    return [f"{key}={json.dumps(value)}" for key, value in (settings or {}).items()]


class Slam:
    """A run in this process: give it frames, one after the other.

    `camera`: a `Camera`, the keys of a camera file as a dict, a camera file, or the name of a built-in
    camera. `config`: a preset (`fast`, `onboard`, `paper`) or a file. `settings`: single settings, as
    {"surface.step": 2}; those of processes have no effect here. `map`: the folder of an earlier run, in whose
    map this one begins, as `tessera run --map`: the folder itself is left as it is.

    Any thread may call any method; calls wait for one another and let other threads go on.
    """

    def __init__(
        self,
        camera: CameraLike,
        config: Optional[str | os.PathLike[str]] = None,
        settings: Optional[Mapping[str, Any]] = None,
        *,
        map: Optional[str | os.PathLike[str]] = None,
    ) -> None:
        self.camera = as_camera(camera)
        if map is not None:
            settings = {**(settings or {}), "run.map": os.path.abspath(os.fspath(map))}
        self._slam = _tessera.Slam(self.camera, None if config is None else os.fspath(config), overrides(settings))
        self._n_untimed = 0

    def track(
        self,
        depth: npt.ArrayLike,
        colour: Optional[npt.ArrayLike] = None,
        t: Optional[float] = None,
        *,
        color: Optional[npt.ArrayLike] = None,
        stamp_nanos: Optional[int] = None,
        rotation: Optional[Sequence[float]] = None,
        up: Optional[Sequence[float]] = None,
    ) -> Frame:
        """Processes the next frame.

        `depth`: height x width; uint16 in the camera's units, or float32 or float64 in metres, which are
        rounded to these units; 0, NaN and infinity are no measurement. `colour`: height x width x 3, uint8,
        red, green, blue, registered to depth; `color` is the same. `t`: seconds, rising, or `stamp_nanos`, which is exact for
        times since 1970; without either 30 frames a second are assumed. `rotation`: a gyroscope's, as
        `SourceFrame.rotation`. `up`: against gravity, as `SourceFrame.up`; that of the first frame levels the
        world where the setting `mapping.world_up` is `gravity`.

        Raises ValueError or TypeError, which say what was found and what was expected; the run then stands
        where it stood.
        """
        if colour is not None and color is not None:
            raise ValueError("found colour and color, expected one of them")
        colour = color if colour is None else colour
        raw = depth_bytes(depth, self.camera)
        rgb = None if colour is None else colour_bytes(colour, self.camera)
        nanos = self._nanos(t, stamp_nanos)
        turned = None if rotation is None else [float(value) for value in rotation]
        upward = None if up is None else [float(value) for value in up]
        index, state, reason, pose, upper = self._slam.track(raw, rgb, nanos, turned, upward)
        self._n_untimed += t is None and stamp_nanos is None
        return Frame(index, nanos, state, reason, np.array(pose).reshape(4, 4), _covariance(upper))

    def _nanos(self, t: Optional[float], stamp_nanos: Optional[int]) -> int:
        if t is not None and stamp_nanos is not None:
            raise ValueError("found t and stamp_nanos, expected one of them")
        if stamp_nanos is not None:
            return int(stamp_nanos)
        if t is None:
            return round(self._n_untimed * FRAME_NANOS)
        if not (math.isfinite(t) and abs(t) < 9.2e9):
            raise ValueError(f"t is {t}, expected seconds")
        return round(float(t) * 1e9)

    def relocalise(self) -> None:
        """Looks for the camera's place anew: the next frame drops the pose that was tracked so far and is
        looked for in the whole map, as one that was lost."""
        self._slam.relocalise()

    def finish(self) -> None:
        """The final optimisation of all keyframes. After it no frame can be given."""
        self._slam.finish()

    def trajectory(self) -> Trajectory:
        """All frames so far with the corrections so far; after `finish` the poses of `trajectory.txt`.

        Frames of a submap that is not joined to the others (docs/concepts.md) are left out: `indices` says
        which are there.
        """
        return trajectory(self._slam.trajectory())

    def keyframes(self) -> Trajectory:
        """All keyframes so far with the corrections so far; after `finish` the poses of `keyframes.txt`."""
        return trajectory(self._slam.keyframes())

    def map(self) -> Map:
        """The map so far with the corrections so far; after `finish` the points of `map.ply`."""
        return cloud(self._slam.map())


    def mesh(self, voxel_m: float = 0.01, max_depth_m: float = 4.0) -> Mesh:
        """The keyframes so far fused into one surface, as `tessera export --mesh`."""
        return mesh(self._slam.mesh(float(voxel_m), float(max_depth_m)))

    def verdict(self) -> Verdict:
        """Whether the poses so far can be relied on, as `tessera run` prints it at the end. What only the command
        sees, the recording's own faults and its ground truth, is not in it."""
        return verdict(self._slam.verdict())

    def counts(self) -> dict[str, Any]:
        """`loops_closed`, `loops_rejected`, `submaps`, and `apart`: frames of each submap that was never joined."""
        closed, rejected, submaps, apart = self._slam.counts()
        return {"loops_closed": closed, "loops_rejected": rejected, "submaps": submaps, "apart": dict(apart)}

    def loops(self) -> List[Loop]:
        """The loops so far that were verified."""
        return [Loop(*pair) for pair in self._slam.loops()]

    def __repr__(self) -> str:
        return f"Slam({self.camera!r})"


def _covariance(upper: list[float]) -> Optional[Floats]:
    if not upper:
        return None
    covariance = np.zeros((6, 6))
    covariance[np.triu_indices(6)] = upper
    return covariance + np.triu(covariance, 1).T
