"""Topics and services of ROS 2 over Zenoh: keys, attachments and tokens as rmw_zenoh has them.

With the folder of fleet_certificates.sh in TEST_KEYS links are of TLS, and all go through the router.
"""

import collections
import os
import struct
import time

import zenoh
import zenoh.ext

import messages

# Reliability, durability, history and depth of a token; the rest as by default.
QUALITIES = {
    id(messages.SENSOR): ("2::,5:,:,:,,", 0),
    id(messages.RELIABLE): ("::,100:,:,:,,", 0),
    id(messages.STATIC): (":1:,1:,:,:,,", 1),
}
ATTACHMENT = struct.Struct("<qqB16s")


KEYS = os.environ.get("TEST_KEYS")


def configuration(mode, connect, listen):
    config = zenoh.Config()
    for key, value in (
        ("mode", f'"{mode}"'),
        ("connect/endpoints", connect),
        ("listen/endpoints", listen),
        ("scouting/multicast/enabled", "false"),
        ("timestamping/enabled", "true"),
    ):
        config.insert_json5(key, value)
    if KEYS:
        side, name = ("listen", "base") if mode == "router" else ("connect", "driver")
        for key, value in (
            ("root_ca_certificate", f'"{KEYS}/ca.pem"'),
            ("enable_mtls", "true"),
            (side + "_certificate", f'"{KEYS}/{name}.pem"'),
            (side + "_private_key", f'"{KEYS}/{name}.key"'),
        ):
            config.insert_json5("transport/link/tls/" + key, value)
    return config


def ros_name(kind):
    """As sensor_msgs/msg/Image, from the name in DDS."""
    front, name = kind.split("::dds_::")
    return front.replace("::", "/") + "/" + name.removesuffix("_")


class Node:
    """A node of ROS 2 with the types of a store; one of Humble has no hashes."""

    def __init__(self, domain, endpoint, store, name, is_humble=False):
        self.domain, self.store, self.name, self.is_humble = domain, store, name, is_humble
        # Peers would connect to each other too, past the router.
        mode, listen = ("client", "[]") if KEYS else ("peer", '["tcp/127.0.0.1:0"]')
        self.session = zenoh.open(configuration(mode, f'["{endpoint}"]', listen))
        self.identity = self.session.zid().__str__()
        self.tokens = []
        self.token("0/NN/%/%/" + name)

    def token(self, rest):
        key = f"@ros2_lv/{self.domain}/{self.identity}/0/{rest}"
        self.tokens.append(self.session.liveliness().declare_token(key))

    def end(self, code, topic, kind, quality, type_hash):
        number = len(self.tokens)
        rest = f"{topic.replace('/', '%')}/{kind}/{type_hash}/{quality}"
        self.token(f"{number}/{code}/%/%/{self.name}/{rest}")
        return f"{self.domain}{topic}/{kind}/{type_hash}"

    def hash_of(self, kind):
        return "TypeHashNotSupported" if self.is_humble else self.store.hash_rihs01(ros_name(kind))

    def writer(self, topic, kind, qos=messages.SENSOR):
        return Writer(self, topic, kind.__idl_typename__, *QUALITIES[id(qos)])

    def reader(self, topic, kind, qos=messages.SENSOR):
        return Reader(self, topic, kind.__idl_typename__, *QUALITIES[id(qos)])


class Writer:
    def __init__(self, node, topic, kind, quality, kept):
        key = node.end("MP", topic, kind, quality, node.hash_of(kind))
        self.number = 0
        drop = zenoh.CongestionControl.DROP
        if kept:
            self.publisher = zenoh.ext.declare_advanced_publisher(
                node.session, key, congestion_control=drop, publisher_detection=True,
                cache=zenoh.ext.CacheConfig(max_samples=kept),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
            )
        else:
            self.publisher = node.session.declare_publisher(key, congestion_control=drop)

    def write(self, message):
        self.number += 1
        attachment = ATTACHMENT.pack(self.number, time.time_ns(), 16, b"python's writer.")
        self.publisher.put(message.raw, attachment=attachment)

    def write_nonsense(self):
        self.publisher.put(b"nonsense", attachment=b"odd")


class Reader:
    def __init__(self, node, topic, kind, quality, kept):
        key = node.end("MS", topic, kind, quality, node.hash_of(kind))
        self.samples, self.number = collections.deque(), 0
        if kept:
            self.subscriber = zenoh.ext.declare_advanced_subscriber(
                node.session, key, self.samples.append, subscriber_detection=True,
                history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=kept),
                recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            )
        else:
            self.subscriber = node.session.declare_subscriber(key, self.samples.append)

    def take(self, N=100):
        taken = []
        while self.samples and len(taken) < N:
            sample = self.samples.popleft()
            number, nanos, length, gid = ATTACHMENT.unpack(bytes(sample.attachment))
            assert number > self.number and abs(time.time_ns() - nanos) < 600 * 10**9, (number, nanos)
            assert length == 16 and any(gid), (length, gid)
            self.number = number
            taken.append(messages.Raw(sample.payload))
        return taken
