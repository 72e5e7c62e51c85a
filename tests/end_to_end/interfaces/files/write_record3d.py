"""Writes a folder in the TUM layout as a recording of Record3D: the folder OUT, and OUT.r3d.

    python write_record3d.py FOLDER OUT

Depth and confidence are compressed by Apple's own library (pyliblzfse). Colour is twice as large as depth, and poses are those of groundtruth.txt in ARKit's axes.
"""

import json
import pathlib
import sys
import tomllib
import zipfile

import liblzfse
import numpy as np
from PIL import Image

folder, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
camera = tomllib.loads((folder / "camera.toml").read_text())
width, height = camera["width"], camera["height"]
(out / "rgbd").mkdir(parents=True)


def rows(name):
    return [line.split() for line in (folder / name).read_text().splitlines() if not line.startswith("#")]


times = []
for k, ((stamp, depth), (_, colour)) in enumerate(zip(rows("depth.txt"), rows("rgb.txt"))):
    metres = np.array(Image.open(folder / depth)).astype(np.float32) / np.float32(camera["units_per_metre"])
    confidence = np.full(metres.shape, 2, np.uint8)
    (out / f"rgbd/{k}.depth").write_bytes(liblzfse.compress(metres.tobytes()))
    (out / f"rgbd/{k}.conf").write_bytes(liblzfse.compress(confidence.tobytes()))
    large = Image.open(folder / colour).resize((2 * width, 2 * height), Image.NEAREST)
    large.save(out / f"rgbd/{k}.jpg", quality=95)
    times.append(float(stamp))

fx, fy, cx, cy = (2 * camera[key] for key in ("fx", "fy", "cx", "cy"))
metadata = {
    "w": 2 * width,
    "h": 2 * height,
    "dw": width,
    "dh": height,
    "fps": 30,
    "cameraType": 1,
    "K": [fx, 0, 0, 0, fy, 0, cx, cy, 1],
    "perFrameIntrinsicCoeffs": [[fx, fy, cx, cy]] * len(times),
    "frameTimestamps": times,
    "initPose": [0, 0, 0, 1, 0, 0, 0],
    "poses": [[1, 0, 0, 0, 0, 0, 0]] * len(times),
}
(out / "metadata").write_text(json.dumps(metadata))

with zipfile.ZipFile(f"{out}.r3d", "w", zipfile.ZIP_DEFLATED) as packed:
    for file in sorted(path for path in out.rglob("*") if path.is_file()):
        packed.write(file, file.relative_to(out))
