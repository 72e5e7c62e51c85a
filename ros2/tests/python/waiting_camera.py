"""A camera that sends an image only after the odometry of the one before, and whose times jump ahead once.

    python waiting_camera.py FOLDER DOMAIN JUMP_SECONDS

FOLDER is that of camera.py. Each image is sent once. Prints a line of JSON for each: its time, how long its first
odometry took, seconds, and the largest variance stated there.
"""

import json
import pathlib
import sys
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

import camera as driver
import messages

N_BEFORE, N_BEHIND = 6, 8
BETWEEN_S = 0.2


class Waiting:
    def __init__(self, folder, domain):
        self.folder, self.camera = folder, json.loads((folder / "camera.json").read_text())
        participant = self.participant = DomainParticipant(domain)
        topic = lambda name, kind: Topic(participant, "rt" + name, kind)
        writer = lambda name, kind: DataWriter(participant, topic(name, kind), qos=messages.RELIABLE)
        self.depths = writer("/camera/depth/image_rect_raw", messages.Image)
        self.infos = writer("/camera/depth/camera_info", messages.CameraInfo)
        self.odometry = DataReader(participant, topic("/tessera/odom", messages.Odometry), qos=messages.RELIABLE)

    def send(self, at, jumped_nanos):
        stamps, (width, height) = self.camera["stamps"], (self.camera["width"], self.camera["height"])
        nanos = stamps[0] + at * (stamps[1] - stamps[0]) + jumped_nanos
        # To and fro, as camera.py.
        n = self.camera["n"]
        place = at % (2 * n - 2)
        depth = (self.folder / f"d{min(place, 2 * n - 2 - place)}.raw").read_bytes()
        self.infos.write(messages.of(messages.CameraInfo, driver.camera_info(nanos, self.camera)))
        self.depths.write(messages.of(messages.Image, driver.image(nanos, width, height, "16UC1", depth)))
        return nanos

    def take(self):
        """Time and largest variance of each odometry that came."""
        samples = [sample for sample in self.odometry.take(N=100) if isinstance(sample, messages.Raw)]
        read = [driver.STORE.deserialize_cdr(sample.data, "nav_msgs/msg/Odometry") for sample in samples]
        stamp = lambda m: m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
        return {stamp(m): float(max(m.pose.covariance)) for m in reversed(read)}


def main():
    waiting = Waiting(pathlib.Path(sys.argv[1]), int(sys.argv[2]))
    jump_nanos, at, answered = round(float(sys.argv[3]) * 1e9), 0, {}
    # The run begins with the first images that it hears.
    while not answered:
        waiting.send(at, 0)
        at += 1
        time.sleep(BETWEEN_S)
        answered = waiting.take()
    for k in range(N_BEFORE + N_BEHIND):
        began, nanos, found = time.monotonic(), waiting.send(at, jump_nanos if k >= N_BEFORE else 0), {}
        while nanos not in found:
            time.sleep(0.002)
            found = waiting.take()
        line = {"stamp": nanos, "seconds": time.monotonic() - began, "variance": found[nanos]}
        print(json.dumps(line | {"jumped": k >= N_BEFORE}), flush=True)
        at += 1


if __name__ == "__main__":
    main()
