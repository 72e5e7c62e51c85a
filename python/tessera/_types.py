"""Trajectories and maps as arrays, and images as the bytes that the compiled part takes."""

from __future__ import annotations

import dataclasses
import os
from typing import TYPE_CHECKING, Any, Dict, List, Tuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._tessera import Camera

Floats = npt.NDArray[np.float64]

#: Indices (i64), stamps (i64), states, poses (7 x f64), matrices (16 x f64), as the compiled part gives them.
TrajectoryColumns = Tuple[bytes, bytes, List[str], bytes, bytes]
#: Positions (3 x f32), normals (3 x f32), colours (3 x u8).
MapColumns = Tuple[bytes, bytes, bytes]


#: Positions (3 x f32), normals (3 x f32), colours (3 x u8), triangles (3 x u32).
MeshColumns = Tuple[bytes, bytes, bytes, bytes]
#: Grade, and grade, finding and advice of each reason.
VerdictColumns = Tuple[str, List[Tuple[str, str, str]]]

#: Metres that no depth camera sees: a median beyond it is millimetres.
MOST_MEDIAN_M = 100.0


def camera_from_dict(values: Dict[str, Any]) -> Camera:
    """What pickle makes a camera of."""
    from ._tessera import Camera as Made

    return Made.from_dict(values)


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Trajectory:
    """N poses in the order of time."""

    #: N, the index of each frame, counted from 0.
    indices: npt.NDArray[np.int64]
    #: N, nanoseconds.
    stamps_nanos: npt.NDArray[np.int64]
    #: N words: `tracking`, `degenerate`, `lost` or `relocalising`, as `Frame.state`.
    states: npt.NDArray[np.str_]
    #: Nx4x4, metres.
    world_from_camera: Floats
    #: Nx7, the same poses: position (metres), then the quaternion x y z w.
    positions_quaternions: Floats

    @property
    def stamps(self) -> Floats:
        """N, seconds."""
        return self.stamps_nanos.astype(np.float64) * 1e-9

    @property
    def is_tracked(self) -> npt.NDArray[np.bool_]:
        """N, whether a pose was measured; else it is a prediction."""
        return np.isin(self.states, ("tracking", "degenerate"))

    def __len__(self) -> int:
        return len(self.indices)

    def __repr__(self) -> str:
        if not len(self):
            return "Trajectory(no poses)"
        first, last = self.stamps[0], self.stamps[-1]
        n_untracked = int(len(self) - self.is_tracked.sum())
        return f"Trajectory({len(self)} poses, {first:.3f} to {last:.3f} s, {n_untracked} not tracked)"

    def write_tum(self, path: str | os.PathLike[str]) -> None:
        """Writes the poses as the TUM tools read them: `timestamp tx ty tz qx qy qz qw`."""
        with open(path, "w", encoding="ascii", newline="\n") as file:
            for nanos, pose in zip(self.stamps_nanos.tolist(), self.positions_quaternions.tolist()):
                # Adding zero turns -0 into 0.
                words = " ".join(f"{value + 0.0:.9f}" for value in pose)
                # As the command writes it: microseconds, and nanoseconds where there are any.
                stamp, nine = divmod(nanos, 10**9)
                digits = f"{nine:09d}"
                file.write(f"{stamp}.{digits[:6]}{digits[6:].rstrip('0')} {words}\n")


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Map:
    """N points of the keyframes' surfaces."""

    #: Nx3, metres.
    positions: npt.NDArray[np.float32]
    #: Nx3, unit vectors.
    normals: npt.NDArray[np.float32]
    #: Nx3: red, green, blue, 8 bits.
    colours: npt.NDArray[np.uint8]

    @property
    def colors(self) -> npt.NDArray[np.uint8]:
        """`colours`."""
        return self.colours

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"Map({len(self)} points)"


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Mesh:
    """The keyframes fused into one surface.

    `trimesh.Trimesh` takes these arrays as they are; `examples/python/objects.py` has Open3D too.
    """

    #: Nx3, metres.
    positions: npt.NDArray[np.float32]
    #: Nx3, unit vectors.
    normals: npt.NDArray[np.float32]
    #: Nx3: red, green, blue, 8 bits.
    colours: npt.NDArray[np.uint8]
    #: Mx3, indices of vertices.
    triangles: npt.NDArray[np.uint32]

    @property
    def colors(self) -> npt.NDArray[np.uint8]:
        """`colours`."""
        return self.colours

    def __repr__(self) -> str:
        return f"Mesh({len(self.positions)} vertices, {len(self.triangles)} triangles)"


@dataclasses.dataclass(frozen=True)
class Loop:
    """Two keyframes, far apart in time, that see the same place: their numbers as in `Slam.keyframes()`, those of
    an earlier run's map before them."""

    newer: int
    older: int
    #: Whether it was closed; else the optimisation rejected it, for it contradicts the others.
    is_closed: bool


@dataclasses.dataclass(frozen=True)
class Reason:
    """One thing that a verdict found."""

    #: `good` (a note), `doubtful` or `failed`.
    grade: str
    found: str
    #: What to try; empty for a note.
    advice: str


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Whether a run can be relied on, as `tessera run` prints it."""

    #: `good`, `doubtful` or `failed`.
    grade: str
    reasons: List[Reason]


def mesh(columns: MeshColumns) -> Mesh:
    positions, normals, colours, triangles = columns
    return Mesh(
        np.frombuffer(positions, "<f4").reshape(-1, 3).copy(),
        np.frombuffer(normals, "<f4").reshape(-1, 3).copy(),
        np.frombuffer(colours, np.uint8).reshape(-1, 3).copy(),
        np.frombuffer(triangles, "<u4").reshape(-1, 3).copy(),
    )


def verdict(columns: VerdictColumns) -> Verdict:
    grade, reasons = columns
    return Verdict(grade, [Reason(*reason) for reason in reasons])


def trajectory(columns: TrajectoryColumns) -> Trajectory:
    indices, stamps, states, poses, matrices = columns
    return Trajectory(
        np.frombuffer(indices, "<i8").copy(),
        np.frombuffer(stamps, "<i8").copy(),
        np.array(states, dtype="<U12"),
        np.frombuffer(matrices, "<f8").reshape(-1, 4, 4).copy(),
        np.frombuffer(poses, "<f8").reshape(-1, 7).copy(),
    )


def cloud(columns: MapColumns) -> Map:
    positions, normals, colours = columns
    return Map(
        np.frombuffer(positions, "<f4").reshape(-1, 3).copy(),
        np.frombuffer(normals, "<f4").reshape(-1, 3).copy(),
        np.frombuffer(colours, np.uint8).reshape(-1, 3).copy(),
    )


def depth_bytes(depth: npt.ArrayLike, camera: Camera) -> bytes:
    """Raw depth, row by row. Metres are rounded to the camera's units."""
    array = np.asarray(depth)
    expected = (camera.height, camera.width)
    if array.shape != expected:
        raise ValueError(f"depth has shape {array.shape}, expected {expected}: height and width of the camera")
    if array.dtype == np.uint16:
        return array.astype("<u2", copy=False).tobytes()
    if array.dtype not in (np.float32, np.float64):
        raise TypeError(f"depth is {array.dtype}, expected uint16 in the camera's units, or float32 or float64 in metres")
    # A quick look: every eighth pixel of every eighth row.
    some = array[::8, ::8]
    measured = some[np.isfinite(some) & (some > 0)]
    if measured.size and (median := float(np.median(measured))) > MOST_MEDIAN_M:
        raise ValueError(
            f"depth is {array.dtype} with a median of {median:.0f}, expected metres: these look like millimetres; "
            "give depth / 1000, or uint16 in the camera's units"
        )
    # In the type of the image: twice as many bits would change no unit.
    with np.errstate(invalid="ignore", over="ignore"):
        raw = np.rint(array * array.dtype.type(camera.units_per_metre))
        # Behind the camera, beyond what 16 bits hold, or NaN: no measurement.
        return np.where((raw >= 1) & (raw < 65535), raw, 0).astype("<u2").tobytes()


def colour_bytes(colour: npt.ArrayLike, camera: Camera) -> bytes:
    """Red, green, blue, row by row."""
    array = np.asarray(colour)
    expected = (camera.height, camera.width, 3)
    if array.shape != expected:
        raise ValueError(f"colour has shape {array.shape}, expected {expected}: height and width of the camera, red green blue")
    if array.dtype != np.uint8:
        raise TypeError(f"colour is {array.dtype}, expected uint8")
    return array.tobytes()
