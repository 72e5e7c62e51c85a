"""Reads exported files with Open3D, trimesh, evo, pycolmap, nerfbaselines and Pillow; see check_exports.sh."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

run, work = Path(sys.argv[1]), Path(sys.argv[2])


def library(name):
    try:
        return importlib.import_module(name)
    except (ImportError, OSError) as error:
        print(f"skipped: {name}: {error}")
        return None


def check(holds, words):
    if not holds:
        sys.exit(f"FAILED: {words}")
    print(f"ok: {words}")


o3d = library("open3d")
if o3d:
    clouds = [o3d.io.read_point_cloud(str(work / name)) for name in ("a.ply", "a.pcd")]
    n = [len(cloud.points) for cloud in clouds]
    check(n[0] == n[1] > 1000, f"Open3D: {n[0]} points in PLY, {n[1]} in PCD")
    check(all(c.has_colors() and c.has_normals() for c in clouds), "Open3D: clouds have colours and normals")
    same = abs(clouds[0].get_center() - clouds[1].get_center()).max() < 1e-6
    check(same, "Open3D: both clouds are the same points")
    mean = [sum(sum(color) for color in list(c.colors)[:2000]) for c in clouds]
    check(abs(mean[0] - mean[1]) < 1e-3, "Open3D: both clouds have the same colours")
    mesh = o3d.io.read_triangle_mesh(str(work / "m.ply"))
    check(len(mesh.triangles) > 1000 and mesh.has_vertex_colors(), f"Open3D: mesh of {len(mesh.triangles)} triangles")
    is_manifold = mesh.is_edge_manifold(allow_boundary_edges=True) and mesh.is_vertex_manifold()
    check(is_manifold, "Open3D: the mesh is manifold, its open borders apart")

trimesh = library("trimesh")
if trimesh:
    ply = trimesh.load(work / "m.ply", process=False)
    scene = trimesh.load(work / "m.glb", process=False)
    glb = scene.to_geometry() if hasattr(scene, "to_geometry") else scene.dump(concatenate=True)
    check(len(ply.faces) == len(glb.faces), f"trimesh: {len(ply.faces)} triangles in PLY and GLB")
    visual = next(iter(scene.geometry.values())).visual
    # Beside a material trimesh keeps the colours as an attribute.
    has_colours = visual.kind == "vertex" or "color" in getattr(visual, "vertex_attributes", {})
    check(has_colours, "trimesh: GLB has vertex colours")
    scene.export(work / "again.glb")
    again = next(iter(trimesh.load(work / "again.glb", process=False).geometry.values())).visual
    kept = again.kind == "vertex" or "color" in getattr(again, "vertex_attributes", {})
    check(kept, "trimesh: the colours are there after a round trip through GLB")
    check(len(visual.to_color().vertex_colors) > 0, "trimesh: to_color() of the GLB")
    check(ply.visual.kind == "vertex" and len({tuple(c) for c in ply.visual.vertex_colors[::97]}) > 10, "trimesh: PLY has vertex colours")
    turned = ply.vertices * [1, -1, -1]
    check(abs(turned - glb.vertices).max() < 1e-4, "trimesh: GLB stands upright, half a turn about x")

if library("evo"):
    from evo.tools import file_interface

    tum = file_interface.read_tum_trajectory_file(run / "trajectory.txt")
    kitti = file_interface.read_kitti_poses_file(work / "k.txt")
    euroc = file_interface.read_euroc_csv_trajectory(work / "e.csv")
    check(kitti.num_poses == euroc.num_poses == tum.num_poses, f"evo: {tum.num_poses} poses in each form")
    for name, other in (("KITTI", kitti), ("EuRoC", euroc)):
        off = max(abs(a - b).max() for a, b in zip(tum.poses_se3, other.poses_se3))
        check(off < 1e-6, f"evo: {name} poses differ by {off:.1e} from the TUM file")
    off = abs(tum.timestamps - euroc.timestamps).max()
    check(off < 1e-6, f"evo: times differ by {off:.1e} s")

# In a process of its own: pycolmap and Pillow bring libraries that do not bear each other.
COLMAP = """
import sys, pycolmap
models = [pycolmap.Reconstruction(sys.argv[1] + "/" + name + "/sparse/0") for name in ("colmap", "colmap_text")]
rows = {}
for line in open(sys.argv[2]):
    if not line.startswith("#"):
        rows[len(rows)] = [float(word) for word in line.split()]
off = 0.0
for model in models:
    for image in model.images.values():
        pose = image.cam_from_world() if callable(image.cam_from_world) else image.cam_from_world
        centre = pose.inverse().translation
        off = max(off, max(abs(a - b) for a, b in zip(centre, rows[int(image.name[:6])][1:4])))
sizes = [(len(m.cameras), len(m.images), len(m.points3D)) for m in models]
camera = next(iter(models[0].cameras.values()))
print(sizes[0] == sizes[1], *sizes[0], camera.model_name, off)
sys.stdout.flush()
import os
os._exit(0)
"""
if subprocess.run([sys.executable, "-c", "import pycolmap"], capture_output=True).returncode:
    print("skipped: pycolmap: cannot be imported")
else:
    command = [sys.executable, "-c", COLMAP, str(work), str(run / "trajectory.txt")]
    same, cameras, images, points, model, off = subprocess.check_output(command, text=True).split()
    check(same == "True" and (cameras, model) == ("1", "PINHOLE"), "pycolmap: binary and text are the same model")
    check(int(images) > 1 and int(points) > 1000, f"pycolmap: {images} images, {points} points")
    check(float(off) < 1e-6, f"pycolmap: camera centres differ by {off} m from trajectory.txt")

# The reader of nerfstudio's data without its torch: nerfbaselines' own.
if library("nerfbaselines") and library("PIL"):
    from nerfbaselines.datasets.nerfstudio import load_nerfstudio_dataset

    rows = [line.split() for line in (run / "trajectory.txt").read_text().splitlines() if line[0] != "#"]
    meta, off, turned, n_images = json.loads((work / "nerf" / "transforms.json").read_text()), 0.0, 0.0, 0
    # Of few images none is left for the second.
    both = [load_nerfstudio_dataset(work / "nerf", split) for split in ("train", "test")]
    for dataset in (of for of in both if of["image_paths"]):
        lenses = {tuple(row) for row in dataset["cameras"].intrinsics.tolist()}
        check(len(lenses) == 1, "nerfbaselines: one camera")
        wrong = max(abs(a - meta[key]) for a, key in zip(*lenses, ("fl_x", "fl_y", "cx", "cy")))
        check(wrong < 1e-3, f"nerfbaselines: its lens differs by {wrong:.1e} px from transforms.json")
        n_images += len(dataset["image_paths"])
        for path, pose in zip(dataset["image_paths"], dataset["cameras"].poses):
            x, y, z, a, b, c, w = map(float, rows[int(Path(path).stem)][1:8])
            off = max(off, max(abs(found - row) for found, row in zip(pose[:3, 3], (x, y, z))))
            # The third axis of the camera, of the quaternion.
            ahead = (2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b))
            turned = max(turned, max(abs(found - row) for found, row in zip(pose[:3, 2], ahead)))
    check(n_images == len(meta["frames"]), f"nerfbaselines: {n_images} images")
    words = f"centres differ by {off:.1e} m, directions of view by {turned:.1e}"
    check(max(off, turned) < 1e-5, f"nerfbaselines: {words} from trajectory.txt")

if library("PIL"):
    from PIL import Image

    dataset = json.loads((work / "nerf" / "transforms.json").read_text())
    for frame in dataset["frames"]:
        colour, depth = (Image.open(work / "nerf" / frame[key]) for key in ("file_path", "depth_file_path"))
        whole = colour.size == depth.size == (dataset["w"], dataset["h"]) and colour.mode == "RGB"
        if not whole or depth.getextrema()[1] < 500:
            check(False, f"Pillow: {frame['file_path']} and its depth are whole")
    check(dataset["depth_unit_scale_factor"] == 0.001, f"Pillow: {len(dataset['frames'])} images with depth for nerfstudio")
    # As map_server reads it: 254 free, 205 unknown, 0 occupied.
    grid = Image.open(work / "map.pgm")
    counts = {value: n for n, value in grid.getcolors()}
    check(set(counts) <= {0, 205, 254} and min(counts.get(0, 0), counts.get(254, 0)) > 50, f"Pillow: grid of {grid.size} cells")
