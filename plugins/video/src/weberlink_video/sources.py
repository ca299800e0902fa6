"""What gives pictures: a camera, a stream of JPEG pictures, the model of a simulated robot, or a test pattern."""

import ctypes.util
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from threading import Event
from time import monotonic, sleep
from typing import Any, Final, NamedTuple

from weberlink.text import one_line
from weberlink_figures.pictures import Picture
from weberlink_video.jpeg import Splitter, check
from weberlink_video.options import SourceSettings
from weberlink_video.v4l2 import captured

AGAIN_S: Final = 1.0  # after a source has failed, until it is tried again
READ_BYTES: Final = 1 << 16
LONGEST_NOTE: Final = 200


class Robot(NamedTuple):
    """Of the slave that runs on this host: its process, where it is known, and the model that it simulates."""

    pid: int | None
    model: Path | None


def jpegs(source: SourceSettings, robot: Robot) -> Iterator[tuple[float, bytes]]:
    """Moment on the monotonic clock [s] and JPEG of each picture of a source; raises OSError, ValueError, RuntimeError
    or ImportError if there are none, or no more.
    """
    if source.kind == "pattern":
        yield from _drawn_pattern(source)
    elif source.kind == "scene":
        yield from _drawn_scene(source, robot)
    elif stat.S_ISCHR(source.device.stat().st_mode):
        yield from captured(source.device, source.size, source.rate_hz)
    else:
        yield from _streamed(source)


def _streamed(source: SourceSettings) -> Iterator[tuple[float, bytes]]:
    """The pictures of a file, at the rate of the source, or of a pipe, as they come."""
    splitter, is_file = Splitter(), stat.S_ISREG(source.device.stat().st_mode)
    with source.device.open("rb", buffering=0) as file:
        while data := file.read(READ_BYTES):
            for jpeg in splitter.add(data):
                yield monotonic(), jpeg
                if is_file:
                    sleep(1.0 / source.rate_hz)
    raise OSError(f"{source.device} gives no more pictures")


def _drawn_pattern(source: SourceSettings) -> Iterator[tuple[float, bytes]]:
    from weberlink_video.pattern import Pattern, jpeg_of  # noqa: PLC0415 - for those that draw

    pattern = Pattern(source.size)
    while True:
        at = monotonic()
        yield at, jpeg_of(pattern.draw(at), source.quality)
        sleep(max(0.0, at + 1.0 / source.rate_hz - monotonic()))


def _drawn_scene(source: SourceSettings, robot: Robot) -> Iterator[tuple[float, bytes]]:
    """The model of a simulated robot in its newest pose."""
    if robot.model is None:
        raise ValueError("this robot has no model to draw; a scene is of the robot mujoco")
    os.environ.setdefault("MUJOCO_GL", "egl" if ctypes.util.find_library("EGL") else "osmesa")
    import mujoco  # noqa: PLC0415

    from weberlink_mujoco.robot.pose import PoseReader, path_of  # noqa: PLC0415 - of the guest that has the robot
    from weberlink_video.pattern import jpeg_of  # noqa: PLC0415 - for those that draw

    model, (width, height) = mujoco.MjModel.from_xml_path(str(robot.model)), source.size
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.vis.quality.offsamples = 0  # without a graphics card, smooth edges and shadows take ten times as long
    data, renderer = mujoco.MjData(model), mujoco.Renderer(model, height, width)
    if robot.pid is None:
        raise OSError("the robot has not begun")
    reader = PoseReader(path_of(robot.pid))
    if reader.count != model.nq:
        raise ValueError(f"{robot.model} is not the model of this robot")
    while True:
        began = monotonic()
        if (pose := reader.read()) is not None:
            at, data.qpos[:] = pose
            for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):
                step(model, data)
            renderer.update_scene(data)
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                renderer.scene.flags[flag] = 0
            yield at, jpeg_of(renderer.render(), source.quality)
        sleep(max(0.0, began + 1.0 / source.rate_hz - monotonic()))


class Camera:
    """Runs a source in a thread of its own, and again after it has failed.

    `give` is called in the thread with each picture that can be shown, and once with why there are none.
    """

    def __init__(self, source: SourceSettings, robot: Any, give: Any) -> None:
        self._source, self._robot, self._give = source, robot, give
        self._ended = Event()
        self._note = ""

    def run(self) -> None:
        """Give pictures until `end`."""
        while not self._ended.is_set():
            try:
                self._run()
            except (OSError, ValueError, RuntimeError, ImportError) as error:
                self._say(str(error) or type(error).__name__)
            self._ended.wait(AGAIN_S)

    def end(self) -> None:
        self._ended.set()

    def _run(self) -> None:
        period, due = 1.0 / self._source.rate_hz, 0.0
        for at, jpeg in jpegs(self._source, self._robot()):
            if self._ended.is_set():
                return
            if at < due - 0.5 * period:
                continue
            due = max(due + period, at)
            try:
                check(jpeg)
            except ValueError as error:
                self._say(str(error))
                continue
            self._note = ""
            self._give(Picture(at, self._source.name, jpeg))

    def _say(self, why: str) -> None:
        note = one_line(why, LONGEST_NOTE)
        if note != self._note:
            self._note = note
            self._give(Picture(monotonic(), self._source.name, b"", note))
