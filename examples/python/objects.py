"""Maps and meshes of `tessera` as objects of Open3D and trimesh; whatever has arrays of the same names will do.

mesh = objects.trimesh_mesh(slam.mesh()); mesh.export("room.ply")
"""

import numpy as np


def trimesh_mesh(mesh):
    """`positions`, `normals`, `colours`, `triangles` as a `trimesh.Trimesh` with colours of vertices."""
    import trimesh

    return trimesh.Trimesh(
        mesh.positions, mesh.triangles, vertex_normals=mesh.normals, vertex_colors=mesh.colours, process=False
    )


def open3d_cloud(cloud):
    """`positions`, `normals`, `colours` as an `open3d.geometry.PointCloud`."""
    import open3d

    return _with_arrays(open3d, open3d.geometry.PointCloud(), cloud, "points", "normals", "colors")


def open3d_mesh(mesh):
    """The same with `triangles` as an `open3d.geometry.TriangleMesh`."""
    import open3d

    made = open3d.geometry.TriangleMesh()
    made.triangles = open3d.utility.Vector3iVector(np.asarray(mesh.triangles, dtype=np.int32))
    return _with_arrays(open3d, made, mesh, "vertices", "vertex_normals", "vertex_colors")


def _with_arrays(open3d, made, of, positions, normals, colours):
    def vector(values):
        return open3d.utility.Vector3dVector(np.asarray(values, dtype=np.float64))

    setattr(made, positions, vector(of.positions))
    setattr(made, normals, vector(of.normals))
    setattr(made, colours, vector(np.asarray(of.colours) / 255.0))
    return made
