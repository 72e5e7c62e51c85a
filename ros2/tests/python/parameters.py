"""Asks for the parameters of /tessera as `ros2 param` does and prints each answer as a line of JSON.

    python parameters.py DOMAIN cyclone|plain

As call.py has it: with `cyclone` two numbers before the content say who asks.
"""

import json
import struct
import sys
import time
import types
from dataclasses import dataclass

import numpy
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int64, sequence, uint8, uint64
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


def of(name, /, **fields):
    return STORE.types[f"rcl_interfaces/msg/{name}"](**fields)


def value(kind, **fields):
    empty = dict(
        type=kind, bool_value=False, integer_value=0, double_value=0.0, string_value="",
        byte_array_value=numpy.zeros(0, numpy.uint8), bool_array_value=numpy.zeros(0, bool),
        integer_array_value=numpy.zeros(0, numpy.int64), double_array_value=numpy.zeros(0), string_array_value=[],
    )
    return of("ParameterValue", **(empty | fields))


def made(name, fields):
    """A type of that name in DDS, against which Cyclone checks what is written."""
    of_name = {"typename": f"rcl_interfaces::{name}_"}
    return dataclass(types.new_class("Made", (IdlStruct,), of_name, lambda space: space.update(__annotations__=fields)))


VALUE = made(
    "msg::dds_::ParameterValue",
    {
        "type": uint8, "bool_value": bool, "integer_value": int64, "double_value": float64, "string_value": str,
        "byte_array_value": sequence[uint8], "bool_array_value": sequence[bool],
        "integer_array_value": sequence[int64], "double_array_value": sequence[float64],
        "string_array_value": sequence[str],
    },
)
PARAMETER = made("msg::dds_::Parameter", {"name": str, "value": VALUE})
RESULT = made("msg::dds_::SetParametersResult", {"successful": bool, "reason": str})
LISTED = made("msg::dds_::ListParametersResult", {"names": sequence[str], "prefixes": sequence[str]})
FLOATS = made("msg::dds_::FloatingPointRange", {"from_value": float64, "to_value": float64, "step": float64})
INTEGERS = made("msg::dds_::IntegerRange", {"from_value": int64, "to_value": int64, "step": uint64})
DESCRIPTOR = made(
    "msg::dds_::ParameterDescriptor",
    {
        "name": str, "type": uint8, "description": str, "additional_constraints": str, "read_only": bool,
        "dynamic_typing": bool, "floating_point_range": sequence[FLOATS, 1], "integer_range": sequence[INTEGERS, 1],
    },
)
NAMES = {"names": sequence[str]}
CONTENTS = {
    "ListParameters": ({"prefixes": sequence[str], "depth": uint64}, {"result": LISTED}),
    "GetParameters": (NAMES, {"values": sequence[VALUE]}),
    "GetParameterTypes": (NAMES, {"types": sequence[uint8]}),
    "DescribeParameters": (NAMES, {"descriptors": sequence[DESCRIPTOR]}),
    "SetParameters": ({"parameters": sequence[PARAMETER]}, {"results": sequence[RESULT]}),
    "SetParametersAtomically": ({"parameters": sequence[PARAMETER]}, {"result": RESULT}),
}


def topic(participant, name, service, is_response):
    before = {"guid": uint64, "number": int64} if HEADER else {}
    ending = "Response" if is_response else "Request"
    kind = made(f"srv::dds_::{service}_{ending}", before | CONTENTS[service][is_response])
    messages.raw(kind)
    return kind, Topic(participant, name, kind)


def call(participant, name, service, **fields):
    request, asks = topic(participant, f"rq/tessera/{name}Request", service, False)
    _, answers = topic(participant, f"rr/tessera/{name}Reply", service, True)
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
    kinds = call(participant, "get_parameter_types", "GetParameterTypes", names=asked).types
    described = call(participant, "describe_parameters", "DescribeParameters", names=asked).descriptors
    for name, found, kind, descriptor in zip(asked, values, kinds, described, strict=True):
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
