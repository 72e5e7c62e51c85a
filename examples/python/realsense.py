"""An adapter for RealSense cameras: `tessera run external --name desk`, then `realsense.py desk`.

Needs `pip install iceoryx2==0.10.0 pyrealsense2`. Tried with the SDK's own software device, not on hardware.
"""

import sys

import pyrealsense2 as rs

import tessera_client

WIDTH, HEIGHT, RATE_HZ = 640, 480, 30


def send_all(run, lens, metres_per_unit, next_frames):
    """Sends what `next_frames` waits for until the run wants no more; depth is laid over colour, whose lens both have."""
    calibration = {
        "fx": lens.fx, "fy": lens.fy, "cx": lens.ppx, "cy": lens.ppy,
        "units_per_metre": round(1.0 / metres_per_unit),
        # The SDK's order is k1 k2 p1 p2 k3 as well. Its "inverse" model is close to none on these cameras.
        "distortion": lens.coeffs if lens.model == rs.distortion.brown_conrady else [0.0] * 5,
    }
    camera = tessera_client.Camera(run, lens.width, lens.height, calibration)
    to_colour, first_number = rs.align(rs.stream.color), None
    while camera.is_wanted():
        frames = to_colour.process(next_frames())
        depth, colour = frames.get_depth_frame(), frames.get_color_frame()
        if not depth:
            continue
        first_number = depth.get_frame_number() if first_number is None else first_number
        camera.send(
            depth.get_frame_number() - first_number,
            int(depth.get_timestamp() * 1e6),
            bytes(depth.get_data()),
            bytes(colour.get_data()) if colour else None,
        )


def main():
    pipeline, config = rs.pipeline(), rs.config()
    config.enable_stream(rs.stream.depth, WIDTH, HEIGHT, rs.format.z16, RATE_HZ)
    config.enable_stream(rs.stream.color, WIDTH, HEIGHT, rs.format.rgb8, RATE_HZ)
    profile = pipeline.start(config)
    lens = profile.get_stream(rs.stream.color).as_video_stream_profile().get_intrinsics()
    metres_per_unit = profile.get_device().first_depth_sensor().get_depth_scale()
    send_all(sys.argv[1], lens, metres_per_unit, pipeline.wait_for_frames)


if __name__ == "__main__":
    main()
