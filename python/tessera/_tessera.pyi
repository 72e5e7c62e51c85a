from typing import Sequence

class Camera:
    """A depth camera: a pinhole with distortion `k1 k2 p1 p2 k3`; pixels count from the centre of the first."""

    def __init__(
        self,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        units_per_metre: float = 1000.0,
        distortion: Sequence[float] = ...,
        readout_s: float = 0.0,
        depth_offset_m: float = 0.0,
    ) -> None: ...
    @staticmethod
    def load(name_or_file: str) -> Camera:
        """A built-in camera (`freiburg1`, `freiburg2`, `freiburg3`, `icl`) or a camera file."""
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def units_per_metre(self) -> float: ...

class Slam:
    def __init__(self, camera: Camera, config: str | None, settings: list[str]) -> None: ...
    def track(
        self, depth: bytes, colour: bytes | None, stamp_nanos: int
    ) -> tuple[int, str, list[float], list[float]]: ...
    def finish(self) -> None: ...
    def trajectory(self) -> tuple[list[int], bytes]: ...
    def map(self) -> tuple[bytes, bytes, bytes]: ...
