"""The compiled part: images and columns are bytes, little-endian."""

from collections.abc import Iterable
from typing import Any, Optional, final

from ._types import MapColumns, MeshColumns, TrajectoryColumns, VerdictColumns

__all__ = ["Camera", "Slam", "Source", "__version__", "read_run"]

__version__: str

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
        """A built-in camera (`freiburg1`, `freiburg2`, `freiburg3`, `icl`, `7scenes`, `primesense`) or a camera file."""
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
    @property
    def fx(self) -> float: ...
    @property
    def fy(self) -> float: ...
    @property
    def cx(self) -> float: ...
    @property
    def cy(self) -> float: ...
    @property
    def distortion(self) -> tuple[float, float, float, float, float]:
        """`k1 k2 p1 p2 k3`."""
    @property
    def readout_s(self) -> float: ...
    @property
    def depth_offset_m(self) -> float: ...
    @property
    def colour_registered(self) -> bool: ...
    @property
    def colour_lag_s(self) -> float: ...
    @property
    def colour_focal_ratio(self) -> float: ...
    @property
    def matrix(self) -> list[list[float]]:
        """The 3x3 matrix, as `from_matrix` takes it."""

@final
class Slam:
    def __new__(cls, camera: Camera, config: Optional[str], overrides: list[str]) -> Slam: ...
    def track(
        self,
        depth: bytes,
        colour: Optional[bytes],
        stamp_nanos: int,
        rotation: Optional[list[float]],
        up: Optional[list[float]],
    ) -> tuple[int, str, str, list[float], list[float]]: ...
    def relocalise(self) -> None: ...
    def finish(self) -> None: ...
    def trajectory(self) -> TrajectoryColumns: ...
    def keyframes(self) -> TrajectoryColumns: ...
    def map(self) -> MapColumns: ...
    def mesh(self, voxel_m: float, max_depth_m: float) -> MeshColumns: ...
    def verdict(self) -> VerdictColumns: ...
    def loops(self) -> list[tuple[int, int, bool]]: ...
    def counts(self) -> tuple[int, int, int, list[tuple[int, int]]]: ...

@final
class Source:
    def __new__(cls, config: Optional[str], overrides: list[str]) -> Source: ...
    def camera(self) -> Camera: ...
    def n_frames(self) -> int: ...
    def read(
        self, index: int
    ) -> tuple[int, bytes, Optional[bytes], Optional[list[float]], Optional[list[float]], Optional[str]]: ...

def read_run(folder: str) -> tuple[TrajectoryColumns, TrajectoryColumns, MapColumns, list[tuple[int, int, bool]]]: ...
