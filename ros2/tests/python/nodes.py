"""Prints the node that is not of this program, a line of JSON: its name, and the topics of its ends.

    python nodes.py DOMAIN humble|jazzy

The ends are those that Cyclone has discovered by itself.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, sequence, uint8
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_typestore

import messages

PACKAGE = "rmw_dds_common::msg::dds_::"
KIND = "rmw_dds_common/msg/ParticipantEntitiesInfo"
IS_HUMBLE = sys.argv[2] == "humble"
LENGTH = 24 if IS_HUMBLE else 16
STORE = get_typestore(Stores.ROS2_HUMBLE if IS_HUMBLE else Stores.ROS2_JAZZY)


@dataclass
class Gid(IdlStruct, typename=PACKAGE + "Gid_"):
    data: array[uint8, LENGTH]


@dataclass
class NodeEntitiesInfo(IdlStruct, typename=PACKAGE + "NodeEntitiesInfo_"):
    node_namespace: str
    node_name: str
    reader_gid_seq: sequence[Gid]
    writer_gid_seq: sequence[Gid]


@dataclass
class ParticipantEntitiesInfo(IdlStruct, typename=PACKAGE + "ParticipantEntitiesInfo_"):
    gid: Gid
    node_entities_info_seq: sequence[NodeEntitiesInfo]


messages.raw(ParticipantEntitiesInfo)


def main():
    participant = DomainParticipant(int(sys.argv[1]))
    info = DataReader(
        participant, Topic(participant, "ros_discovery_info", ParticipantEntitiesInfo), qos=messages.STATIC
    )
    ends = [
        BuiltinDataReader(participant, BuiltinTopicDcpsSubscription),
        BuiltinDataReader(participant, BuiltinTopicDcpsPublication),
    ]
    topics, participants, newest = [{}, {}], set(), None
    while True:
        for known, reader in zip(topics, ends):
            for sample in reader.take(N=100):
                if sample.sample_info.valid_data:
                    known[sample.key.bytes] = sample.topic_name
                    participants.add(sample.participant_key.bytes)
        for sample in info.take(N=10):
            if isinstance(sample, messages.Raw):
                newest = sample.data
        if newest is not None:
            message = STORE.deserialize_cdr(newest, KIND)
            again = bytes(STORE.serialize_cdr(message, KIND))
            of = lambda gid: bytes(bytearray(gid.data))[:16]
            (node,) = message.node_entities_info_seq
            names = [
                [known.get(of(gid)) for gid in gids]
                for known, gids in zip(topics, (node.reader_gid_seq, node.writer_gid_seq))
            ]
            if all(names[0] + names[1]) and of(message.gid) in participants:
                line = {
                    "namespace": node.node_namespace, "name": node.node_name,
                    "readers": names[0], "writers": names[1],
                    "same": newest.rstrip(b"\0") == again.rstrip(b"\0"),
                }
                print(json.dumps(line), flush=True)
                return
        time.sleep(0.02)


if __name__ == "__main__":
    main()
