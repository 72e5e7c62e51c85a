"""Prints each UDP datagram that comes to this machine from an address, a line of JSON each, until it is ended.

    python sniff.py DOMAIN ADDRESS

It needs a raw socket, as in a network namespace of one's own.
"""

import json
import socket
import sys

UDP = 17

raw = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(0x0800))
print(json.dumps({"topic": "ready"}), flush=True)
while True:
    packet, of = raw.recvfrom(65536)
    is_out = of[2] == socket.PACKET_OUTGOING
    source = socket.inet_ntoa(packet[12:16])
    if not is_out and packet[9] == UDP and source == sys.argv[2]:
        to = socket.inet_ntoa(packet[16:20])
        print(json.dumps({"topic": "left", "to": to, "bytes": len(packet)}), flush=True)
