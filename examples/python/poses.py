"""Prints the poses of a run as they come, one line each: stamp, state, position, quaternion.

    python3 poses.py NAME

Needs `pip install iceoryx2==0.10.0`.
"""

import sys
import time

import tessera_client

STATES = ["tracking", "lost", "relocalising"]


def compose(a, b):
    """The pose `a` after `b`; each is x y z, then the quaternion x y z w."""
    x, y, z, w = a[3:]
    t, q = b[:3], b[3:]
    cross = [y * t[2] - z * t[1] + w * t[0], z * t[0] - x * t[2] + w * t[1], x * t[1] - y * t[0] + w * t[2]]
    moved = [
        t[0] + 2 * (y * cross[2] - z * cross[1]) + a[0],
        t[1] + 2 * (z * cross[0] - x * cross[2]) + a[1],
        t[2] + 2 * (x * cross[1] - y * cross[0]) + a[2],
    ]
    turned = [
        w * q[0] + x * q[3] + y * q[2] - z * q[1],
        w * q[1] - x * q[2] + y * q[3] + z * q[0],
        w * q[2] + x * q[1] - y * q[0] + z * q[3],
        w * q[3] - x * q[0] - y * q[1] - z * q[2],
    ]
    return moved + turned


def main():
    link = tessera_client.Link(sys.argv[1])
    poses = link.open("poses", tessera_client.Pose).subscriber_builder().create()
    while True:
        # Before the last look: what came until then is printed.
        is_current = link.is_current()
        while (sample := poses.receive()) is not None:
            pose = sample.payload().contents
            world_from_camera = compose(list(pose.world_from_odom), list(pose.odom_from_camera))
            numbers = " ".join(f"{value:.6f}" for value in world_from_camera)
            print(f"{pose.stamp_nanos * 1e-9:.6f} {STATES[pose.state]} {numbers}", flush=True)
        if not is_current:
            return
        time.sleep(0.005)


if __name__ == "__main__":
    main()
