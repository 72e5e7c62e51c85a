"""Compares type hashes with those of rosbags: arguments are TYPE HASH pairs."""

import sys

from rosbags.typesys import Stores, get_typestore

import more_messages
import services

for store in (Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY, Stores.ROS2_KILTED):
    types = get_typestore(store)
    more_messages.register(types)
    services.register(types)
    for name, expected in zip(sys.argv[1::2], sys.argv[2::2]):
        found = types.hash_rihs01(name)
        assert found == expected, f"{name} of {store}: {found}, expected {expected}"
print(len(sys.argv) // 2)
