"""Prints what comes on /parameter_events, a line of JSON each, until it is ended.

    python parameter_events.py DOMAIN plain

The second word is that of parameters.py, whose types these are.
"""

import json
import sys
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl.types import sequence
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

import messages
from parameters import PARAMETER, STORE, made, plain

KIND = "rcl_interfaces/msg/ParameterEvent"
LISTS = ("new_parameters", "changed_parameters", "deleted_parameters")
EVENT = made("msg::dds_::ParameterEvent", {"stamp": messages.Time, "node": str} | {name: sequence[PARAMETER] for name in LISTS})


def main():
    messages.raw(EVENT)
    participant = DomainParticipant(int(sys.argv[1]))
    reader = DataReader(participant, Topic(participant, "rt/parameter_events", EVENT), qos=messages.RELIABLE)
    while True:
        for sample in reader.take(N=10):
            if not isinstance(sample, messages.Raw):
                continue
            event = STORE.deserialize_cdr(sample.data, KIND)
            again = bytes(STORE.serialize_cdr(event, KIND))
            same = sample.data.rstrip(b"\0") == again.rstrip(b"\0") and abs(len(sample.data) - len(again)) < 4
            lists = {name: {p.name: plain(p.value) for p in getattr(event, name)} for name in LISTS}
            line = {"node": event.node, "sec": int(event.stamp.sec), "same": same}
            print(json.dumps(line | lists), flush=True)
        time.sleep(0.01)


if __name__ == "__main__":
    main()
