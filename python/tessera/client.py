"""Services of a run that goes on in processes of its own: send it a camera's images, read its poses.

Needs `pip install iceoryx2==0.10.0` and no other part of this package. docs/camera.md tells what each
field means.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import pathlib
import struct
import time
from collections.abc import Mapping
from typing import Any

import iceoryx2 as iox2

u32, u64, i64, f64 = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_int64, ctypes.c_double


class CameraFrame(ctypes.Structure):
    _fields_ = [
        ("session", u64), ("index", u64), ("stamp_nanos", i64),
        ("kind", u32), ("has_colour", u32), ("width", u32), ("height", u32),
        ("ring_frames", u32), ("colour_registered", u32),
        ("fx", f64), ("fy", f64), ("cx", f64), ("cy", f64), ("units_per_metre", f64),
        ("distortion", f64 * 5), ("readout_s", f64), ("depth_offset_m", f64),
        ("start_from_camera_xyzw", f64 * 4), ("variance_rad2", f64), ("bias_sigma_rad_per_s", f64),
        ("up_in_camera", f64 * 3), ("up_sigma_rad", f64),
    ]

    @staticmethod
    def type_name() -> str:
        return "tessera.CameraFrame.v2"


class CameraFlow(ctypes.Structure):
    _fields_ = [("epoch", u64), ("send_from", u64), ("send_below", u64), ("finished", u64)]

    @staticmethod
    def type_name() -> str:
        return "tessera.CameraFlow.v1"


class Pose(ctypes.Structure):
    _fields_ = [
        ("index", u64), ("stamp_nanos", i64), ("state", u32), ("n_correspondences", u32),
        ("reason", ctypes.c_char * 64), ("odom_from_camera", f64 * 7), ("world_from_odom", f64 * 7),
        ("covariance", f64 * 36), ("step_variance", f64 * 6), ("times", u64 * 6),
    ]

    @staticmethod
    def type_name() -> str:
        return "tessera.Pose.v2"


def private_folder() -> pathlib.Path:
    """Where this user's runs are registered, as shared/transport/src/identity.rs chooses it."""
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    if runtime.startswith("/") and os.path.isdir(runtime) and len(runtime) <= 30:
        return pathlib.Path(runtime) / "tessera"
    return pathlib.Path(f"/dev/shm/tessera-{os.getuid()}")


def config_of(run: str) -> str | None:
    """Path of the iceoryx2 configuration of a run that is going on; None where there is none."""
    try:
        entry = json.loads((private_folder() / f"{run}.run").read_text())
        return str(entry["identity"]["config_file"])
    except (FileNotFoundError, json.JSONDecodeError, KeyError):
        return None


class Link:
    """A node in the shared memory of a run."""

    def __init__(self, run: str, timeout_s: float = 60.0) -> None:
        iox2.set_log_level(iox2.LogLevel.Fatal)
        self.run, deadline = run, time.monotonic() + timeout_s
        while (path := config_of(run)) is None or not os.path.exists(path):
            if time.monotonic() > deadline:
                raise TimeoutError(f"no run {run} within {timeout_s} s in {private_folder()}")
            time.sleep(0.05)
        self.path = path
        # The process's own configuration too: iceoryx2 falls back to it.
        iox2.config.setup_global_config_from_file(iox2.FilePath.new(path))
        config = iox2.config.from_file(iox2.FilePath.new(path))
        self.node = (
            iox2.NodeBuilder.new()
            .config(config)
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )

    def is_current(self) -> bool:
        """False once the run has ended or begun again under another configuration."""
        return config_of(self.run) == self.path

    def open(self, name: str, payload: Any, header: Any = None, timeout_s: float = 60.0) -> Any:
        """Opens a service that the run has made; it is there a moment after the run is."""
        deadline = time.monotonic() + timeout_s
        while True:
            builder = self.node.service_builder(iox2.ServiceName.new(name)).publish_subscribe(payload)
            if header is not None:
                builder = builder.user_header(header)
            try:
                return builder.open()
            except iox2.PublishSubscribeOpenError:
                if time.monotonic() > deadline or not self.is_current():
                    raise
                time.sleep(0.05)


def pixels(name: str, values: Any, kind: str, shape: tuple[int, ...]) -> bytes:
    """The bytes of an image of `shape`, checked: `kind` is H for 16-bit and B for 8-bit values.

    Bytes and flat arrays need the right length alone.
    """
    view = memoryview(values)
    # Plain bytes may hold either; an array says what it holds.
    if view.format not in (kind, "<" + kind) and not isinstance(values, (bytes, bytearray)):
        wanted = {"H": "uint16", "B": "uint8"}[kind]
        raise TypeError(f"{name} holds values of format '{view.format}', expected {wanted}")
    if view.ndim > 1 and view.shape != shape:
        raise ValueError(f"{name} has shape {view.shape}, expected {shape}")
    expected = math.prod(shape) * struct.calcsize(kind)
    if view.nbytes != expected:
        raise ValueError(f"{name} has {view.nbytes} bytes, expected {expected}")
    return view.tobytes()


class Camera:
    """Sends images to `tessera run external`. `calibration` is a dict of CameraFrame's numbers.

    `ring_frames=0` is a live camera. A recording, or a camera that keeps its last images, says how
    many it keeps, sends only what `wanted()` allows, and loses none.
    """

    def __init__(
        self, run: str, width: int, height: int, calibration: Mapping[str, Any], ring_frames: int = 0
    ) -> None:
        self.link = Link(run)
        self.size = (width, height)
        n_pixels = width * height
        # Depth, then three bytes of colour a pixel, counted in units of 16 bits.
        self.length = n_pixels + (3 * n_pixels + 1) // 2
        service = self.link.open("camera", iox2.Slice[ctypes.c_uint16], CameraFrame)
        self.publisher = service.publisher_builder().initial_max_slice_len(self.length).create()
        self.flows = self.link.open("camera_flow", CameraFlow).subscriber_builder().create()
        self.header = CameraFrame(
            session=time.time_ns(), width=width, height=height, ring_frames=ring_frames,
            colour_registered=1,
        )
        for name, value in calibration.items():
            setattr(self.header, name, (f64 * 5)(*value) if name == "distortion" else value)
        self.flow: CameraFlow | None = None

    def is_wanted(self) -> bool:
        """False once the run is done or gone."""
        self.read_flow()
        return self.link.is_current() and not (self.flow and self.flow.finished)

    def read_flow(self) -> CameraFlow | None:
        """The newest word of the run: which images a publisher with a ring may send."""
        while (sample := self.flows.receive()) is not None:
            self.flow = CameraFlow.from_buffer_copy(sample.payload().contents)
        return self.flow

    def send(
        self, index: int, stamp_nanos: int, depth: Any, colour: Any = None, *, relocalise: bool = False
    ) -> None:
        """Sends depth (16-bit values) and colour (bytes red, green, blue), row by row.

        Both are bytes or anything with the buffer protocol, such as numpy arrays of uint16 (height x width)
        and uint8 (height x width x 3). Raises TypeError or ValueError for any other; nothing is then sent.

        `relocalise`: the run is wrong about its place, and is to look for it anew from this image on. Where
        the image is sent again, so is this.
        """
        width, height = self.size
        depth = pixels("depth", depth, "H", (height, width))
        colour = None if colour is None else pixels("colour", colour, "B", (height, width, 3))
        header = self.header
        header.index, header.stamp_nanos, header.kind = index, stamp_nanos, 2 if relocalise else 0
        header.has_colour = int(colour is not None)
        sample = self.publisher.loan_slice_uninit(self.length)
        ctypes.memmove(sample.payload_ptr, depth, len(depth))
        if colour is not None:
            ctypes.memmove(sample.payload_ptr + len(depth), colour, len(colour))
        self._send(sample)

    def end(self, n_images: int) -> None:
        """Says that there are no more."""
        self.header.index, self.header.kind = n_images, 1
        self._send(self.publisher.loan_slice_uninit(1))

    def _send(self, sample: Any) -> None:
        ctypes.memmove(sample.user_header_ptr, ctypes.byref(self.header), ctypes.sizeof(self.header))
        sample.assume_init().send()
