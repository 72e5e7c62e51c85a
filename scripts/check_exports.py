"""Reads exported files with Open3D, trimesh and evo; see check_exports.sh."""

import importlib
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
