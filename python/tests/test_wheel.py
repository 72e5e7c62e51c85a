"""The wheel against the command: python test_wheel.py FOLDER, in an environment that has it installed.

FOLDER is a recording in the TUM layout with `camera.toml` and PNG images. Needs pillow beside the wheel.
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import tessera
from PIL import Image


def frames(folder, n):
    read = lambda name: [line.split() for line in (folder / name).read_text().splitlines() if line[:1] != "#"]
    colours = read("rgb.txt")
    for stamp, file in read("depth.txt")[:n]:
        near = min(colours, key=lambda row: abs(float(row[0]) - float(stamp)))
        colour = Image.open(folder / near[1]).convert("RGB") if abs(float(near[0]) - float(stamp)) < 0.02 else None
        yield float(stamp), np.array(Image.open(folder / file)).astype(np.uint16), colour and np.array(colour)


def refused(error, words, call, *arguments):
    try:
        call(*arguments)
    except error as found:
        assert words in str(found), found
    else:
        raise AssertionError(f"expected {error.__name__}: {words}")


def same_as_the_command(folder, n):
    slam = tessera.Slam(tessera.Camera.load(str(folder / "camera.toml")))
    for stamp, depth, colour in frames(folder, n):
        frame = slam.track(depth, colour, stamp)
        assert frame.state == "tracking", frame
        assert frame.covariance.shape == (6, 6) and np.allclose(frame.covariance, frame.covariance.T)
    online = slam.trajectory()
    assert online.world_from_camera.shape == (n, 4, 4)
    cloud = slam.map()
    command = pathlib.Path(sys.executable).parent / "tessera"
    command = str(command) if command.exists() else shutil.which("tessera")
    with tempfile.TemporaryDirectory() as out:
        run = pathlib.Path(out) / "run"
        subprocess.run([command, "run", folder, "--frames", str(n), "--quiet", "--out", run], check=True)
        written = tessera.read_run(run)
    found = slam.trajectory()
    assert np.array_equal(np.round(found.stamps, 6), np.round(written.trajectory.stamps, 6))
    # The file has nine digits.
    worst = np.abs(found.world_from_camera - written.trajectory.world_from_camera).max()
    assert worst < 5e-9, worst
    for ours, theirs in zip(cloud, written.map):
        assert np.array_equal(ours, theirs), (ours.shape, theirs.shape)
    assert written.summary["verdict"]["grade"] in ("good", "doubtful")
    refused(ValueError, "the run is finished", slam.track, depth, colour, stamp + 1)
    print(f"{n} frames as the command has them: poses within {worst:.1e} m, {len(cloud.positions)} points the same")


def what_is_wrong_is_named():
    camera = tessera.Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    slam = tessera.Slam(camera, settings={"surface.step": 2})
    depth = np.full((48, 64), 1500, np.uint16)
    refused(ValueError, "depth has shape (48, 63), expected (48, 64)", slam.track, depth[:, 1:])
    refused(TypeError, "depth is int32, expected uint16", slam.track, depth.astype(np.int32))
    refused(TypeError, "colour is float64, expected uint8", slam.track, depth, np.zeros((48, 64, 3)))
    refused(ValueError, "colour has shape (48, 64), expected", slam.track, depth, np.zeros((48, 64), np.uint8))
    refused(ValueError, "t is nan", slam.track, depth, None, float("nan"))
    slam.track(depth, None, 2.0)
    refused(ValueError, "t is 2 s, expected more than the 2 s", slam.track, depth, None, 2.0)
    refused(ValueError, "surface.step is 3, expected 1, 2, 4 or 8", tessera.Slam, camera, None, {"surface.step": 3})
    refused(ValueError, "no camera 'nothing'", tessera.Camera.load, "nothing")
    # Metres and units are the same images.
    metres = depth / 1000.0
    metres[0, 0], metres[0, 1], depth[0, :2] = np.nan, np.inf, 0
    a, b = tessera.Slam(camera), tessera.Slam(camera)
    a.track(depth), b.track(metres.astype(np.float32))
    assert all(np.array_equal(x, y) for x, y in zip(a.map(), b.map()))
    assert len(a.map().positions) > 10


what_is_wrong_is_named()
same_as_the_command(pathlib.Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 40)
