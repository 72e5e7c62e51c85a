"""Asks for the parameters of /tessera as `ros2 param` does and prints each answer as a line of JSON.

    python parameters.py DOMAIN cyclone|plain

As call.py has it: with `cyclone` two numbers before the content say who asks.
"""

import json
import struct
import sys
import time
from dataclasses import dataclass

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import sequence, uint8
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import messages
import services

STORE = get_typestore(Stores.ROS2_JAZZY)
for service, (request, response) in services.SERVICES["rcl_interfaces"].items():
    for kind, definition in (("Request", request), ("Response", response)):
        STORE.register(get_types_from_msg(definition, f"rcl_interfaces/msg/{service}_{kind}"))
HEADER = struct.pack("<Qq", 0x0123456789ABCDEF, 41) if sys.argv[2] == "cyclone" else b""


def of(name, **fields):
    return STORE.types[f"rcl_interfaces/msg/{name}"](**fields)


def value(kind, **fields):
    empty = dict(
        type=kind, bool_value=False, integer_value=0, double_value=0.0, string_value="", byte_array_value=[],
        bool_array_value=[], integer_array_value=[], double_array_value=[], string_array_value=[],
    )
    return of("ParameterValue", **(empty | fields))


def topic(participant, name, kind):
    @dataclass
    class Any(IdlStruct, typename=f"rcl_interfaces::srv::dds_::{kind}_"):
        content: sequence[uint8]

    messages.raw(Any)
    return Any, Topic(participant, name, Any)


def call(participant, name, service, **fields):
    request, asks = topic(participant, f"rq/tessera/{name}Request", f"{service}_Request")
    _, answers = topic(participant, f"rr/tessera/{name}Reply", f"{service}_Response")
    writer = DataWriter(participant, asks, qos=messages.RELIABLE)
    reader = DataReader(participant, answers, qos=messages.RELIABLE)
    while not writer.get_matched_subscriptions() or not reader.get_matched_publications():
        time.sleep(0.02)
    time.sleep(0.3)
    kind = f"rcl_interfaces/msg/{service}_Request"
    content = bytes(STORE.serialize_cdr(of(f"{service}_Request", **fields), kind))
    writer.write(messages.of(request, content[:4] + HEADER + content[4:]))
    while True:
        for sample in reader.take(N=10):
            if isinstance(sample, messages.Raw):
                return read(sample.data, f"rcl_interfaces/msg/{service}_Response")
        time.sleep(0.01)


def read(data, kind):
    assert data[4 : 4 + len(HEADER)] == HEADER, data
    content = data[:4] + data[4 + len(HEADER) :]
    reply = STORE.deserialize_cdr(content, kind)
    again = bytes(STORE.serialize_cdr(reply, kind))
    assert content.rstrip(b"\0") == again.rstrip(b"\0") and abs(len(content) - len(again)) < 4, data
    return reply


def plain(found):
    """What a ParameterValue holds."""
    fields = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value"}
    return getattr(found, fields[found.type]) if found.type else None


def main():
    participant = DomainParticipant(int(sys.argv[1]))
    listed = call(participant, "list_parameters", "ListParameters", prefixes=[], depth=0).result.names
    asked = [*listed, "no_such"]
    values = call(participant, "get_parameters", "GetParameters", names=asked).values
    types = call(participant, "get_parameter_types", "GetParameterTypes", names=asked).types
    described = call(participant, "describe_parameters", "DescribeParameters", names=asked).descriptors
    for name, found, kind, descriptor in zip(asked, values, types, described, strict=True):
        assert found.type == kind == descriptor.type and descriptor.name == name, name
        line = {"name": name, "type": int(kind), "value": plain(found), "words": descriptor.description}
        print(json.dumps(line | {"read_only": bool(descriptor.read_only)}), flush=True)
    wanted = [of("Parameter", name=name, value=value(1, bool_value=True)) for name in ("use_sim_time", "no_such")]
    results = call(participant, "set_parameters", "SetParameters", parameters=wanted).results
    whole = call(participant, "set_parameters_atomically", "SetParametersAtomically", parameters=wanted).result
    for found in (*results, whole):
        print(json.dumps({"set": bool(found.successful), "reason": found.reason}), flush=True)


if __name__ == "__main__":
    main()
