"""A router of Zenoh on loopback, until it is ended.

    python router.py FILE [ENDPOINT]

Its endpoint, on a port that is free unless it is given, is written into FILE once it listens.
"""

import pathlib
import random
import sys
import time

import zenoh

import rmw_zenoh


def main():
    file = pathlib.Path(sys.argv[1])
    while True:
        link = "tls" if rmw_zenoh.KEYS else "tcp"
        endpoint = sys.argv[2] if len(sys.argv) > 2 else f"{link}/127.0.0.1:{random.randint(20000, 30000)}"
        try:
            session = zenoh.open(rmw_zenoh.configuration("router", "[]", f'["{endpoint}"]'))
            break
        except zenoh.ZError:
            time.sleep(0.2)
    part = file.with_suffix(".part")
    part.write_text(endpoint)
    part.rename(file)
    while not session.is_closed():
        time.sleep(1)


if __name__ == "__main__":
    main()
