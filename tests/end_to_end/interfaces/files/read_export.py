"""Reads what `tessera export --mcap` wrote with other people's libraries, and compares.

    python read_export.py FILE.mcap RUN_FOLDER
"""

import pathlib
import struct
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

file, run = sys.argv[1], pathlib.Path(sys.argv[2])


def rows(name):
    lines = (run / name).read_text().splitlines()
    return [[float(word) for word in line.split()] for line in lines if not line.startswith("#")]


def row(message):
    stamp, p, q = message.header.stamp, message.pose.position, message.pose.orientation
    return [stamp.sec + stamp.nanosec * 1e-9, p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def same(found, expected):
    assert len(found) == len(expected), (len(found), len(expected))
    for a, b in zip(found, expected):
        assert all(abs(x - y) < 1e-6 for x, y in zip(a, b)), (a, b)


store = get_typestore(Stores.ROS2_HUMBLE)
found = {}
with open(file, "rb") as stream:
    reader = make_reader(stream, decoder_factories=[DecoderFactory()])
    assert reader.get_header().profile == "ros2"
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        # rosbags has definitions of its own: both must read the same.
        other = store.deserialize_cdr(message.data, schema.name)
        found.setdefault(channel.topic, []).append((decoded, other))
trajectory = rows("trajectory.txt")
for which in (0, 1):
    of = lambda topic: [both[which] for both in found[topic]]
    same([row(message) for message in of("/tessera/pose")], trajectory)
    (path,), (keyframes,), (cloud,) = of("/tessera/path"), of("/tessera/keyframes"), of("/tessera/map")
    same([row(message) for message in path.poses], trajectory)
    same([row(message) for message in keyframes.poses], rows("keyframes.txt"))
    transforms = [message.transforms[0] for message in of("/tf")]
    assert {(t.header.frame_id, t.child_frame_id) for t in transforms} == {("world", "camera")}
    same([[t.transform.translation.x, t.transform.rotation.w] for t in transforms],
         [[row[1], row[7]] for row in trajectory])
    assert [field.name for field in cloud.fields][:4] == ["x", "y", "z", "rgb"]
    data = bytes(cloud.data)
    assert len(data) == cloud.width * cloud.point_step == cloud.row_step and cloud.width > 1000
    for at in range(0, len(data), 97 * cloud.point_step):
        x, y, z, _, nx, ny, nz = struct.unpack_from("<7f", data, at)
        assert max(abs(x), abs(y), abs(z)) < 20 and abs(nx * nx + ny * ny + nz * nz - 1) < 1e-3
print("read", len(trajectory), "poses and", cloud.width, "points")
