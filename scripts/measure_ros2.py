#!/usr/bin/env python3
"""What joining a ROS 2 network costs and keeps: a recording is published as a camera's driver does, raw
depth and colour, and the odometry that comes back is compared with a live run of the same recording.

    cargo build --release --bin tessera
    cargo build --release --manifest-path ros2/Cargo.toml --features zenoh
    cargo test --manifest-path ros2/Cargo.toml            # makes the Python with the packages, once
    ros2/target/python-ros2/bin/python scripts/measure_ros2.py ../shared/data/kitchen_450 [--carrier zenoh]

All times are of the machine's monotonic clock. `latency` is from the moment before an image's first byte is
written by the publisher to the odometry in a reader's hands; `pipeline` is the run's own end-to-end latency,
from the frame in its shared memory to its pose, of the same run. Their difference is what the carrying adds,
two passes through the network stack and the publisher's own `writing` among it. CPU is that of tessera-ros2
alone, all threads, from the first image to the last odometry. `ate_map_m` is that of the transforms from map
to base_link, and without a network that of the poses as they were published. With --in-step each image waits for the
odometry of the one before, so that none is dropped on a slow machine; nothing is timed then.
"""

import argparse
import json
import multiprocessing
import os
import pathlib
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "ros2/tests/python"))
CYCLONE = (
    '<CycloneDDS><Domain Id="any"><General><Interfaces><NetworkInterface address="127.0.0.1" multicast="false"/>'
    "</Interfaces><AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto"
    '</ParticipantIndex><MaxAutoParticipantIndex>20</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/>'
    "</Peers></Discovery></Domain></CycloneDDS>"
)
# Not at the beginning of time.
EPOCH_NANOS = 1_700_000_000 * 10**9
PATIENCE_S = 120.0


def fail(words):
    sys.exit(f"measure_ros2: {words}")


def listing(file):
    rows = [line.split() for line in file.read_text().splitlines() if line.strip() and not line.startswith("#")]
    return [(round(float(stamp) * 1e9), file.parent / name) for stamp, name in rows]


def load(folder, n_frames):
    """Camera and frames (nanoseconds, depth bytes, colour bytes or None) of a folder in the TUM layout."""
    import numpy
    from PIL import Image

    camera = tomllib.loads((folder / "camera.toml").read_text())
    if camera.get("units_per_metre") != 1000.0:
        fail(f"{folder}/camera.toml: units_per_metre is {camera.get('units_per_metre')}, expected 1000 as 16UC1 has it")
    colours, frames = listing(folder / "rgb.txt"), []
    for nanos, path in listing(folder / "depth.txt")[:n_frames]:
        depth = numpy.asarray(Image.open(path)).astype("<u2")
        near, colour = min(colours, key=lambda row: abs(row[0] - nanos))
        is_pair = abs(near - nanos) < 20_000_000
        frames.append((nanos, depth.tobytes(), numpy.asarray(Image.open(colour)).tobytes() if is_pair else None))
    return camera, frames


class Nodes:
    """What makes readers and writers of topics, with DDS or Zenoh."""

    def __init__(self, arguments, name):
        if arguments.router:
            import rmw_zenoh
            from camera import STORE

            # Its session ends with it.
            node = self.node = rmw_zenoh.Node(arguments.domain, arguments.router, STORE, name)
            self.writer, self.reader = node.writer, node.reader
            return
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        participant = self.participant = DomainParticipant(arguments.domain)
        topic = lambda name, kind: Topic(participant, "rt" + name, kind)
        self.writer = lambda name, kind, qos: DataWriter(participant, topic(name, kind), qos=qos)
        self.reader = lambda name, kind, qos: DataReader(participant, topic(name, kind), qos=qos)


def listen(arguments, pipe):
    """Tells for each odometry when it came, its time and pose; for each transform the pose in map."""
    import messages
    from camera import STORE

    nodes = Nodes(arguments, "listener")
    odometry = nodes.reader("/tessera/odom", messages.Odometry, messages.RELIABLE)
    transforms = nodes.reader("/tf", messages.TFMessage, messages.RELIABLE)
    # Of a writer that goes there is a sample without a message.
    taken = lambda reader: [sample for sample in reader.take(N=50) if isinstance(sample, messages.Raw)]
    wait = lambda: time.sleep(0.0002)
    if not arguments.router:
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.util import duration

        waits = WaitSet(nodes.participant)
        state = ViewState.Any | SampleState.NotRead | InstanceState.Any
        conditions = [ReadCondition(reader, state) for reader in (odometry, transforms)]
        for condition in conditions:
            waits.attach(condition)
        wait = lambda: waits.wait(duration(milliseconds=100))
    pipe.send("ready")
    while not pipe.poll() or pipe.recv() != "end":
        wait()
        for sample in taken(odometry):
            came = time.monotonic_ns()
            message = STORE.deserialize_cdr(sample.data, "nav_msgs/msg/Odometry")
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            pose = message.pose.pose
            pipe.send(("odometry", came, stamp, pose_of(pose.position, pose.orientation)))
        for sample in taken(transforms):
            message = STORE.deserialize_cdr(sample.data, "tf2_msgs/msg/TFMessage")
            map_odom, odom_base = (pose_of(t.transform.translation, t.transform.rotation) for t in message.transforms)
            stamp = message.transforms[1].header.stamp
            pipe.send(("map", 0, stamp.sec * 10**9 + stamp.nanosec, product(map_odom, odom_base)))
    pipe.send("ended")


def pose_of(at, turn):
    return [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]


def product(a, b):
    """Poses as translation and quaternion x y z w, one behind the other."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a[3:], b[3:]
    cross = lambda u, v: [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    twice = [2 * c for c in cross([ax, ay, az], b[:3])]
    more = cross([ax, ay, az], twice)
    moved = [p + q + aw * t + m for p, q, t, m in zip(a[:3], b[:3], twice, more)]
    return moved + [
        aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz,
    ]


class Publisher:
    """A camera's driver: messages are made once, and only their time is written anew."""

    def __init__(self, arguments, camera, frames):
        import camera as driver
        import messages

        nodes = self.nodes = Nodes(arguments, "driver")
        self.messages, width, height = messages, camera["width"], camera["height"]
        self.infos = nodes.writer("/camera/depth/camera_info", messages.CameraInfo, messages.SENSOR)
        self.colours = nodes.writer("/camera/color/image_raw", messages.Image, messages.SENSOR)
        self.depths = nodes.writer("/camera/depth/image_rect_raw", messages.Image, messages.SENSOR)
        self.info = bytearray(driver.camera_info(0, camera))
        image = lambda encoding, data: bytearray(driver.image(0, width, height, encoding, data))
        self.images = [(image("16UC1", depth), colour and image("rgb8", colour)) for _, depth, colour in frames]
        self.n_bytes = sum(len(depth) + len(colour or b"") for depth, colour in self.images)

    def send(self, index, nanos):
        """Sends an image with its colour; the times before its first byte and after its last."""
        depth, colour = self.images[index]
        now = divmod(EPOCH_NANOS + nanos, 10**9)
        for message in (self.info, depth, colour):
            if message is not None:
                struct.pack_into("<II", message, 4, *now)
        kinds, of = self.messages, self.messages.of
        made = [of(kinds.CameraInfo, self.info), colour and of(kinds.Image, colour), of(kinds.Image, depth)]
        began = time.monotonic_ns()
        for writer, message in zip((self.infos, self.colours, self.depths), made):
            if message is not None:
                writer.write(message)
        return began, time.monotonic_ns()


def cpu_nanos(pid):
    """CPU time of all threads of a process."""
    tasks = pathlib.Path(f"/proc/{pid}/task").iterdir()
    return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks)


def peak_mb(pid):
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def switches(pid):
    """How often threads of a process went to sleep."""
    tasks = pathlib.Path(f"/proc/{pid}/task").iterdir()
    return sum(int((task / "status").read_text().split("voluntary_ctxt_switches:")[1].split()[0]) for task in tasks)


def start_router(folder):
    file = folder / "endpoint"
    script = ROOT / "ros2/tests/python/router.py"
    router = subprocess.Popen([sys.executable, script, file])
    await_it(file.exists, "the router")
    return router, file.read_text()


def await_it(holds, what, patience_s=PATIENCE_S):
    deadline = time.monotonic() + patience_s
    while not holds():
        if time.monotonic() > deadline:
            fail(f"waited in vain for {what}")
        time.sleep(0.01)


class Odometry:
    """What the listener tells."""

    def __init__(self, arguments):
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=listen, args=(arguments, other), daemon=True)
        self.process.start()
        self.came, self.poses, self.in_map = {}, {}, {}
        if self.pipe.recv() != "ready":
            fail("the listener is not ready")

    def read(self, wait_s=0.0):
        while self.pipe.poll(wait_s):
            if (told := self.pipe.recv()) == "ended":
                return
            kind, came, stamp, pose = told
            nanos = stamp - EPOCH_NANOS
            if kind == "odometry":
                self.came[nanos], self.poses[nanos] = came, pose
            else:
                self.in_map[nanos] = pose

    def has(self, nanos):
        self.read()
        return nanos in self.came

    def end(self):
        self.pipe.send("end")
        self.read(2.0)
        self.process.terminate()


def begin(arguments, publisher, odometry, ros2):
    """Publishes the first image again and again, before the recording's time, until there is odometry."""
    period = 33_333_333
    for k in range(900):
        publisher.send(0, (k - 1000) * period)
        time.sleep(0.2)
        odometry.read()
        if odometry.came:
            break
        if ros2.program.poll() is not None:
            fail("tessera-ros2 ended: " + ros2.words.read_text())
    else:
        fail("no odometry came: " + ros2.words.read_text())
    # Up to the recording's time, so that the first frame comes as soon after one as the others do; one more
    # in each run, since the samples that are drawn of a frame depend on its number.
    for k in range(-6 - arguments.run, 0):
        publisher.send(0, k * period)
        in_step(publisher, odometry, 0, k * period)


def play(arguments, publisher, odometry, frames, ros2):
    """Publishes all frames; when each was, CPU nanoseconds, nanoseconds and switches of the time, and memory."""
    pid = ros2.program.pid
    begin(arguments, publisher, odometry, ros2)
    sent = {frames[0][0]: publisher.send(0, frames[0][0])}
    in_step(publisher, odometry, 0, frames[0][0])
    before = (cpu_nanos(pid), time.monotonic_ns(), switches(pid))
    for index, (nanos, _, _) in enumerate(frames[1:], 1):
        due = before[1] + round(index * 1e9 / arguments.rate)
        while not arguments.in_step and (left := due - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)
        sent[nanos] = publisher.send(index, nanos)
        odometry.read()
        if arguments.in_step:
            in_step(publisher, odometry, index, nanos)
    deadline = time.monotonic() + 2.0
    while frames[-1][0] not in odometry.came and time.monotonic() < deadline:
        odometry.read(0.01)
    after = (cpu_nanos(pid), time.monotonic_ns(), switches(pid))
    return sent, [b - a for a, b in zip(before, after)], peak_mb(pid)


def in_step(publisher, odometry, index, nanos):
    """Waits for the odometry of an image; it is best effort, and what got lost is sent again."""
    for _ in range(60):
        deadline = time.monotonic() + 2.0
        while time.monotonic() < deadline:
            if odometry.has(nanos):
                return
            time.sleep(0.002)
        publisher.send(index, nanos)
    fail(f"no odometry of frame {index}")


class Ros2:
    """The program, and the file with what it says."""

    def __init__(self, arguments, run, folder):
        environment = dict(os.environ, TESSERA_PROGRAM=str(arguments.tessera))
        words = [arguments.program, run, "--domain", str(arguments.domain), "--network", "loopback"]
        if arguments.router:
            words += ["--carrier", "zenoh"]
            environment["ZENOH_CONFIG_OVERRIDE"] = f'connect/endpoints=["{arguments.router}"]'
        else:
            words += ["--carrier", "dds"]
        self.words = folder / "words.txt"
        self.program = subprocess.Popen(words, env=environment, stderr=self.words.open("w"))


def evaluate(arguments, estimate, truth):
    """ATE in metres."""
    words = [arguments.tessera, "evaluate", estimate, truth, "--json"]
    found = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    return found["ate_rmse_m"]


def write_tum(path, poses):
    """A file of the poses at the recording's own times."""
    rows = [f"{nanos * 1e-9:.6f} " + " ".join(map(str, pose)) for nanos, pose in sorted(poses.items()) if nanos >= 0]
    path.write_text("\n".join(rows) + "\n")
    return path


def quantile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))]


def measure(arguments, camera, frames, folder):
    """One run over the network."""
    run, out = f"measure-ros2-{os.getpid()}-{folder.name}", folder / "out"
    words = [arguments.tessera, "run", "external", "--name", run, "--quiet", "--out", out]
    supervisor = subprocess.Popen(words + ["--set", "run.camera_timeout_s=120"])
    ros2 = Ros2(arguments, run, folder)
    odometry = Odometry(arguments)
    try:
        publisher = Publisher(arguments, camera, frames)
        sent, (cpu, span, n_switches), memory = play(arguments, publisher, odometry, frames, ros2)
        supervisor.send_signal(signal.SIGINT)
        supervisor.wait()
        ros2.program.wait()
    finally:
        odometry.end()
        for process in (ros2.program, supervisor):
            process.terminate()
            process.wait()
    summary = json.loads((out / "summary.json").read_text())
    latency = [(odometry.came[nanos] - sent[nanos][0]) * 1e-6 for nanos in sent if nanos in odometry.came]
    writing = [(ended - began) * 1e-6 for began, ended in sent.values()]
    own = summary["latency_ms"]["end_to_end"]
    came = sorted(odometry.came[nanos] for nanos in sent if nanos in odometry.came)
    truth = arguments.sequence / "groundtruth.txt"
    return {
        "frames": len(sent), "odometry": len(latency), "seconds": span * 1e-9,
        "rate_hz": (len(came) - 1) / ((came[-1] - came[0]) * 1e-9),
        "mb_per_s": publisher.n_bytes / (span * 1e-9) * 1e-6,
        "latency_ms": [quantile(latency, 0.5), quantile(latency, 0.99)], "pipeline_ms": [own["p50"], own["p99"]],
        "writing_ms": [quantile(writing, 0.5), quantile(writing, 0.99)],
        "added_ms": quantile(latency, 0.5) - own["p50"],
        "cpu_share": cpu / span, "switches_per_s": n_switches / (span * 1e-9), "memory_mb": memory,
        "ate_map_m": evaluate(arguments, write_tum(folder / "map.txt", odometry.in_map), truth),
        "ate_odom_m": evaluate(arguments, write_tum(folder / "odom.txt", odometry.poses), truth),
    }


def without(arguments, folder):
    """The same frames in a live run of the recording itself; in step, a run that drops none."""
    out, truth = folder / "out", arguments.sequence / "groundtruth.txt"
    words = [arguments.tessera, "run", arguments.sequence, "--quiet", "--out", out]
    words += ["--frames", str(arguments.frames)] if arguments.frames else []
    subprocess.run(words + ([] if arguments.in_step else ["--live"]), check=True)
    summary = json.loads((out / "summary.json").read_text())
    own = summary["latency_ms"]["end_to_end"]
    return {
        "pipeline_ms": [own["p50"], own["p99"]],
        "ate_map_m": evaluate(arguments, out / "trajectory_online.txt", truth),
    }


def median_of(rows, key):
    values = [row[key] for row in rows]
    if isinstance(values[0], list):
        return [statistics.median(column) for column in zip(*values)]
    return statistics.median(values)


def told(rows):
    """Medians of all runs."""
    return {key: median_of(rows, key) for key in rows[0]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path, help="folder in the TUM layout with groundtruth.txt")
    parser.add_argument("--tessera", type=pathlib.Path, default=ROOT / "target/release/tessera")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "ros2/target/release/tessera-ros2")
    parser.add_argument("--carrier", choices=["dds", "zenoh"], default="dds")
    parser.add_argument("--rate", type=float, default=30.0, help="images a second")
    parser.add_argument("--frames", type=int, help="of the recording, at most")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--in-step", action="store_true", help="as fast as odometry comes; nothing is dropped")
    parser.add_argument("--domain", type=int, default=1 + os.getpid() % 100)
    arguments = parser.parse_args()
    os.environ["CYCLONEDDS_URI"] = CYCLONE
    arguments.router = None
    camera, frames = load(arguments.sequence, arguments.frames)
    rows, bare = [], []
    for arguments.run in range(arguments.runs):
        with tempfile.TemporaryDirectory(prefix="measure-ros2-") as name:
            folder = pathlib.Path(name)
            router = None
            if arguments.carrier == "zenoh":
                router, arguments.router = start_router(folder)
            try:
                rows.append(measure(arguments, camera, frames, folder))
            finally:
                if router:
                    router.terminate()
                    router.wait()
        print(json.dumps({"run": rows[-1]}), flush=True)
        with tempfile.TemporaryDirectory(prefix="measure-ros2-") as name:
            bare.append(without(arguments, pathlib.Path(name)))
        print(json.dumps({"without": bare[-1]}), flush=True)
    print(json.dumps({"load": os.getloadavg(), "medians": told(rows), "without": told(bare)}), flush=True)


if __name__ == "__main__":
    main()
