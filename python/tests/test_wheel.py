"""The installed wheel: python test_wheel.py, or with a recording beside the room: python test_wheel.py FOLDER.

Compares the module with the command of the same wheel, to the byte.
"""

import copy
import multiprocessing
import pathlib
import pickle
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np
import tessera
from tessera import client

N_FRAMES = 60
COMMAND = pathlib.Path(sys.executable).parent / "tessera"


def refused(error, words, call, *arguments, **keywords):
    try:
        call(*arguments, **keywords)
    except error as found:
        assert words in str(found), found
    else:
        raise AssertionError(f"expected {error.__name__}: {words}")


def rows_of(path):
    return b"".join(line for line in path.read_bytes().splitlines(True) if not line.startswith(b"#"))


def points_of(path):
    head, data = path.read_bytes().split(b"end_header\n", 1)
    assert b"format binary_little_endian 1.0" in head
    kinds = [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")]
    points = np.frombuffer(data, kinds + [(name, "u1") for name in ("red", "green", "blue")])
    columns = lambda *names: np.stack([points[name] for name in names], 1)
    return columns("x", "y", "z"), columns("nx", "ny", "nz"), columns("red", "green", "blue")


def same_map(found, expected):
    for name, other in zip(("positions", "normals", "colours"), expected):
        ours = getattr(found, name)
        assert ours.dtype == other.dtype and np.array_equal(ours, other), (name, ours.shape, other.shape)


def the_module_gives_what_the_command_writes(name, out):
    source = tessera.Source(name, {"run.frames": N_FRAMES})
    slam = tessera.Slam(source.camera)
    frames = [
        slam.track(
            frame.depth, frame.colour, stamp_nanos=frame.stamp_nanos, rotation=frame.rotation, up=frame.up
        )
        for frame in source
    ]
    tracked = [frame for frame in frames if frame.is_tracked]
    assert 0 < len(frames) == len(source) <= N_FRAMES and 2 * len(tracked) > len(frames)
    assert all(np.array_equal(frame.covariance, frame.covariance.T) for frame in tracked)
    slam.finish()
    slam.finish()

    run = out / "run"
    words = [COMMAND, "run", name, "--frames", str(N_FRAMES), "--quiet", "--out", run]
    subprocess.run(words, check=True)
    written = tessera.read_run(run)
    for file, ours, theirs in [
        ("trajectory.txt", slam.trajectory(), written.trajectory),
        ("keyframes.txt", slam.keyframes(), written.keyframes),
    ]:
        ours.write_tum(out / file)
        assert (out / file).read_bytes() == rows_of(run / file), f"{file} of {name} differs"
        for column in ("indices", "stamps_nanos", "states", "world_from_camera", "positions_quaternions"):
            assert np.array_equal(getattr(ours, column), getattr(theirs, column)), (file, column)
    same_map(slam.map(), points_of(run / "map.ply"))
    same_map(written.map, points_of(run / "map.ply"))
    assert written.summary["verdict"]["grade"] in ("good", "doubtful", "failed")
    refused(ValueError, "the run is finished", slam.track, source[0].depth, t=1e9)
    print(f"{name}: {len(slam.trajectory())} poses and {len(slam.map())} points, the bytes of the command")


def a_lost_frame_says_so():
    source = tessera.Source("room", {"run.frames": 12})
    slam = tessera.Slam(source.camera)
    before = [slam.track(frame.depth, frame.colour) for frame in source][-1]
    lost = slam.track(np.zeros_like(source[0].depth))
    assert (lost.state, lost.is_tracked, lost.covariance) == ("lost", False, None) and lost.reason
    # A prediction: near the pose before, and not the identity.
    gap = np.abs(lost.world_from_camera - before.world_from_camera).max()
    assert gap < 0.1 and not np.array_equal(lost.world_from_camera, np.eye(4)), lost
    trajectory = slam.trajectory()
    assert trajectory.states[-1] == "lost" and trajectory.is_tracked.tolist() == 12 * [True] + [False]
    # A run that is not finished can be looked at, and goes on.
    n_points = len(slam.map())
    assert n_points > 1000 and len(slam.keyframes()) >= 1
    assert slam.track(source[11].depth, source[11].colour).index == 13


def a_place_is_looked_for_anew():
    source = tessera.Source("room", {"run.frames": 20})
    slam = tessera.Slam(source.camera)
    for frame in source:
        if slam.track(frame.depth, frame.colour).index == 14:
            slam.relocalise()
    slam.finish()
    states = slam.trajectory().states.tolist()
    assert states[:15] == 15 * ["tracking"] and states[15] == "relocalising" and states[19] == "tracking", states
    refused(ValueError, "the run is finished", slam.relocalise)


def a_degenerate_frame_says_so():
    depth = np.full((240, 320), 2000, np.uint16)
    slam = tessera.Slam(tessera.Camera(320, 240, 260.0, 260.0, 159.5, 119.5))
    frames = [slam.track(depth) for _ in range(4)]
    assert frames[-1].state == "degenerate" and "held by the prediction" in frames[-1].reason, frames[-1]
    assert frames[-1].is_tracked and frames[-1].covariance is not None


def cameras_come_from_files_keys_and_matrices():
    keys = {"width": 64, "height": 48, "fx": 60, "fy": 60.0, "cx": 31.5, "cy": 23.5, "units_per_metre": 5000}
    matrix = np.array([[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]], np.float32)
    camera = tessera.Camera(64, 48, 60.0, 60.0, 31.5, 23.5, units_per_metre=5000)
    assert tessera.Camera.from_dict(keys) == camera == tessera.Camera.from_matrix(matrix, 64, 48, 5000)
    assert tessera.Camera.from_dict(camera.to_dict()) == camera and eval(f"tessera.{camera!r}") == camera
    assert tessera.Slam(keys).camera == camera
    distorted = tessera.Camera.from_matrix(matrix, 64, 48, 5000, distortion=np.array([0.1, 0, 0, 0, 0]))
    assert distorted.to_dict()["distortion"][0] == 0.1 and distorted != camera
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "camera.toml"
        file.write_text("".join(f"{key} = {value}\n" for key, value in keys.items()))
        assert tessera.Slam(file).camera == camera == tessera.Camera.load(str(file))
    assert tessera.Camera.load("freiburg1").width == 640
    refused(ValueError, "no camera 'nothing'", tessera.Slam, "nothing")
    refused(ValueError, "missing field `fx`", tessera.Slam, {key: keys[key] for key in keys if key != "fx"})
    refused(ValueError, "unknown field `f`", tessera.Slam, {**keys, "f": 1})
    refused(ValueError, "fx is None, expected a number", tessera.Slam, {**keys, "fx": None})
    refused(ValueError, "fx is 0, expected", tessera.Slam, {**keys, "fx": 0})
    refused(ValueError, "expected [[fx, 0, cx]", tessera.Camera.from_matrix, np.eye(4), 64, 48)
    refused(ValueError, "expected [[fx, 0, cx]", tessera.Camera.from_matrix, matrix.T, 64, 48)
    refused(ValueError, "expected five numbers", tessera.Camera.from_matrix, matrix, 64, 48, 1000, [0.1, 0.2])


def cameras_have_fields_pickle_and_print():
    camera = tessera.Camera(64, 48, 60.0, 61.0, 31.5, 23.5, units_per_metre=5000)
    assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion) == (60.0, 61.0, 31.5, 23.5, (0.0,) * 5)
    assert np.array_equal(camera.matrix, [[60, 0, 31.5], [0, 61, 23.5], [0, 0, 1]])
    distorted = tessera.Camera.from_matrix(camera.matrix, 64, 48, 5000, [0.1, 0, 0, 0, 0])
    for one in (camera, distorted):
        assert pickle.loads(pickle.dumps(one)) == one == copy.deepcopy(one)
        assert eval(f"tessera.{one!r}") == one and "\n" not in repr(one)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(focal_length, [camera]) == [60.0]
    assert tessera.__version__.count(".") == 2


def focal_length(camera):
    return camera.fx


def results_are_at_hand_and_print_in_a_line():
    source = tessera.Source("room", {"run.frames": 20})
    slam = tessera.Slam(source.camera)
    for frame in source:
        found = slam.track(frame.depth, color=frame.color)
    slam.finish()
    mesh, verdict, counts = slam.mesh(voxel_m=0.03), slam.verdict(), slam.counts()
    assert len(mesh.triangles) > 1000 and mesh.triangles.max() < len(mesh.positions) == len(mesh.colors)
    assert verdict.grade == "good" and all(reason.found for reason in verdict.reasons)
    assert counts["submaps"] == 1 and counts["apart"] == {}
    for result in (found, slam, slam.trajectory(), slam.map(), mesh, verdict, source[0]):
        assert len(repr(result)) < 300 and "\n" not in repr(result), repr(result)
    refused(ValueError, "voxel_m is 0, expected 0.001 to 1", slam.mesh, 0.0)
    refused(ValueError, "found colour and color", slam.track, frame.depth, frame.colour, color=frame.colour)


def a_run_begins_in_the_map_of_another_as_the_command_does():
    with tempfile.TemporaryDirectory() as folder:
        first, second = (pathlib.Path(folder) / name for name in ("first", "second"))
        name = f"wheel-map-{time.time_ns()}"
        run = [COMMAND, "run", "room", "--quiet", "--frames"]
        subprocess.run([*run, "40", "--name", name + "a", "--out", first], check=True)
        subprocess.run([*run, "20", "--name", name + "b", "--map", first, "--out", second], check=True)
        before = {path.name: path.read_bytes() for path in first.iterdir()}
        source = tessera.Source("room", {"run.frames": 20})
        slam = tessera.Slam(source.camera, map=first)
        for frame in source:
            slam.track(frame.depth, frame.colour, stamp_nanos=frame.stamp_nanos, rotation=frame.rotation)
        slam.finish()
        slam.trajectory().write_tum(second / "again.txt")
        assert rows_of(second / "again.txt") == rows_of(second / "trajectory.txt")
        same_map(slam.map(), points_of(second / "map.ply"))
        loops, counts = slam.loops(), slam.counts()
        assert sum(loop.is_closed for loop in loops) == counts["loops_closed"] > 0
        assert all(loop.newer > loop.older >= 0 for loop in loops)
        assert tessera.read_run(second).loops == loops
        assert before == {path.name: path.read_bytes() for path in first.iterdir()}
        refused(ValueError, "is no folder of a run", tessera.Slam, source.camera, map=folder)
        smaller = tessera.Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
        refused(ValueError, "was made with another kind of camera", tessera.Slam, smaller, map=first)


def what_is_wrong_is_named():
    camera = tessera.Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    slam = tessera.Slam(camera, settings={"surface.step": 2})
    depth = np.full((48, 64), 1500, np.uint16)
    refused(ValueError, "depth has shape (48, 63), expected (48, 64)", slam.track, depth[:, 1:])
    refused(ValueError, "depth has shape (64, 48), expected (48, 64)", slam.track, depth.T)
    refused(ValueError, "these look like millimetres", slam.track, depth.astype(np.float32))
    refused(TypeError, "depth is int32, expected uint16", slam.track, depth.astype(np.int32))
    refused(ValueError, "colour has shape (48, 64), expected", slam.track, depth, depth)
    refused(TypeError, "colour is float64, expected uint8", slam.track, depth, np.zeros((48, 64, 3)))
    refused(ValueError, "t is nan", slam.track, depth, None, float("nan"))
    refused(ValueError, "expected one of them", slam.track, depth, None, 1.0, stamp_nanos=10**9)
    refused(ValueError, "expected 0 to 9000000000 s", slam.track, depth, None, -1.0)
    refused(ValueError, "expected a unit quaternion", slam.track, depth, None, 1.0, rotation=[0.0] * 6)
    assert slam.track(depth, None, 2.0).index == 0
    refused(ValueError, "t is 2 s, expected more than the 2 s", slam.track, depth, None, 2.0)
    refused(ValueError, "surface.step is 3, expected 1, 2, 4 or 8", tessera.Slam, camera, None, {"surface.step": 3})
    refused(ValueError, "nearest known key is `surface.step`", tessera.Slam, camera, settings={"surface.stp": 2})
    refused(ValueError, "no source", tessera.Source, "/nowhere")
    refused(IndexError, "frame 3 is not there", tessera.Source("room", {"run.frames": 3}).__getitem__, 3)
    with tempfile.TemporaryDirectory() as folder:
        refused(ValueError, "expected the folder of a run", tessera.read_run, folder)
    # Both kinds of depth, and images that do not lie in one piece, are the same images.
    metres = (depth / 1000.0).astype(np.float32)
    metres[0, :3], depth[0, :3] = [np.nan, np.inf, -1.0], 0
    wide = np.zeros((48, 128), np.uint16)
    wide[:, ::2] = depth
    maps = []
    for image in (depth, metres, metres.astype(np.float64), wide[:, ::2]):
        slam = tessera.Slam(camera)
        slam.track(image)
        maps.append(slam.map())
    assert len(maps[0]) > 10
    for other in maps[1:]:
        same_map(other, (maps[0].positions, maps[0].normals, maps[0].colours))


def other_threads_go_on():
    source = tessera.Source("room", {"run.frames": 10})
    slam, frames = tessera.Slam(source.camera), list(source)
    counts, is_over = [0, 0], threading.Event()

    def count():
        while not is_over.is_set():
            counts[0] += 1
            time.sleep(1e-4)

    def look():
        while not is_over.is_set():
            counts[1] += len(slam.trajectory()) >= 0

    # From here on a thread gives the interpreter away of its own accord alone.
    sys.setswitchinterval(1000.0)
    threads = [threading.Thread(target=work) for work in (count, look)]
    for thread in threads:
        thread.start()
    for frame in frames:
        slam.track(frame.depth, frame.colour)
    is_over.set()
    for thread in threads:
        thread.join()
    sys.setswitchinterval(0.005)
    assert counts[0] > 1 and counts[1] > 1, counts


def the_client_refuses_what_does_not_fit():

    assert len(client.pixels("depth", np.zeros((48, 64), np.uint16), "H", (48, 64))) == 2 * 48 * 64
    refused(TypeError, "expected uint16", client.pixels, "depth", np.zeros((48, 64), np.float32), "H", (48, 64))
    refused(ValueError, "has shape (64, 48)", client.pixels, "depth", np.zeros((64, 48), np.uint16), "H", (48, 64))


def main():
    cameras_come_from_files_keys_and_matrices()
    cameras_have_fields_pickle_and_print()
    a_run_begins_in_the_map_of_another_as_the_command_does()
    results_are_at_hand_and_print_in_a_line()
    what_is_wrong_is_named()
    a_lost_frame_says_so()
    a_place_is_looked_for_anew()
    a_degenerate_frame_says_so()
    other_threads_go_on()
    the_client_refuses_what_does_not_fit()
    for name in ["room", *map(str, map(pathlib.Path.resolve, map(pathlib.Path, sys.argv[1:])))]:
        with tempfile.TemporaryDirectory() as out:
            the_module_gives_what_the_command_writes(name, pathlib.Path(out))


if __name__ == "__main__":
    main()
