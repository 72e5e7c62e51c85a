"""Sends the images of any camera whose lens OpenCV's model describes, without their distortion, to `tessera run external`.

Needs `pip install iceoryx2==0.10.0 numpy opencv-python-headless`; `oak.py`, `orbbec.py` and `azure_kinect.py` use it.
"""

import cv2
import numpy as np

import tessera_client


def send_all(run, size, matrix, coefficients, units_per_metre, next_images):
    """Sends what `next_images` gives until the run wants no more: (number, nanoseconds, depth, colour), or None.

    Without a number (None) the images are counted here: those that the driver left out are then not missed.
    Depth (uint16) and colour (uint8, red green blue) are registered and of `size` (width, height). `matrix` is 3x3,
    `coefficients` have OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6 ...
    """
    matrix = np.asarray(matrix, dtype=np.float64)
    calibration = dict(zip(("fx", "fy", "cx", "cy"), map(float, matrix[[0, 1, 0, 1], [0, 1, 2, 2]])))
    camera = tessera_client.Camera(run, *size, {**calibration, "units_per_metre": units_per_metre})
    no_turn, coefficients = np.eye(3), np.asarray(coefficients, dtype=np.float64)
    maps = cv2.initUndistortRectifyMap(matrix, coefficients, no_turn, matrix, size, cv2.CV_32FC1)
    first_number, n_sent = None, 0
    while camera.is_wanted():
        images = next_images()
        if images is None:
            continue
        number, stamp_nanos, depth, colour = images
        number = n_sent if number is None else number
        first_number = number if first_number is None else first_number
        # Between two depths of an edge there is nothing: the nearest one, never a mean.
        depth = cv2.remap(depth, *maps, cv2.INTER_NEAREST)
        colour = None if colour is None else cv2.remap(colour, *maps, cv2.INTER_LINEAR)
        n_sent += 1
        camera.send(number - first_number, stamp_nanos, depth, colour)
