"""A camera's driver in a ROS 2 network: plays raw frames to and fro until it is ended.

    python camera.py FOLDER DOMAIN [--compressed] [--faults] [--imu] [--still] [--clock] [--initial] [--jump] [--focal F] [--start N] [--rate HZ] [--router ENDPOINT]

It is one of DDS, and with a router one of Zenoh. FOLDER has camera.json (width, height, fx, fy, cx, cy, n, stamps) and dK.raw, cK.raw.
"""

import argparse
import io
import json
import pathlib
import time

import numpy
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from PIL import Image as Picture
from rosbags.typesys import Stores, get_typestore

import more_messages
import messages

STORE = get_typestore(Stores.ROS2_JAZZY)
TYPES = STORE.types
FRAME = "camera_optical"
# A rate that does not change, radians per second about the axes of the frame imu.
IMU_RATE = (0.2, -0.1, 0.4)
IMU_PERIOD = 5_000_000
# Of a robot that stands on a ramp, along the same axes, m/s^2.
IMU_FORCE = (1.0, 0.0, 9.76)


def make(name, *fields):
    return TYPES[name](*fields)


def stamp_of(nanos):
    return make("builtin_interfaces/msg/Time", nanos // 10**9, nanos % 10**9)


def header(nanos, frame=FRAME):
    return make("std_msgs/msg/Header", stamp_of(nanos), frame)


def image(nanos, width, height, encoding, data):
    data = numpy.frombuffer(data, dtype=numpy.uint8)
    fields = (header(nanos), height, width, encoding, 0, len(data) // height, data)
    return STORE.serialize_cdr(make("sensor_msgs/msg/Image", *fields), "sensor_msgs/msg/Image")


def compressed(nanos, form, data):
    data = numpy.frombuffer(data, dtype=numpy.uint8)
    message = make("sensor_msgs/msg/CompressedImage", header(nanos), form, data)
    return STORE.serialize_cdr(message, "sensor_msgs/msg/CompressedImage")


def camera_info(nanos, camera, factor=1.0):
    fx, fy, cx, cy = camera["fx"] * factor, camera["fy"] * factor, camera["cx"], camera["cy"]
    region = make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
    numbers = lambda *values: numpy.array(values, dtype=numpy.float64)
    message = make(
        "sensor_msgs/msg/CameraInfo",
        header(nanos), camera["height"], camera["width"], "plumb_bob", numbers(0, 0, 0, 0, 0),
        numbers(fx, 0, cx, 0, fy, cy, 0, 0, 1), numbers(1, 0, 0, 0, 1, 0, 0, 0, 1),
        numbers(fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0), 0, 0, region,
    )
    return STORE.serialize_cdr(message, "sensor_msgs/msg/CameraInfo")


def transforms(links):
    made = []
    for parent, child, (x, y, z), (qx, qy, qz, qw) in links:
        transform = make(
            "geometry_msgs/msg/Transform",
            make("geometry_msgs/msg/Vector3", x, y, z),
            make("geometry_msgs/msg/Quaternion", qx, qy, qz, qw),
        )
        made.append(make("geometry_msgs/msg/TransformStamped", header(0, parent), child, transform))
    return STORE.serialize_cdr(make("tf2_msgs/msg/TFMessage", made), "tf2_msgs/msg/TFMessage")


def imu(nanos, is_still):
    vector, covariance = lambda *xyz: make("geometry_msgs/msg/Vector3", *xyz), numpy.zeros(9)
    orientation = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    unknown = numpy.array([-1.0] + 8 * [0.0])
    message = make(
        "sensor_msgs/msg/Imu", header(nanos, "imu"), orientation, unknown, vector(*((0.0, 0.0, 0.0) if is_still else IMU_RATE)), covariance,
        vector(*IMU_FORCE), covariance,
    )
    return STORE.serialize_cdr(message, "sensor_msgs/msg/Imu")


def initial_pose(nanos):
    pose = make(
        "geometry_msgs/msg/Pose", make("geometry_msgs/msg/Point", 0.5, 0.0, 0.0),
        make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
    )
    name = "geometry_msgs/msg/PoseWithCovariance"
    message = make(name + "Stamped", header(nanos, "map"), make(name, pose, numpy.zeros(36)))
    return STORE.serialize_cdr(message, name + "Stamped")


def png(array):
    buffer = io.BytesIO()
    Picture.fromarray(array).save(buffer, "png")
    return buffer.getvalue()


def writers(arguments, name):
    """What makes writers of topics, of a node of that name."""
    if arguments.router:
        import rmw_zenoh

        return rmw_zenoh.Node(arguments.domain, arguments.router, STORE, name).writer
    participant = DomainParticipant(arguments.domain)
    return lambda topic, kind, qos=messages.SENSOR: DataWriter(
        participant, Topic(participant, "rt" + topic, kind), qos=qos
    )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("domain", type=int)
    parser.add_argument("--compressed", action="store_true")
    parser.add_argument("--faults", action="store_true")
    parser.add_argument("--imu", action="store_true")
    parser.add_argument("--still", action="store_true", help="the IMU does not turn")
    parser.add_argument("--clock", action="store_true", help="/clock is the time of the images")
    parser.add_argument("--jump", action="store_true", help="times are earlier once FOLDER has a file of that name")
    parser.add_argument("--initial", action="store_true", help="every 20 images a pose on /initialpose")
    parser.add_argument("--focal", type=float, default=1.0, help="factor on the focal length")
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--router")
    arguments = parser.parse_args()
    camera = json.loads((arguments.folder / "camera.json").read_text())
    width, height, n = camera["width"], camera["height"], camera["n"]
    read = lambda name: (arguments.folder / name).read_bytes()
    writer = writers(arguments, "driver")

    kind = messages.CompressedImage if arguments.compressed else messages.Image
    tail = ("/compressedDepth", "/compressed") if arguments.compressed else ("", "")
    depths = writer("/camera/depth/image_rect_raw" + tail[0], kind)
    colours = writer("/camera/color/image_raw" + tail[1], kind)
    infos = writer("/camera/depth/camera_info", messages.CameraInfo)
    statics = writer("/tf_static", messages.TFMessage, messages.STATIC)
    # The camera is 0.2 m before the base and 1 m above it, and looks along its x.
    links = [
        ("base_link", "camera_link", (0.2, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)),
        ("camera_link", FRAME, (0.0, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5)),
        ("base_link", "imu", (0.0, 0.1, 0.0), (0.0, 0.0, 0.6, 0.8)),
    ]
    statics.write(messages.of(messages.TFMessage, transforms(links)))
    imus = writer("/imu", more_messages.Imu, messages.RELIABLE) if arguments.imu else None
    clocks = writer("/clock", more_messages.Clock) if arguments.clock else None
    initials = writer("/initialpose", more_messages.InitialPose, messages.RELIABLE) if arguments.initial else None
    imu_nanos = camera["stamps"][0]
    period = camera["stamps"][1] - camera["stamps"][0]
    # Another program with an image of its own making.
    other = writers(arguments, "other")
    torn = other("/camera/depth/image_rect_raw", messages.Torn) if arguments.faults else None
    at, first_fault = arguments.start, None
    while True:
        began = time.monotonic()
        # To and fro, while time goes on.
        place = at % (2 * n - 2)
        k = place if place < n else 2 * n - 2 - place
        nanos = camera["stamps"][0] + at * period
        # Faults come once, when they are asked for by a file.
        if first_fault is None and (arguments.folder / "faults").exists():
            first_fault = at
        fault = -1 if first_fault is None else at - first_fault
        if fault >= 40 or (arguments.jump and (arguments.folder / "jump").exists()):
            nanos -= 1000 * 10**9
        depth, colour = read(f"d{k}.raw"), read(f"c{k}.raw")
        factor = 1.3 if 20 <= fault < 25 else arguments.focal
        infos.write(messages.of(messages.CameraInfo, camera_info(nanos, camera, factor)))
        if arguments.compressed:
            inside = png(numpy.frombuffer(depth, dtype=numpy.uint16).reshape(height, width))
            depth = compressed(nanos, "16UC1; compressedDepth png", bytes(12) + inside)
            buffer = io.BytesIO()
            pixels = numpy.frombuffer(colour, dtype=numpy.uint8).reshape(height, width, 3)
            Picture.fromarray(pixels).save(buffer, "jpeg", quality=90)
            colour = compressed(nanos, "rgb8; jpeg compressed bgr8", buffer.getvalue())
        else:
            depth = image(nanos, width, height, "16UC1", depth)
            colour = image(nanos, width, height, "rgb8", colour)
        if 0 <= fault < 3:
            torn.write(messages.of(messages.Torn, STORE.serialize_cdr(header(nanos), "std_msgs/msg/Header")))
            if arguments.router:
                torn.write_nonsense()
        if 10 <= fault < 13:
            depth = image(nanos, width // 2, height, "16UC1", bytes(width * height))
        while imus is not None and imu_nanos <= nanos + 2 * IMU_PERIOD:
            imus.write(messages.of(more_messages.Imu, imu(imu_nanos, arguments.still)))
            imu_nanos += IMU_PERIOD
        if clocks is not None:
            clock = make("rosgraph_msgs/msg/Clock", stamp_of(nanos))
            clocks.write(messages.of(more_messages.Clock, STORE.serialize_cdr(clock, "rosgraph_msgs/msg/Clock")))
        if initials is not None and at % 20 == 19:
            initials.write(messages.of(more_messages.InitialPose, initial_pose(nanos)))
        colours.write(messages.of(kind, colour))
        depths.write(messages.of(kind, depth))
        at += 1
        time.sleep(max(0.0, began + 1 / arguments.rate - time.monotonic()))


if __name__ == "__main__":
    main()
