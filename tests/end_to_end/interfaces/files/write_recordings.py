"""Writes recordings of a folder in the TUM layout with other people's libraries.

    python write_recordings.py FOLDER OUT

rosbags writes ROS 2 in MCAP and SQLite (its own CDR) and bags of ROS 1, rvl the code of compressed depth, the mcap packages Foxglove's schemas in protobuf and JSON.
"""

import base64
import io
import json
import pathlib
import struct
import sys
import tomllib

import numpy as np
import rvl
from foxglove_schemas_protobuf import CameraCalibration_pb2, CompressedImage_pb2, RawImage_pb2
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer as JsonWriter
from mcap_protobuf.writer import Writer as ProtobufWriter
from PIL import Image
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as RosWriter
from rosbags.typesys import Stores, get_typestore

folder, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
camera = tomllib.loads((folder / "camera.toml").read_text())
width, height, units = camera["width"], camera["height"], camera["units_per_metre"]
K = [camera["fx"], 0.0, camera["cx"], 0.0, camera["fy"], camera["cy"], 0.0, 0.0, 1.0]
P = K[:3] + [0.0] + K[3:6] + [0.0] + K[6:] + [0.0]
D = camera.get("distortion", [0.0] * 5)


def rows(name):
    for line in (folder / name).read_text().splitlines():
        stamp, file = line.split()
        seconds, fraction = stamp.split(".")
        yield int(seconds), int(fraction.ljust(9, "0")), np.array(Image.open(folder / file))


frames = [(s, n, depth, colour) for (s, n, depth), (_, _, colour) in zip(rows("depth.txt"), rows("rgb.txt"))]


def picture(array, kind):
    bytes_io = io.BytesIO()
    Image.fromarray(array).save(bytes_io, kind)
    return bytes_io.getvalue()


def ros(name, depth_of, colour_of, depth_topic, colour_topic, compression=None, storage=StoragePlugin.MCAP):
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    time, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    image, compressed = types["sensor_msgs/msg/Image"], types["sensor_msgs/msg/CompressedImage"]
    info, region = types["sensor_msgs/msg/CameraInfo"], types["sensor_msgs/msg/RegionOfInterest"]
    folder = out / f"{name}_bag"
    writer = RosWriter(folder, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(*compression)
    with writer:
        connections = {}

        def write(topic, kind, message, nanos):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], nanos, store.serialize_cdr(message, kind))

        for s, n, depth, colour in frames:
            head, nanos = header(time(s, n), "camera"), s * 10**9 + n
            calibration = info(
                head, height, width, "plumb_bob", np.array(D), np.array(K), np.eye(3).flatten(), np.array(P),
                0, 0, region(0, 0, 0, 0, False),
            )
            write("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo", calibration, nanos)
            for topic, (form, data, step) in ((depth_topic, depth_of(depth)), (colour_topic, colour_of(colour))):
                data = np.frombuffer(data, np.uint8)
                if step:
                    message = image(head, height, width, form, 0, step, data)
                    write(topic, "sensor_msgs/msg/Image", message, nanos)
                else:
                    write(topic, "sensor_msgs/msg/CompressedImage", compressed(head, form, data), nanos)
    if storage == StoragePlugin.MCAP:
        (next(folder.glob("*.mcap"))).rename(out / f"{name}.mcap")


def ros1(name, compression=None, metres=False, pictures=False):
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    time, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    image, compressed = types["sensor_msgs/msg/Image"], types["sensor_msgs/msg/CompressedImage"]
    info, region = types["sensor_msgs/msg/CameraInfo"], types["sensor_msgs/msg/RegionOfInterest"]
    writer = Ros1Writer(out / f"{name}.bag")
    if compression:
        writer.set_compression(compression)
    with writer:
        connections = {}

        def write(topic, message, nanos):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], nanos, store.serialize_ros1(message, kind))

        for at, (s, n, depth, colour) in enumerate(frames):
            head, nanos = header(at, time(s, n), "camera"), s * 10**9 + n
            calibration = info(
                head, height, width, "plumb_bob", np.array(D), np.array(K), np.eye(3).flatten(), np.array(P),
                0, 0, region(0, 0, 0, 0, False),
            )
            write("/camera/depth/camera_info", calibration, nanos)
            bytes_of = lambda data: np.frombuffer(data, np.uint8)
            if pictures:
                data = header_of_compressed_depth() + picture(millimetres(depth), "PNG")
                message = compressed(head, "16UC1; compressedDepth", bytes_of(data))
                write("/camera/depth/image_raw/compressedDepth", message, nanos)
                message = compressed(head, "rgb8; png compressed rgb8", bytes_of(picture(colour, "PNG")))
                write("/camera/rgb/image_raw/compressed", message, nanos)
                continue
            form, size, data = "16UC1", 2, millimetres(depth).tobytes()
            if metres:
                form, size, data = "32FC1", 4, metres_of(depth).tobytes()
            write("/camera/depth/image", image(head, height, width, form, 0, size * width, bytes_of(data)), nanos)
            message = image(head, height, width, "rgb8", 0, 3 * width, bytes_of(colour.tobytes()))
            write("/camera/rgb/image_color", message, nanos)


def millimetres(depth):
    # The folder's depth is a multiple of a millimetre.
    return (depth.astype(np.uint32) * 1000 // int(units)).astype("<u2")


def header_of_compressed_depth(a=0.0, b=0.0):
    return struct.pack("<iff", 0, a, b)


ros(
    "ros_raw",
    lambda depth: ("16UC1", millimetres(depth).tobytes(), 2 * width),
    lambda colour: ("bgr8", colour[:, :, ::-1].tobytes(), 3 * width),
    "/camera/depth/image_raw", "/camera/color/image_raw", (CompressionMode.STORAGE, CompressionFormat.ZSTD),
)
metres_of = lambda depth: np.where(depth == 0, np.nan, depth / units).astype("<f4")
ros(
    "ros_metres",
    lambda depth: ("32FC1", metres_of(depth).tobytes(), 4 * width),
    lambda colour: ("rgb8", colour.tobytes(), 3 * width),
    "/camera/depth/image_raw", "/camera/color/image_raw",
)
ros(
    "ros_compressed",
    lambda depth: ("16UC1; compressedDepth png", header_of_compressed_depth() + picture(millimetres(depth), "PNG"), 0),
    lambda colour: ("rgb8; png compressed rgb8", picture(colour, "PNG"), 0),
    "/camera/depth/image_raw/compressedDepth", "/camera/color/image_raw/compressed",
)
rvl_of = lambda depth: struct.pack("<II", width, height) + rvl.compress(millimetres(depth).tobytes())[4:]
ros(
    "ros_rvl",
    lambda depth: ("16UC1; compressedDepth rvl", header_of_compressed_depth() + rvl_of(depth), 0),
    lambda colour: ("rgb8; png compressed rgb8", picture(colour, "PNG"), 0),
    "/camera/depth/image_raw/compressedDepth", "/camera/color/image_raw/compressed",
)
ros(
    "ros_mono_jpeg",
    lambda depth: ("16UC1", millimetres(depth).tobytes(), 2 * width),
    lambda colour: ("jpeg", picture(colour, "JPEG"), 0),
    "/camera/depth/image_raw", "/camera/color/image_raw/compressed",
)

ros(
    "ros_sqlite",
    lambda depth: ("16UC1", millimetres(depth).tobytes(), 2 * width),
    lambda colour: ("rgb8", colour.tobytes(), 3 * width),
    "/camera/depth/image_raw", "/camera/color/image_raw", storage=StoragePlugin.SQLITE3,
)
ros(
    "ros_packed",
    lambda depth: ("16UC1", millimetres(depth).tobytes(), 2 * width),
    lambda colour: ("rgb8", colour.tobytes(), 3 * width),
    "/camera/depth/image_raw", "/camera/color/image_raw", (CompressionMode.FILE, CompressionFormat.ZSTD),
    storage=StoragePlugin.SQLITE3,
)
ros1("ros1_plain")
ros1("ros1_bz2", Ros1Writer.CompressionFormat.BZ2, metres=True)
ros1("ros1_lz4", Ros1Writer.CompressionFormat.LZ4)
ros1("ros1_pictures", pictures=True)

with (out / "foxglove_protobuf.mcap").open("wb") as file, ProtobufWriter(file) as writer:
    for s, n, depth, colour in frames:
        stamp, nanos = Timestamp(seconds=s, nanos=n), s * 10**9 + n
        messages = {
            "/depth/info": CameraCalibration_pb2.CameraCalibration(
                timestamp=stamp, width=width, height=height, distortion_model="plumb_bob", D=D, K=K, P=P),
            "/depth": RawImage_pb2.RawImage(
                timestamp=stamp, width=width, height=height, encoding="16UC1", step=2 * width,
                data=millimetres(depth).tobytes()),
            "/rgb": CompressedImage_pb2.CompressedImage(timestamp=stamp, data=picture(colour, "PNG"), format="png"),
        }
        for topic, message in messages.items():
            writer.write_message(topic=topic, message=message, log_time=nanos, publish_time=nanos)

for name, compression in (("foxglove_json_lz4", CompressionType.LZ4), ("foxglove_json", CompressionType.NONE)):
    with (out / f"{name}.mcap").open("wb") as file:
        writer = JsonWriter(file, compression=compression)
        writer.start()
        channels = {
            topic: writer.register_channel(topic, "json", writer.register_schema(schema, "jsonschema", b"{}"))
            for topic, schema in (
                ("/depth/info", "foxglove.CameraCalibration"),
                ("/depth", "foxglove.RawImage"),
                ("/rgb", "foxglove.RawImage"),
            )
        }
        for s, n, depth, colour in frames:
            raw = {"timestamp": {"sec": s, "nsec": n}, "frame_id": "c", "width": width, "height": height}
            text = lambda array: base64.b64encode(array.tobytes()).decode()
            messages = {
                "/depth/info": raw | {"distortion_model": "plumb_bob", "D": D, "K": K, "P": P, "R": []},
                "/depth": raw | {"encoding": "16UC1", "step": 2 * width, "data": text(millimetres(depth))},
                "/rgb": raw | {"encoding": "rgb8", "step": 3 * width, "data": text(colour)},
            }
            for topic, message in messages.items():
                nanos = s * 10**9 + n
                writer.add_message(channels[topic], nanos, json.dumps(message).encode(), nanos)
        writer.finish()
