# %% Frames as arrays: where was the camera, and what did it see? In cells, for a notebook.
# pip install tessera_slam-*.whl; then: python3 arrays.py [FOLDER]
import sys

import numpy as np
import tessera

# %% A recording as `tessera run` reads it, or a simulated room. Any loop that has arrays will do.
source = tessera.Source(sys.argv[1] if len(sys.argv) > 1 else "room", {"run.frames": 90})
frame = source[0]
print(source.camera, frame.depth.shape, frame.depth.dtype, frame.colour is not None)

# %% Frame by frame, as they come.
slam = tessera.Slam(source.camera)
for frame in source:
    tracked = slam.track(frame.depth, frame.colour, stamp_nanos=frame.stamp_nanos)
    if tracked.state != "tracking":
        print(f"frame {tracked.index} is {tracked.state}: {tracked.reason}")
print(tracked.world_from_camera.round(3))

# %% All keyframes once more, then the results.
slam.finish()
trajectory, cloud = slam.trajectory(), slam.map()
path = trajectory.world_from_camera[trajectory.is_tracked, :3, 3]
length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
print(f"{len(path)} of {len(trajectory)} poses measured, a way of {length:.2f} m, {len(cloud)} points")

# %% For other programs.
trajectory.write_tum("trajectory.txt")
np.savez("map.npz", positions=cloud.positions, normals=cloud.normals, colours=cloud.colours)
