"""Prints the tokens below the domain that are not of this program, a line of JSON: a list of what stands
behind session and number.

    python nodes_zenoh.py DOMAIN ENDPOINT there|gone

It waits until the last of the writers is there, or nothing is.
"""

import json
import sys
import time

import rmw_zenoh


def main():
    domain, endpoint, awaited = sys.argv[1:4]
    config = rmw_zenoh.configuration("peer", f'["{endpoint}"]', '["tcp/127.0.0.1:0"]')
    session = rmw_zenoh.zenoh.open(config)
    while True:
        keys = [str(reply.ok.key_expr) for reply in session.liveliness().get(f"@ros2_lv/{domain}/**")]
        tokens = sorted(key.split("/", 5)[5] for key in keys)
        has_all = any("%diagnostics/" in token for token in tokens)
        if (awaited == "there" and has_all) or (awaited == "gone" and not tokens):
            break
        time.sleep(0.1)
    print(json.dumps(tokens), flush=True)


if __name__ == "__main__":
    main()
