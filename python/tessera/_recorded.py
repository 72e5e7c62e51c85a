"""Recordings, and the folders that runs leave."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
from collections.abc import Iterator, Mapping
from typing import Any, List, Optional

import numpy as np
import numpy.typing as npt

from . import _tessera
from ._slam import overrides
from ._tessera import Camera
from ._types import Loop, Map, Trajectory, Verdict, cloud, trajectory, verdict


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class SourceFrame:
    """A frame of a source."""

    #: Nanoseconds.
    stamp_nanos: int
    #: Height x width, uint16, in the camera's units.
    depth: npt.NDArray[np.uint16]
    #: Height x width x 3, uint8: red, green, blue; `None` where the frame has none.
    colour: Optional[npt.NDArray[np.uint8]]
    #: Of the gyroscope, since the first frame, where there is one: quaternion x y z w, then the variance
    #: about each axis (rad^2) and the standard deviation of the constant error of the rate (rad/s).
    rotation: Optional[list[float]]
    #: Against gravity by the accelerometer, where there is one: unit vector x y z in the camera's axes, then
    #: its standard deviation (rad).
    up: Optional[list[float]]
    #: What is wrong with an image of this frame: without depth `depth` is 0, without colour it is `None`.
    problem: Optional[str]

    @property
    def color(self) -> Optional[npt.NDArray[np.uint8]]:
        """`colour`."""
        return self.colour

    def __repr__(self) -> str:
        height, width = self.depth.shape
        colour = "no colour" if self.colour is None else "colour"
        return f"SourceFrame({self.stamp_nanos} ns, {width}x{height}, {colour})"


class Source:
    """A recording, or a simulated world, as the command reads it.

    `name`: a folder of images, a bag, an MCAP file or a world (`room`, `corridor`, `wall`, `house`,
    `building`). `settings`: as {"run.frames": 100} or
    {"run.camera": "camera.toml"}. A sequence of `SourceFrame`; the same index always has the same bytes.
    """

    def __init__(
        self, name: str | os.PathLike[str], settings: Optional[Mapping[str, Any]] = None, config: Optional[str] = None
    ) -> None:
        self._source = _tessera.Source(config, overrides({**(settings or {}), "run.source": os.fspath(name)}))
        #: Camera of the depth images.
        self.camera: Camera = self._source.camera()

    def __len__(self) -> int:
        return self._source.n_frames()

    def __getitem__(self, index: int) -> SourceFrame:
        wanted = index + len(self) if index < 0 else index
        if not 0 <= wanted < len(self):
            raise IndexError(f"frame {index} is not there, expected {-len(self)} to {len(self) - 1}")
        stamp_nanos, depth, colour, rotation, up, problem = self._source.read(wanted)
        height, width = self.camera.height, self.camera.width
        raw = np.frombuffer(depth, "<u2").reshape(height, width).astype(np.uint16)
        rgb = None if colour is None else np.frombuffer(colour, np.uint8).reshape(height, width, 3).copy()
        return SourceFrame(stamp_nanos, raw, rgb, rotation, up, problem)

    def __iter__(self) -> Iterator[SourceFrame]:
        return (self[index] for index in range(len(self)))


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Run:
    """What a run of the command left."""

    #: `summary.json`; `None` where the run was cut off before it was written.
    summary: Optional[dict[str, Any]]
    #: Every frame with all corrections, as `trajectory.txt`.
    trajectory: Trajectory
    #: Every keyframe with all corrections, as `keyframes.txt`.
    keyframes: Trajectory
    #: The points of `map.ply`.
    map: Map
    #: The loops that were verified.
    loops: List[Loop]

    @property
    def verdict(self) -> Optional[Verdict]:
        """That of the summary; `None` where there is none."""
        if self.summary is None:
            return None
        found = self.summary["verdict"]
        reasons = [(reason["grade"], reason["found"], reason["advice"]) for reason in found["reasons"]]
        return verdict((found["grade"], reasons))

    def __repr__(self) -> str:
        return f"Run({self.trajectory!r}, {len(self.keyframes)} keyframes, {self.map!r})"


def read_run(folder: str | os.PathLike[str]) -> Run:
    """Reads the folder of a run, from its journal: also of one that crashed or goes on.

    Raises ValueError, which names the file and what is wrong with it.
    """
    frames, keyframes, points, loops = _tessera.read_run(os.fspath(folder))
    summary = pathlib.Path(folder) / "summary.json"
    words = json.loads(summary.read_text(encoding="utf-8")) if summary.exists() else None
    return Run(words, trajectory(frames), trajectory(keyframes), cloud(points), [Loop(*pair) for pair in loops])
