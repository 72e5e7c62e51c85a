"""Calls a service /tessera/SERVICE of the type std_srvs/srv/Trigger once and prints the reply as a line of JSON.

    python call.py DOMAIN cyclone|plain SERVICE

With `cyclone` the message is that of rmw_cyclonedds: two numbers before the content say who asks. With
`plain` there is the content alone, as rmw_fastrtps has it.
"""

import json
import struct
import sys
import time
from dataclasses import dataclass

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import int64, uint8, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import messages

NAME = "std_srvs::srv::dds_::Trigger_"
# rosbags takes definitions of messages alone.
RESPONSE = "std_srvs/msg/Trigger_Response"
STORE = get_typestore(Stores.ROS2_JAZZY)
STORE.register(get_types_from_msg("bool success\nstring message\n", RESPONSE))
HEADER = struct.pack("<Qq", 0x0123456789ABCDEF, 41)


@dataclass
class CycloneRequest(IdlStruct, typename=NAME + "Request_"):
    guid: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class CycloneResponse(IdlStruct, typename=NAME + "Response_"):
    guid: uint64
    number: int64
    success: bool
    message: str


@dataclass
class PlainRequest(IdlStruct, typename=NAME + "Request_"):
    structure_needs_at_least_one_member: uint8


@dataclass
class PlainResponse(IdlStruct, typename=NAME + "Response_"):
    success: bool
    message: str


messages.raw(CycloneRequest, CycloneResponse, PlainRequest, PlainResponse)


def main():
    is_cyclone, service = sys.argv[2] == "cyclone", sys.argv[3]
    request, response = (CycloneRequest, CycloneResponse) if is_cyclone else (PlainRequest, PlainResponse)
    header = HEADER if is_cyclone else b""
    participant = DomainParticipant(int(sys.argv[1]))
    writer = DataWriter(
        participant, Topic(participant, f"rq/tessera/{service}Request", request), qos=messages.RELIABLE
    )
    reader = DataReader(
        participant, Topic(participant, f"rr/tessera/{service}Reply", response), qos=messages.RELIABLE
    )
    while not writer.get_matched_subscriptions() or not reader.get_matched_publications():
        time.sleep(0.02)
    time.sleep(0.5)
    writer.write(messages.of(request, b"\0\1\0\0" + header + b"\0"))
    while True:
        for sample in reader.take(N=10):
            if not isinstance(sample, messages.Raw):
                continue
            data = sample.data
            assert data[4 : 4 + len(header)] == header, data
            content = data[:4] + data[4 + len(header) :]
            reply = STORE.deserialize_cdr(content, RESPONSE)
            again = bytes(STORE.serialize_cdr(reply, RESPONSE))
            same = content.rstrip(b"\0") == again.rstrip(b"\0") and abs(len(content) - len(again)) < 4
            print(json.dumps({"success": bool(reply.success), "message": reply.message, "same": same}), flush=True)
            return
        time.sleep(0.01)


if __name__ == "__main__":
    main()
