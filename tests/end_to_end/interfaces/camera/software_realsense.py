"""A software device of librealsense that plays a folder in the TUM layout at 30 Hz, through the adapter of the examples.

    software_realsense.py EXAMPLES FOLDER RUN

Depth and colour are one camera, so that the SDK's alignment leaves depth as it is.
"""

import ctypes
import pathlib
import sys
import time
import tomllib

import libusb_package
import numpy as np
from PIL import Image

# The SDK is linked against the system's libusb, which a machine without cameras need not have.
ctypes.CDLL(str(libusb_package.get_library_path()))
sys.path.insert(0, sys.argv[1])
import pyrealsense2 as rs  # noqa: E402
import realsense  # noqa: E402

folder, run = pathlib.Path(sys.argv[2]), sys.argv[3]
camera = tomllib.loads((folder / "camera.toml").read_text())
width, height = camera["width"], camera["height"]


def images(name):
    rows = [line.split() for line in (folder / name).read_text().splitlines() if line.strip() and line[0] != "#"]
    return [(float(stamp), np.asarray(Image.open(folder / file))) for stamp, file in rows]


def intrinsics():
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy = width, height, camera["fx"], camera["fy"]
    lens.ppx, lens.ppy, lens.model, lens.coeffs = camera["cx"], camera["cy"], rs.distortion.none, [0.0] * 5
    return lens


def stream(sensor, kind, form, uid, n_bytes):
    described = rs.video_stream()
    described.type, described.fmt, described.uid, described.index = kind, form, uid, 0
    described.width, described.height, described.fps, described.bpp = width, height, 30, n_bytes
    described.intrinsics = intrinsics()
    return sensor.add_video_stream(described)


def put(sensor, profile, pixels, n_bytes, number, stamp_ms):
    frame = rs.software_video_frame()
    frame.pixels, frame.stride, frame.bpp = np.ascontiguousarray(pixels), n_bytes * width, n_bytes
    frame.timestamp, frame.domain = stamp_ms, rs.timestamp_domain.hardware_clock
    frame.frame_number, frame.profile = number, profile.as_video_stream_profile()
    sensor.on_video_frame(frame)


device = rs.software_device()
of_depth, of_colour = device.add_sensor("Depth"), device.add_sensor("Colour")
of_depth.add_read_only_option(rs.option.depth_units, 1.0 / camera["units_per_metre"])
depth_profile = stream(of_depth, rs.stream.depth, rs.format.z16, 0, 2)
colour_profile = stream(of_colour, rs.stream.color, rs.format.rgb8, 1, 3)
same = rs.extrinsics()
same.rotation, same.translation = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], [0.0, 0, 0]
depth_profile.register_extrinsics_to(colour_profile, same)
colour_profile.register_extrinsics_to(depth_profile, same)
device.create_matcher(rs.matchers.dlr_c)
syncer = rs.syncer()
for sensor, profile in ((of_depth, depth_profile), (of_colour, colour_profile)):
    sensor.open(profile)
    sensor.start(syncer)
pairs = list(zip(images("depth.txt"), images("rgb.txt"), strict=True))
began, number = time.monotonic(), 0


def next_frames():
    """The next pair, when it is due; behind the last one the last again, as of a camera that stands."""
    global number
    while True:
        (stamp, depth), (_, colour) = pairs[min(number, len(pairs) - 1)]
        stamp_ms = 1000.0 * stamp + 1000.0 * max(0, number - len(pairs) + 1) / 30.0 + 1.0
        time.sleep(max(0.0, began + stamp_ms / 1000.0 - time.monotonic()))
        put(of_depth, depth_profile, depth, 2, number + 1, stamp_ms)
        put(of_colour, colour_profile, colour, 3, number + 1, stamp_ms)
        number += 1
        # The first images come one by one, until the SDK knows that they belong together.
        is_there, frames = syncer.try_wait_for_frames(500)
        while is_there and frames.size() < 2:
            is_there, frames = syncer.try_wait_for_frames(50)
        if is_there:
            return frames


realsense.send_all(run, intrinsics(), 1.0 / camera["units_per_metre"], next_frames)
