"""Prints what a run publishes into a ROS 2 network, a line of JSON each, until it is ended.

    python listen.py DOMAIN [map] [once] [humble] [TOPIC:=OTHER ...] [ENDPOINT]

It is one of DDS, and with the endpoint of a router one of Zenoh, there with `humble` as of ROS 2 Humble.
With `map` it reads the topics of the map as well, with `once` until each that keeps its last message
has sent one. TOPIC:=OTHER reads a topic under another name.
Each message is decoded by rosbags; `same` says that rosbags makes the same bytes of it again.
"""

import base64
import json
import sys
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_typestore

import more_messages
import messages

STORE = get_typestore(Stores.ROS2_JAZZY)
more_messages.register(STORE)


def nanos(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def numbers(position, orientation):
    return [position.x, position.y, position.z, orientation.x, orientation.y, orientation.z, orientation.w]


def odometry(m):
    return {
        "stamp": nanos(m.header), "frame": m.header.frame_id, "child": m.child_frame_id,
        "pose": numbers(m.pose.pose.position, m.pose.pose.orientation),
        "covariance": list(m.pose.covariance), "of_twist": list(m.twist.covariance),
        "twist": [getattr(v, axis) for v in (m.twist.twist.linear, m.twist.twist.angular) for axis in "xyz"],
    }


def pose(m):
    return {
        "stamp": nanos(m.header), "frame": m.header.frame_id,
        "pose": numbers(m.pose.pose.position, m.pose.pose.orientation), "covariance": list(m.pose.covariance),
    }


def transforms(m):
    one = lambda t: {
        "stamp": nanos(t.header), "parent": t.header.frame_id, "child": t.child_frame_id,
        "pose": numbers(t.transform.translation, t.transform.rotation),
    }
    return {"transforms": [one(t) for t in m.transforms]}


def path(m):
    poses = [[nanos(p.header)] + numbers(p.pose.position, p.pose.orientation) for p in m.poses]
    return {"frame": m.header.frame_id, "poses": poses}


def diagnostics(m):
    one = lambda s: {
        "level": int(s.level), "name": s.name, "message": s.message,
        "values": {v.key: v.value for v in s.values},
    }
    return {"stamp": nanos(m.header), "status": [one(s) for s in m.status]}


def cloud(m):
    fields = [[f.name, f.offset, f.datatype, f.count] for f in m.fields]
    shape = [m.height, m.width, m.point_step, m.row_step, m.is_bigendian, m.is_dense]
    data = base64.b64encode(m.data.tobytes()).decode()
    return {"stamp": nanos(m.header), "frame": m.header.frame_id, "fields": fields, "shape": shape, "data": data}


def grid(m):
    origin = numbers(m.info.origin.position, m.info.origin.orientation)
    return {
        "stamp": nanos(m.header), "frame": m.header.frame_id, "cell": float(m.info.resolution), "origin": origin,
        "size": [m.info.width, m.info.height], "data": base64.b64encode(m.data.tobytes()).decode(),
    }


def update(m):
    data = base64.b64encode(m.data.tobytes()).decode()
    return {"stamp": nanos(m.header), "frame": m.header.frame_id, "at": [m.x, m.y], "size": [m.width, m.height], "data": data}


TOPICS = [
    ("/tessera/odom", messages.Odometry, "nav_msgs/msg/Odometry", odometry),
    ("/tessera/pose", more_messages.InitialPose, "geometry_msgs/msg/PoseWithCovarianceStamped", pose),
    ("/tf", messages.TFMessage, "tf2_msgs/msg/TFMessage", transforms),
    ("/tessera/path", messages.Path, "nav_msgs/msg/Path", path),
    ("/diagnostics", messages.DiagnosticArray, "diagnostic_msgs/msg/DiagnosticArray", diagnostics),
]


MAP_TOPICS = [
    ("/tessera/map_points", more_messages.PointCloud2, "sensor_msgs/msg/PointCloud2", cloud),
    ("/tessera/map_cloud", more_messages.PointCloud2, "sensor_msgs/msg/PointCloud2", cloud),
    ("/tessera/grid", more_messages.OccupancyGrid, "nav_msgs/msg/OccupancyGrid", grid),
    ("/tessera/grid_updates", more_messages.OccupancyGridUpdate, "map_msgs/msg/OccupancyGridUpdate", update),
]
KEPT = ["/tessera/map_cloud", "/tessera/grid"]


def makes_readers(domain, words):
    """What makes readers of topics."""
    for endpoint in words:
        if endpoint.startswith(("tcp/", "tls/")):
            import rmw_zenoh

            return rmw_zenoh.Node(domain, endpoint, STORE, "listener", "humble" in words).reader
    participant = DomainParticipant(domain)
    return lambda topic, kind, qos: DataReader(participant, Topic(participant, "rt" + topic, kind), qos=qos)


def main():
    make = makes_readers(int(sys.argv[1]), sys.argv[2:])
    readers = []
    others = dict(word.split(":=") for word in sys.argv[2:] if ":=" in word)
    for topic, kind, name, words in TOPICS + (MAP_TOPICS if "map" in sys.argv[2:] else []):
        qos = messages.STATIC if topic in KEPT else messages.RELIABLE
        topic = others.get(topic, topic)
        readers.append((make(topic, kind, qos), topic, name, words))
    # One that wants more than is offered: with DDS it gets nothing, and the other side is to say why.
    greedy = make("/tessera/odom", messages.Odometry, messages.STATIC)
    print(json.dumps({"topic": "ready"}), flush=True)
    awaited = set(KEPT)
    while awaited or "once" not in sys.argv[2:]:
        for reader, topic, name, words in readers:
            for sample in reader.take(N=100):
                if not isinstance(sample, messages.Raw):
                    continue
                message = STORE.deserialize_cdr(sample.data, name)
                again = bytes(STORE.serialize_cdr(message, name))
                # Payloads are filled up to four bytes.
                same = sample.data[4:].rstrip(b"\0") == again[4:].rstrip(b"\0")
                same = same and abs(len(sample.data) - len(again)) < 4
                line = {"topic": topic, "same": same, "length": len(again)}
                print(json.dumps(line | words(message)), flush=True)
                awaited.discard(topic)
        assert not isinstance(greedy, DataReader) or not greedy.take()
        time.sleep(0.005)


if __name__ == "__main__":
    main()
