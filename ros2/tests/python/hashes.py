"""Compares type hashes with those of rosbags: arguments are TYPE HASH pairs."""

import sys

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import more_messages

EVENT = "service_msgs/msg/ServiceEventInfo"
# rosbags takes definitions of messages alone: made as messages, these get the names of a service.
TRIGGER = {
    "Trigger_Request": "",
    "Trigger_Response": "bool success\nstring message\n",
    "Trigger_Event": (
        "service_msgs/ServiceEventInfo info\nTrigger_Request[<=1] request\nTrigger_Response[<=1] response\n"
    ),
    "Trigger": "Trigger_Request request_message\nTrigger_Response response_message\nTrigger_Event event_message\n",
}


def renamed(value):
    if isinstance(value, str):
        return value.replace("std_srvs/msg/Trigger", "std_srvs/srv/Trigger")
    return type(value)(map(renamed, value)) if isinstance(value, (tuple, list)) else value


def register_trigger(types):
    definition = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number\n"
    # The store has char for what ROS takes as uint8.
    types.fielddefs[EVENT] = get_types_from_msg(definition, EVENT)[EVENT]
    for name, definition in TRIGGER.items():
        types.fielddefs.update(get_types_from_msg(definition, "std_srvs/msg/" + name))
        types.fielddefs["std_srvs/srv/" + name] = renamed(types.fielddefs["std_srvs/msg/" + name])


for store in (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY, Stores.ROS2_KILTED):
    types = get_typestore(store)
    more_messages.register(types)
    register_trigger(types)
    for name, expected in zip(sys.argv[1::2], sys.argv[2::2]):
        found = types.hash_rihs01(name)
        assert found == expected, f"{name} of {store}: {found}, expected {expected}"
print(len(sys.argv) // 2)
