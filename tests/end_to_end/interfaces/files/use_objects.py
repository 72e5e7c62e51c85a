"""Arrays as `tessera` gives them become objects of trimesh, and of Open3D where it is installed.

    use_objects.py EXAMPLES
"""

import io
import sys
import types

import numpy as np
import trimesh

sys.path.insert(0, sys.argv[1])
import objects  # noqa: E402

mesh = types.SimpleNamespace(
    positions=np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 2]], np.float32),
    normals=np.array([[0, 0, -1]] * 4, np.float32),
    colours=np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [51, 102, 204]], np.uint8),
    triangles=np.array([[0, 2, 1], [1, 2, 3]], np.uint32),
)

made = objects.trimesh_mesh(mesh)
assert (made.faces == mesh.triangles).all() and made.vertices.shape == (4, 3), made
assert np.allclose(made.vertex_normals, mesh.normals)
# Colours are those of vertices, and stay so through a file.
there = trimesh.load(io.BytesIO(made.export(file_type="ply")), file_type="ply", process=False)
assert (there.visual.vertex_colors[:, :3] == mesh.colours).all(), there.visual
print("trimesh")

try:
    import open3d  # noqa: F401
except ImportError:
    sys.exit(0)
cloud, made = objects.open3d_cloud(mesh), objects.open3d_mesh(mesh)
assert np.allclose(np.asarray(cloud.points), mesh.positions) and cloud.has_normals()
assert np.allclose(np.asarray(made.vertex_colors), mesh.colours / 255.0)
assert (np.asarray(made.triangles) == mesh.triangles).all() and made.has_vertex_normals()
print("open3d")
