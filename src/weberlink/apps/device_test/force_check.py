"""A gentle push along every axis: whether the force leads where the position does."""

from collections.abc import Mapping
from math import cos, inf, pi

from weberlink.apps.device_test.dialog import Dialog
from weberlink.apps.device_test.outcome import DeviceTestError, uninterrupted
from weberlink.apps.device_test.sense import Frame
from weberlink.geometry.vector import ZERO, Vector, distance, scale
from weberlink.master.devices.contract import Device

PUSH_N = 0.3
"""Felt by everybody, and too little to hurt or to fling a handle that is held."""
RAMP_S = 0.5
HOLD_S = 0.5
GIVES_WAY_M = 0.03
"""A handle that nobody holds goes farther; the push ends there."""

UNITS: Mapping[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def agrees(device: Device, dialog: Dialog) -> bool:
    """Whether the person wants to feel it; nothing is opened before."""
    seconds = 2.0 * RAMP_S + HOLD_S
    dialog.tell("", f"The force: a push of {_size(device):g} N along each axis in turn, for {seconds:g} s each.")
    if dialog.agrees("Type yes to feel it: "):
        return True
    dialog.tell("No force, then.")
    return False


def _size(device: Device) -> float:
    return min(PUSH_N, device.spec.force_n)


def check_force(device: Device, frame: Frame, options: Mapping[str, str], dialog: Dialog, *, may_move: bool) -> None:
    """Push a little along every axis, and ask whether it was felt there.

    Args:
        device: open, and with force.
        frame: where its axes lead.
        options: which option turns the force along an axis round, by axis; for the advice.
        dialog: with the person.
        may_move: whether the handle moves without being pushed.

    Raises:
        DeviceTestError: it was felt elsewhere, or not at all.
    """
    spec, push = device.spec, _size(device)
    gives_way = inf if may_move else GIVES_WAY_M
    wrong = [axis for axis in spec.axes if not _felt(axis, push, device, frame, gives_way, dialog)]
    if wrong:
        advice = ", ".join(f"{axis} ({options.get(axis, 'the direction of its motor')})" for axis in wrong)
        raise DeviceTestError(
            f"{spec.name}: its force is not felt along {', '.join(wrong)} as it should be: leave signs_checked out "
            f"of the file; is it the model that the options say? Where it pushes the other way, turn round {advice}, "
            "and test it again"
        )
    dialog.tell("The force is right.")


def _felt(axis: str, push: float, device: Device, frame: Frame, gives_way: float, dialog: Dialog) -> bool:
    """Whether a push was felt along the axis."""
    while True:
        dialog.ask(f"\nA push {frame[axis]} comes with Enter: ")
        _push(scale(UNITS[axis], push), device, gives_way, dialog)
        answer = dialog.choose(f"Did it push {frame[axis]}? y, n, or r to feel it again: ", ("y", "n", "r"))
        if answer != "r":
            return answer == "y"


def _push(force: Vector, device: Device, gives_way: float, dialog: Dialog) -> None:
    """In, hold and out; at once out where the handle gives way."""
    began = dialog.now()
    start = device.latest(began).position
    is_held = True

    def tick(now: float) -> None:
        nonlocal is_held
        is_held = is_held and distance(device.latest(now).position, start) <= gives_way
        device.command(scale(force, _share(now - began)) if is_held else ZERO, now)

    try:
        dialog.wait(2.0 * RAMP_S + HOLD_S, tick)
    finally:
        with uninterrupted():
            device.command(ZERO, dialog.now())
    if not is_held:
        dialog.tell(f"The handle gave way by {gives_way * 1e3:.0f} mm and the force ended: hold it, and feel it again.")


def _share(elapsed: float) -> float:
    """Of the push, after this time [s]: half a cosine in and out."""
    into = min(elapsed, 2.0 * RAMP_S + HOLD_S - elapsed) / RAMP_S
    return 0.5 - 0.5 * cos(pi * min(1.0, max(0.0, into)))
