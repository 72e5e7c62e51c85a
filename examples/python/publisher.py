"""Sends the frames of a folder in the TUM layout to `tessera run external`, as a camera would.

    tessera run external --name desk &
    python3 publisher.py FOLDER desk [--ring 64] [--frames N] [--relocalise-at INDEX]

Needs `pip install iceoryx2==0.10.0 pillow`. It stands in for a driver: with one, `frames` is
its loop. Without --ring it is live and sends each frame at its time; with a ring it sends only
what is asked for, goes back where it is told to, and nothing is lost. With --relocalise-at the run is
asked to look for its place anew from that image on.
"""

import argparse
import decimal
import pathlib
import time
import tomllib

from PIL import Image

import tessera_client


def rows(path):
    lines = (line.split() for line in path.read_text().splitlines() if line and line[0] != "#")
    # Nanoseconds, exactly: a float has too few digits for times since 1970.
    return [(int(decimal.Decimal(words[0]) * 10**9), words[1]) for words in lines]


def frames(folder):
    """Stamp in nanoseconds, depth file, colour file or None, by the time of depth."""
    colours = rows(folder / "rgb.txt")
    for stamp, depth in rows(folder / "depth.txt"):
        near, colour = min(colours, key=lambda row: abs(row[0] - stamp))
        yield stamp, folder / depth, folder / colour if abs(near - stamp) < 20_000_000 else None


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("run")
    parser.add_argument("--ring", type=int, default=0)
    parser.add_argument("--frames", type=int)
    parser.add_argument("--relocalise-at", type=int)
    arguments = parser.parse_args()
    calibration = tomllib.loads((arguments.folder / "camera.toml").read_text())
    width, height = calibration.pop("width"), calibration.pop("height")
    images = list(frames(arguments.folder))[: arguments.frames]
    camera = tessera_client.Camera(arguments.run, width, height, calibration, arguments.ring)

    def send(index):
        stamp, depth, colour = images[index]
        camera.send(
            index, stamp, Image.open(depth).tobytes(), colour and Image.open(colour).convert("RGB").tobytes(),
            relocalise=index == arguments.relocalise_at,
        )

    if arguments.ring:
        epoch, index = None, 0
        while camera.is_wanted():
            flow = camera.flow
            if flow and flow.epoch != epoch:
                epoch, index = flow.epoch, flow.send_from
            if flow and index < min(flow.send_below, len(images)):
                send(index)
                index += 1
            elif flow and index == len(images) < flow.send_below:
                camera.end(index)
                index += 1
            else:
                time.sleep(0.002)
    else:
        began, first = time.monotonic(), images[0][0]
        for index, (stamp, _, _) in enumerate(images):
            time.sleep(max(0.0, began + (stamp - first) * 1e-9 - time.monotonic()))
            if not camera.is_wanted():
                return
            send(index)
        while camera.is_wanted():
            camera.end(len(images))
            time.sleep(0.05)


if __name__ == "__main__":
    main()
