"""How a test of a device ends otherwise than well, and how what was opened is let go of."""

from collections.abc import Iterator
from contextlib import contextmanager
from signal import SIGINT, signal
from textwrap import wrap
from threading import current_thread, main_thread

from weberlink.geometry.vector import Vector
from weberlink.master.devices.contract import DeviceSpec
from weberlink.slave.robots.contract import RobotSpec

WIDTH = 78


class DeviceTestError(Exception):
    """The test failed; one line that says what is wrong and, where it is known, what to do."""


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C waits until the end: a device is being made safe."""
    if current_thread() is not main_thread():  # no other is ever interrupted
        yield
        return
    pressed = []
    before = signal(SIGINT, lambda *_: pressed.append(True))
    try:
        yield
    finally:
        signal(SIGINT, before)
    if pressed:
        raise KeyboardInterrupt


def described(spec: DeviceSpec | RobotSpec) -> Iterator[str]:
    """What a person should know before it is opened."""
    (x0, y0, z0), (x1, y1, z1) = spec.workspace_m
    box = " x ".join(f"{(high - low) * 1e3:.0f}" for low, high in ((x0, x1), (y0, y1), (z0, z1)))
    yield f"{spec.name}: axes {spec.axes}, workspace {box} mm, at most {spec.force_n:g} N"
    if spec.note:
        yield from wrap(f"Note: {spec.note}", WIDTH)


def millimetres(position: Vector) -> str:
    """For a person, in a width that does not change."""
    return "  ".join(f"{axis} {component * 1e3:+7.1f}" for axis, component in zip("xyz", position, strict=True)) + " mm"
