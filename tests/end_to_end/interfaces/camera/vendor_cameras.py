"""The adapters of the examples beside their SDKs' own projection, without a camera.

    vendor_cameras.py EXAMPLES oak|orbbec|azure_kinect

A blob of depth is drawn where the SDK's own lens, which bends, shows a point of the room. What the adapter sends is
a pinhole: there the blob must be seen in the direction of the point, at its depth, with its colour and its time.
"""

import importlib
import json
import sys

import numpy as np

sys.path.insert(0, sys.argv[1])
import pinhole  # noqa: E402
import tessera_client  # noqa: E402

adapter = importlib.import_module(sys.argv[2])
POINT_M = np.array([0.9, 0.6, 2.0])
SENT = []


class Recorder:
    """In place of the client's camera: keeps what it is given, by the client's own checks."""

    def __init__(self, run, width, height, calibration):
        known = {name for name, *_ in tessera_client.CameraFrame._fields_}
        assert set(calibration) <= known, calibration
        self.size, self.calibration, self.n_wanted = (width, height), calibration, 2

    def is_wanted(self):
        self.n_wanted -= 1
        return self.n_wanted >= 0

    def send(self, index, stamp_nanos, depth, colour):
        width, height = self.size
        tessera_client.pixels("depth", depth, "H", (height, width))
        tessera_client.pixels("colour", colour, "B", (height, width, 3))
        SENT.append((self.calibration, index, stamp_nanos, depth, colour))


pinhole.tessera_client.Camera = Recorder


def blob(size, at, value):
    depth = np.zeros(size[::-1], dtype=np.uint16)
    x, y = (round(v) for v in at)
    depth[y - 4 : y + 5, x - 4 : x + 5] = value
    colour = np.zeros((*size[::-1], 3), dtype=np.uint8)
    colour[y - 4 : y + 5, x - 4 : x + 5] = (200, 100, 50)
    return depth, colour


def oak():
    import datetime

    import depthai as dai

    size, matrix = (640, 480), [[500.0, 0.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]]
    lens = dai.ImgTransformation(*size, matrix, dai.CameraModel.Perspective, [0.2, -0.3, 0.002, -0.001, 0.1] + [0.0] * 9)
    shown = lens.project3DPoint(dai.Point3f(*POINT_M))
    at = (shown.x, shown.y)
    depth, colour = blob(size, at, 2000)
    numbers = iter((70, 71, 72))

    def next_group():
        group, number = dai.MessageGroup(), next(numbers)
        for name, values, form in (("depth", depth, dai.ImgFrame.Type.RAW16), ("colour", colour, dai.ImgFrame.Type.RGB888i)):
            message = dai.ImgFrame()
            message.setData(np.frombuffer(values.tobytes(), dtype=np.uint8))
            message.setType(form).setWidth(size[0]).setHeight(size[1])
            message.setStride(values.strides[0])
            message.setTransformation(lens)
            message.setSequenceNum(number)
            message.setTimestampDevice(datetime.timedelta(microseconds=number * 33_333))
            group[name] = message
        return group

    adapter.send_all("none", next_group)
    # What main() names.
    assert all(hasattr(dai.node.StereoDepth, name) for name in ("left", "right", "inputAlignTo", "depth"))
    assert "enableUndistortion" in dai.node.Camera.requestOutput.__doc__
    assert hasattr(dai.node.Sync, "inputs") and hasattr(dai.Node.Output, "createOutputQueue")
    return at, 1, 33_333_000


def orbbec():
    import pyorbbecsdk as ob

    lens, bent, same = ob.OBCameraIntrinsic(), ob.OBCameraDistortion(), ob.OBExtrinsic()
    lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy = 640, 480, 500.0, 510.0, 320.0, 240.0
    # Its projection leaves points of the other models where a pinhole has them.
    bent.model = ob.OBCameraDistortionModel.BROWN_CONRADY
    bent.k1, bent.k2, bent.k3, bent.k4, bent.p1, bent.p2 = 0.2, -0.3, 0.1, 0.05, 0.002, -0.001
    same.rot = np.eye(3, dtype=np.float32)
    point = ob.OBPoint3f(*(1000.0 * POINT_M))
    shown = ob.transformation3dto2d(point, lens, bent, same)
    at = (shown.x, shown.y)
    # The SDK's depth counts half millimetres here.
    depth, colour = blob((640, 480), at, 4000)
    numbers = iter((70, 71, 72))

    def next_images():
        number, frames = next(numbers), ob.FrameSet.create_frame_set()
        kinds = ((ob.OBFrameType.DEPTH_FRAME, ob.OBFormat.Y16, depth), (ob.OBFrameType.COLOR_FRAME, ob.OBFormat.RGB, colour))
        for kind, form, values in kinds:
            frame = ob.Frame.create_video_frame(kind, form, 640, 480)
            frame.update_data(values.tobytes())
            ob.Frame.set_frame_device_timestamp_us(frame, number * 33_333)
            if kind == ob.OBFrameType.DEPTH_FRAME:
                frame.as_depth_frame().set_value_scale(0.5)
            frames.push_frame(frame)
        return adapter.images(frames)

    pinhole.send_all("none", *adapter.lens_of(lens, bent), 10000, next_images)
    config = ob.Config()
    assert callable(config.enable_video_stream) and callable(ob.Pipeline.get_camera_param)
    ob.AlignFilter(align_to_stream=ob.OBStreamType.COLOR_STREAM)
    # Frames of the SDK's own making are not numbered.
    return at, 0, 33_333_000


def azure_kinect():
    import pyk4a

    def camera(of, place, size, parameters):
        return {
            "Intrinsics": {
                "ModelParameterCount": 14, "ModelParameters": parameters,
                "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
            },
            "Purpose": f"CALIBRATION_CameraPurpose{of}", "Location": f"CALIBRATION_CameraLocation{place}",
            "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]},
            "MetricRadius": 1.7, "SensorWidth": size[0], "SensorHeight": size[1],
            "Shutter": "CALIBRATION_ShutterTypeUndefined", "ThermalAdjustmentParams": {"Params": [0] * 12},
        }  # fmt: skip

    def inertial(of):
        return {
            "SensorType": f"CALIBRATION_InertialSensorType_{of}", "Id": "none", "ModelTypeMask": 16,
            "BiasTemperatureModel": [0] * 12, "BiasUncertainty": [0.01] * 3, "Noise": [0.01] * 6,
            "MixingMatrixTemperatureModel": ([1, 0, 0, 0] + [0] * 12) * 2 + [1, 0, 0, 0],
            "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]},
            "SecondOrderScaling": [0] * 9, "TemperatureBounds": [5, 60], "TemperatureC": 0,
        }  # fmt: skip

    tof = [0.5, 0.5, 0.49, 0.49, 0.5, 0.3, 0.01, 0.8, 0.4, 0.05, 0, 0, 0, 0]
    rgb = [0.5, 0.5, 0.49, 0.65, 0.5, -2.5, 1.5, 0.4, -2.3, 1.4, 0, 0, 0.0005, -0.0002]
    cameras = [
        camera("Depth", "D0", (1024, 1024), tof),
        camera("PhotoVideo", "PV0", (4096, 3072), rgb),
    ]
    information = {"Cameras": cameras, "InertialSensors": [inertial("Gyro"), inertial("Accelerometer")]}
    text = json.dumps({"CalibrationInformation": information})
    modes = pyk4a.DepthMode.NFOV_UNBINNED, pyk4a.ColorResolution.RES_720P
    calibration = pyk4a.Calibration.from_raw(text, *modes)
    size = (1280, 720)
    at = calibration.convert_3d_to_2d(tuple(1000.0 * POINT_M), pyk4a.CalibrationType.COLOR)
    depth, colour = blob(size, at, 2000)
    numbers = iter((70, 71, 72))

    def next_images():
        capture = pyk4a.PyK4ACapture(calibration, None, pyk4a.ImageFormat.COLOR_BGRA32)
        # To lay depth over colour the SDK needs a graphics card: the capture holds it already.
        capture._depth = capture._transformed_depth = depth
        capture._depth_timestamp_usec = next(numbers) * 33_333
        capture._color = np.dstack([colour[:, :, ::-1], np.full(size[::-1], 255, dtype=np.uint8)])
        return adapter.images(capture)

    pinhole.send_all("none", *adapter.lens_of(calibration, size), 1000, next_images)
    assert callable(pyk4a.PyK4A.get_capture) and isinstance(pyk4a.PyK4A.calibration, property)
    pyk4a.Config(color_resolution=modes[1], depth_mode=modes[0], color_format=pyk4a.ImageFormat.COLOR_BGRA32)
    return at, 1, 33_333_000


at, n_between, nanos_between = {"oak": oak, "orbbec": orbbec, "azure_kinect": azure_kinect}[sys.argv[2]]()
assert len(SENT) == 2, len(SENT)
(camera, first, began, depth, colour), (_, second, ended, _, _) = SENT
assert (first, second - first, ended - began) == (0, n_between, nanos_between), (first, second, began, ended)
rows, columns = np.nonzero(depth)
assert 40 < len(rows) < 160, len(rows)
metres = depth[rows, columns] / camera["units_per_metre"]
assert np.all(metres == POINT_M[2]), metres
pixel = np.array([columns.mean(), rows.mean()]) + at - np.round(at)
seen = (pixel - (camera["cx"], camera["cy"])) / (camera["fx"], camera["fy"])
wrong_px = np.abs(seen - POINT_M[:2] / POINT_M[2]) * (camera["fx"], camera["fy"])
assert np.all(wrong_px < 0.6), wrong_px
# Where the SDK's lens shows it is elsewhere: the distortion was taken out.
assert np.abs(np.array(at) - pixel).max() > 2.0, (at, pixel)
x, y = (round(v) for v in pixel)
assert tuple(colour[y, x]) == (200, 100, 50), colour[y, x]
print(f"{sys.argv[2]}: {wrong_px.max():.2f} px")
