"""An adapter for OAK cameras: `tessera run external --name desk`, then `oak.py desk`.

Needs `pip install depthai` (3.12) and what `pinhole.py` names. Tried with the SDK's own messages, not on hardware.
"""

import sys

import depthai as dai

import pinhole

SIZE, RATE_HZ = (640, 480), 30


def images(group):
    """Number, nanoseconds, depth and colour of a group of messages; depth is in millimetres."""
    depth, colour = group["depth"], group["colour"]
    nanos = round(depth.getTimestampDevice().total_seconds() * 1e6) * 1000
    return depth.getSequenceNum(), nanos, depth.getFrame(), colour.getFrame()


def send_all(run, next_group):
    group = next_group()
    # Of the image as it comes, whatever the device did to it.
    lens = group["depth"].getTransformation()
    coefficients = lens.getDistortionCoefficients() or [0.0] * 5
    pinhole.send_all(run, lens.getSize(), lens.getIntrinsicMatrix(), coefficients, 1000, lambda: images(next_group()))


def main():
    with dai.Pipeline() as pipeline:
        camera = pipeline.create(dai.node.Camera).build(dai.CameraBoardSocket.CAM_A)
        colour = camera.requestOutput(SIZE, dai.ImgFrame.Type.RGB888i, fps=RATE_HZ, enableUndistortion=True)
        stereo, sync = pipeline.create(dai.node.StereoDepth), pipeline.create(dai.node.Sync)
        for socket, side in ((dai.CameraBoardSocket.CAM_B, stereo.left), (dai.CameraBoardSocket.CAM_C, stereo.right)):
            pipeline.create(dai.node.Camera).build(socket).requestOutput((640, 400), fps=RATE_HZ).link(side)
        colour.link(stereo.inputAlignTo)
        stereo.depth.link(sync.inputs["depth"])
        colour.link(sync.inputs["colour"])
        groups = sync.out.createOutputQueue()
        pipeline.start()
        send_all(sys.argv[1], groups.get)


if __name__ == "__main__":
    main()
