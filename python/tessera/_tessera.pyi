"""The compiled part: images and columns are bytes, little-endian."""

from collections.abc import Iterable
from typing import Any, Optional, final

from ._types import MapColumns, TrajectoryColumns

__all__ = ["Camera", "Slam", "Source", "read_run"]

@final
class Camera:
    """A depth camera without distortion, pixels; raw depth divided by `units_per_metre` is metres.

    Pixel (0, 0) is the centre of the first one. `from_dict` has the other parameters.
    """

    def __new__(
        cls,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        units_per_metre: float = 1000.0,
    ) -> Camera: ...
    @staticmethod
    def load(name_or_file: str) -> Camera:
        """A built-in camera (`freiburg1`, `freiburg2`, `freiburg3`, `icl`) or a camera file."""
    @staticmethod
    def from_dict(values: dict[str, Any]) -> Camera:
        """From the keys of a camera file: `width`, `height`, `fx`, `fy`, `cx`, `cy`, `units_per_metre`, and
        where they are wanted `distortion` (k1 k2 p1 p2 k3), `readout_s`, `depth_offset_m`,
        `colour_registered`, `colour_lag_s` and `colour_focal_ratio`."""
    @staticmethod
    def from_matrix(
        matrix: Iterable[Iterable[float]],
        width: int,
        height: int,
        units_per_metre: float = 1000.0,
        distortion: Optional[Iterable[float]] = None,
    ) -> Camera:
        """From the 3x3 matrix of a pinhole, pixels, and its distortion `k1 k2 p1 p2 k3`."""
    def to_dict(self) -> dict[str, Any]:
        """The keys of a camera file with their values."""
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def units_per_metre(self) -> float: ...

@final
class Slam:
    def __new__(cls, camera: Camera, config: Optional[str], overrides: list[str]) -> Slam: ...
    def track(
        self,
        depth: bytes,
        colour: Optional[bytes],
        stamp_nanos: int,
        rotation: Optional[list[float]],
    ) -> tuple[int, str, str, list[float], list[float]]: ...
    def relocalise(self) -> None: ...
    def finish(self) -> None: ...
    def trajectory(self) -> TrajectoryColumns: ...
    def keyframes(self) -> TrajectoryColumns: ...
    def map(self) -> MapColumns: ...

@final
class Source:
    def __new__(cls, config: Optional[str], overrides: list[str]) -> Source: ...
    def camera(self) -> Camera: ...
    def n_frames(self) -> int: ...
    def read(
        self, index: int
    ) -> tuple[int, bytes, Optional[bytes], Optional[list[float]], Optional[str]]: ...

def read_run(folder: str) -> tuple[TrajectoryColumns, TrajectoryColumns, MapColumns]: ...
