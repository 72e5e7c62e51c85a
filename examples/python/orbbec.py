"""An adapter for Orbbec cameras: `tessera run external --name desk`, then `orbbec.py desk`.

Needs `pip install pyorbbecsdk2` (2.1) and what `pinhole.py` names. Tried with the SDK's own frames, not on hardware.
"""

import sys

import numpy as np
import pyorbbecsdk as ob

import pinhole

WIDTH, HEIGHT, RATE_HZ = 640, 480, 30
MODELS = (ob.OBCameraDistortionModel.NONE, ob.OBCameraDistortionModel.BROWN_CONRADY, ob.OBCameraDistortionModel.BROWN_CONRADY_K6)


def lens_of(lens, distortion):
    """Size, matrix and OpenCV's coefficients."""
    if distortion.model not in MODELS:
        sys.exit(f"found the distortion {distortion.model}, expected one of {[model.name for model in MODELS]}")
    named = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    matrix = [[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]]
    return (lens.width, lens.height), matrix, [getattr(distortion, name) for name in named]


def images(frames):
    """Number, nanoseconds, depth in units of a tenth of a millimetre and colour; None where depth is not there."""
    depth = frames and frames.get_depth_frame()
    colour = frames and frames.get_color_frame()
    if not depth or not colour:
        return None
    size = (depth.get_height(), depth.get_width())
    values = np.frombuffer(depth.get_data(), dtype=np.uint16).reshape(size)
    # The scale is in millimetres, and may be another in each frame.
    values = np.minimum(np.rint(values * (10.0 * depth.get_depth_scale())), 65534).astype(np.uint16)
    rgb = np.frombuffer(colour.get_data(), dtype=np.uint8).reshape(*size, 3)
    return depth.get_index(), depth.get_timestamp_us() * 1000, values, rgb


def main():
    pipeline, config = ob.Pipeline(), ob.Config()
    config.enable_video_stream(ob.OBStreamType.DEPTH_STREAM, WIDTH, HEIGHT, RATE_HZ, ob.OBFormat.Y16)
    config.enable_video_stream(ob.OBStreamType.COLOR_STREAM, WIDTH, HEIGHT, RATE_HZ, ob.OBFormat.RGB)
    pipeline.enable_frame_sync()
    pipeline.start(config)
    to_colour = ob.AlignFilter(align_to_stream=ob.OBStreamType.COLOR_STREAM)
    found = pipeline.get_camera_param()

    def next_images():
        frames = pipeline.wait_for_frames(1000)
        return images(frames and to_colour.process(frames).as_frame_set())

    pinhole.send_all(sys.argv[1], *lens_of(found.rgb_intrinsic, found.rgb_distortion), 10000, next_images)


if __name__ == "__main__":
    main()
