"""The process that makes the pictures of a view: of a camera, or of the scene of a simulated robot.

It writes frames to standard output: the moment of the picture on the monotonic clock [s] as a little-endian double, the
length of the JPEG as u32, and the JPEG. It ends with one line on standard error.
"""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from struct import Struct
from time import monotonic, sleep
from typing import Any, NamedTuple

FRAME = Struct("<dI")
CAMERA, ROBOT = "camera", "robot"
PERIOD_S = 1.0 / 15.0
"""Least time between two frames."""
SIZE = (360, 480)
"""Height and width of a drawn scene [pixels]."""
QUALITY = 75
NICENESS = 10
BACKENDS = ("egl", "osmesa")
"""Ways of MuJoCo to draw without a window, the first that works."""


class Picture(NamedTuple):
    """Blue, green and red of each pixel, shape (height, width, 3), and when it was taken [s]."""

    at: float
    pixels: Any


def captured(device: str) -> Iterator[Picture]:
    """The pictures of a camera, as they come.

    Raises:
        RuntimeError: it cannot be opened, or gives no more pictures.
    """
    import cv2  # noqa: PLC0415 - an optional library

    camera = cv2.VideoCapture(int(device) if device.isdecimal() else device, cv2.CAP_V4L2)
    camera.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    if not camera.isOpened():
        raise RuntimeError(f"camera {device}: cannot be opened; is it there, and is this user in the group video?")
    sent_at = 0.0
    while camera.grab():
        at = monotonic()
        if at - sent_at >= 0.9 * PERIOD_S:
            sent_at = at
            yield Picture(at, camera.retrieve()[1])
    raise RuntimeError(f"camera {device}: gives no more pictures")


def drawn(model_path: str, pose_path: str) -> Iterator[Picture]:
    """The scene of a simulated robot in its newest pose, until its daemon ends.

    Raises:
        RuntimeError: it cannot be drawn here.
        ValueError, OSError: there is no pose, or of another model.
    """
    import mujoco  # noqa: PLC0415

    from weberlink.telemetry.pose import PoseReader  # noqa: PLC0415

    model = mujoco.MjModel.from_xml_path(model_path)
    height, width = SIZE
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.vis.quality.offsamples = 0  # without a graphics card, smooth edges and shadows take ten times as long
    data = mujoco.MjData(model)
    reader = PoseReader(Path(pose_path))
    if reader.count != model.nq:
        raise ValueError(f"{model_path}: is not the model of this session: {model.nq} joint positions, {reader.count}")
    renderer = mujoco.Renderer(model, height, width)
    while Path(pose_path).exists():
        began = monotonic()
        pose = reader.read()
        if pose is not None:
            shown_at, data.qpos[:] = pose
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            renderer.update_scene(data)
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                renderer.scene.flags[flag] = 0
            yield Picture(shown_at, renderer.render()[:, :, ::-1])
        sleep(max(0.0, began + PERIOD_S - monotonic()))


def pictures(kind: str, arguments: list[str]) -> Iterator[Picture]:
    """The pictures of a kind of view."""
    return captured(*arguments) if kind == CAMERA else drawn(*arguments)


def main(kind: str, arguments: list[str]) -> int:
    """Write frames until the reader has gone; returns the exit status."""
    import cv2  # noqa: PLC0415

    os.nice(NICENESS)
    cv2.setNumThreads(1)
    out = sys.stdout.buffer
    try:
        for at, pixels in pictures(kind, arguments):
            _, jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
            out.write(FRAME.pack(at, len(jpeg)) + jpeg.tobytes())
            out.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), out.fileno())
        return 0
    except (RuntimeError, ValueError, OSError) as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
