"""Calls a service /tessera/SERVICE of the type std_srvs/srv/Trigger over Zenoh and prints the reply as a line of JSON.

    python call_zenoh.py DOMAIN ENDPOINT jazzy|humble|nonsense [SERVICE]

With `nonsense` there is neither an attachment nor CDR, and the error is printed.
"""

import json
import sys
import time

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import rmw_zenoh

KIND = "std_srvs::srv::dds_::Trigger_"
HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
# rosbags takes definitions of messages alone.
RESPONSE = "std_srvs/msg/Trigger_Response"
STORE = get_typestore(Stores.ROS2_JAZZY)
STORE.register(get_types_from_msg("bool success\nstring message\n", RESPONSE))
NUMBER, GID = 41, b"python's client."


def main():
    domain, endpoint, form = int(sys.argv[1]), sys.argv[2], sys.argv[3]
    service = sys.argv[4] if len(sys.argv) > 4 else "save_map"
    node = rmw_zenoh.Node(domain, endpoint, STORE, "caller")
    type_hash = "TypeHashNotSupported" if form == "humble" else HASH
    key = node.end("SC", f"/tessera/{service}", KIND, "::,10:,:,:,,", type_hash)
    # As rmw_zenoh_cpp, a client waits until the graph has the server.
    token = f"@ros2_lv/{domain}/*/*/*/SS/*/*/*/%tessera%{service}/{KIND}/*/*"
    while not list(node.session.liveliness().get(token)):
        time.sleep(0.1)
    sent = {"payload": b"no", "attachment": None}
    if form != "nonsense":
        attachment = rmw_zenoh.ATTACHMENT.pack(NUMBER, time.time_ns(), 16, GID)
        sent = {"payload": b"\0\1\0\0\0", "attachment": attachment}
    target = rmw_zenoh.zenoh.QueryTarget.ALL_COMPLETE
    (reply,) = node.session.get(key, target=target, timeout=150, **sent)
    if reply.ok is None:
        print(json.dumps({"error": reply.err.payload.to_string()}), flush=True)
        return
    number, _, length, gid = rmw_zenoh.ATTACHMENT.unpack(bytes(reply.ok.attachment))
    assert (number, length, gid) == (NUMBER, 16, GID), (number, length, gid)
    content = bytes(reply.ok.payload)
    response = STORE.deserialize_cdr(content, RESPONSE)
    again = bytes(STORE.serialize_cdr(response, RESPONSE))
    same = content.rstrip(b"\0") == again.rstrip(b"\0") and abs(len(content) - len(again)) < 4
    print(json.dumps({"success": bool(response.success), "message": response.message, "same": same}), flush=True)


if __name__ == "__main__":
    main()
