"""An adapter for Azure Kinects: `tessera run external --name desk`, then `azure_kinect.py desk`.

Needs `pip install pyk4a-bundle "numpy<2"` and what `pinhole.py` names. Tried with the SDK's own calibration, not on hardware.
"""

import sys

import numpy as np
import pyk4a

import pinhole


def lens_of(calibration, size):
    """Size, matrix and OpenCV's coefficients of the colour camera, over which depth is laid."""
    of = pyk4a.CalibrationType.COLOR
    return size, calibration.get_camera_matrix(of), calibration.get_distortion_coefficients(of)


def images(capture):
    """No number, nanoseconds, depth in millimetres and colour; None where an image is not there."""
    depth, colour = capture.transformed_depth, capture.color
    if depth is None or colour is None:
        return None
    return None, capture.depth_timestamp_usec * 1000, depth, np.ascontiguousarray(colour[:, :, 2::-1])


def main():
    config = pyk4a.Config(
        color_resolution=pyk4a.ColorResolution.RES_720P,
        color_format=pyk4a.ImageFormat.COLOR_BGRA32,
        depth_mode=pyk4a.DepthMode.NFOV_UNBINNED,
        camera_fps=pyk4a.FPS.FPS_30,
        synchronized_images_only=True,
    )
    device = pyk4a.PyK4A(config)
    device.start()
    lens = lens_of(device.calibration, (1280, 720))
    pinhole.send_all(sys.argv[1], *lens, 1000, lambda: images(device.get_capture()))


if __name__ == "__main__":
    main()
