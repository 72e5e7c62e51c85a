"""RGB-D SLAM: depth and colour images in, a trajectory and a map out.

    import tessera

    camera = tessera.Camera(640, 480, fx=525.0, fy=525.0, cx=319.5, cy=239.5, units_per_metre=1000)
    slam = tessera.Slam(camera)
    for t, depth, colour in frames:
        frame = slam.track(depth, colour, t)
        print(frame.state, frame.world_from_camera[:3, 3])
    slam.finish()
    slam.trajectory().write_tum("trajectory.txt")

A run goes on in this process, by the steps of the command `tessera run` and so with the same bits. Poses
are 4x4 matrices `world_from_camera`, metres; the camera's axes are x right, y down, z forward.
"""

from ._recorded import Run, Source, SourceFrame, read_run
from ._slam import Frame, Slam
from ._tessera import Camera, __version__
from ._types import Loop, Map, Mesh, Reason, Trajectory, Verdict

__all__ = [
    "Camera",
    "Frame",
    "Loop",
    "Map",
    "Mesh",
    "Reason",
    "Run",
    "Slam",
    "Source",
    "SourceFrame",
    "Trajectory",
    "Verdict",
    "__version__",
    "read_run",
]
