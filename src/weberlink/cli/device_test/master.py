"""Test of a haptic device: readings, then a check of signs without force, then a gentle force along each axis."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import cos, inf, pi
from typing import Any

import yaml
from pydantic import BaseModel

from weberlink.cli.device_test.dialog import DeviceTestError, Dialog, View, described, uninterrupted
from weberlink.geometry.vector import ZERO, Vector, distance, norm, scale, subtract
from weberlink.master.devices.contract import Device, DeviceReading
from weberlink.registry import is_hardware

Frame = Mapping[str, str]
"""Direction of each positive axis, as the person before the device sees it."""
FRAME: Frame = {"x": "toward you", "y": "to the right", "z": "up"}
"""The default; drivers may give another."""
UNITS: Mapping[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
LEAST_M = 0.015
"""Shorter motions are ignored: a hand that holds still moves by millimetres."""
MAINLY = 0.8
"""Share of the motion that one axis must have: within 37 degrees of it."""
TRIES = 3
"""Unclear motions in a row until the test fails."""
PUSH_N = 0.3
"""Felt by everybody, and too weak to hurt or to throw a handle that is held."""
RAMP_S = 0.5
HOLD_S = 0.5
GIVES_WAY_M = 0.03
"""A handle that nobody holds moves farther; the push ends there."""
READY = "Move the handle to its start pose of a session."
SIGNS = "signs_checked"
"""Option of drivers that give no force until a person has checked their directions.

Its value is printed only after the last axis was felt: a correct position does not show that the motors are correct.
"""


def try_master(driver: Any, options: BaseModel, build: Callable[[BaseModel], Device], dialog: Dialog) -> None:
    """Test a haptic device.

    Args:
        driver: class of the device.
        options: of the driver.
        build: makes a device from options.
        dialog: with the person.

    Raises:
        DeviceTestError: the test failed. The force is zero, as after the other errors.
        DeviceFault: the device failed.
        StoppedByUser: the person stopped.
    """
    frame: Frame = {**FRAME, **getattr(driver, "FRAME", {})}
    is_real = is_hardware(driver)
    fingerprint: str | None = driver.fingerprint(options) if hasattr(driver, "fingerprint") else None
    idle, armed = (
        build(options.model_copy(update={SIGNS: signs}) if SIGNS in type(options).model_fields else options)
        for signs in (None, fingerprint)
    )
    dialog.tell(*described(armed.spec))
    if is_real:
        dialog.tell(READY)
        dialog.ask("Press Enter to open it, without force: ")
    with _opened(idle, dialog) as device:
        dialog.watch(view_of(device), "Press Enter to continue: ")
        if is_real:
            check_signs(device, frame, getattr(driver, "SIGN_OPTIONS", {}), dialog)
        else:
            dialog.tell("This device is simulated: it has no handle to move and no signs to check.")
    if not armed.spec.force_feedback:
        dialog.tell("With these options the device gives no force; the test is done.")
        return
    push_n, seconds = min(PUSH_N, armed.spec.force_n), 2.0 * RAMP_S + HOLD_S
    dialog.tell("", f"Check of force: a push of {push_n:g} N along each axis in turn, for {seconds:g} s each.")
    if not dialog.agrees("Type yes to feel it: "):
        dialog.tell("The force is not tested.")
        if fingerprint is not None:
            dialog.tell(f"The signs of the motors are not checked, so {SIGNS} is not printed.")
        return
    if is_real:
        dialog.tell(READY)
        dialog.ask("Hold it, then press Enter to open it, with force: ")
    with _opened(armed, dialog) as device:
        check_force(device, push_n, frame, getattr(driver, "FORCE_OPTIONS", {}), dialog, may_move=not is_real)
    if fingerprint is not None:
        # Quoted if YAML would read a number.
        quoted = fingerprint if yaml.safe_load(fingerprint) == fingerprint else f'"{fingerprint}"'
        dialog.tell("Put this line under master.device:", f"  {SIGNS}: {quoted}")
    examine = getattr(armed, "examine", None)  # of drivers that find out what becomes of a force on its way to the hand
    if examine is not None:
        dialog.ask(f"\nHold it, then press Enter for a few short pushes of {push_n:g} N up: ")
        dialog.tell(*examine((0.0, 0.0, push_n)))


@contextmanager
def _opened(device: Device, dialog: Dialog) -> Iterator[Device]:
    """An open device; whatever ends the block, the force is at zero and the device closed."""
    try:
        device.open(dialog.now())
        yield device
    finally:
        with uninterrupted():
            device.command(ZERO, dialog.now())
            device.close()


def view_of(device: Device) -> View:
    """Position, rate, age, orientation, buttons and trouble of an open device."""
    buttons = device.spec.buttons

    def details(reading: DeviceReading) -> Iterator[str]:
        if reading.orientation is not None:
            yield "orientation (w, x, y, z) " + " ".join(f"{part:+.3f}" for part in reading.orientation)
        if buttons:
            pressed = [str(button) for button in range(buttons) if reading.buttons >> button & 1]
            yield f"buttons pressed: {', '.join(pressed) or 'none'} (of 0 to {buttons - 1})"
        if trouble := getattr(device, "trouble", None):
            yield trouble

    return View(device.latest, details, lambda: getattr(device, "round_trip_s", None))


@dataclass(frozen=True)
class ObservedMotion:
    """The axis along which a handle moved.

    Args:
        asked: axis along which the hand moved, in the positive direction.
        axis: axis along which the position changed.
        way_m: signed distance [m].
    """

    asked: str
    axis: str
    way_m: float

    @property
    def right(self) -> bool:
        return self.axis == self.asked and self.way_m > 0.0


def classify_motion(asked: str, moved: Vector, frame: Frame) -> ObservedMotion | str:
    """Find the axis of a motion, or the reason why that is unclear.

    Args:
        asked: "x", "y" or "z".
        moved: change of the position [m].
        frame: directions of the axes, for the text.
    """
    way = norm(moved)
    if way < LEAST_M:
        return f"The position changed by {way * 1e3:.0f} mm, which is too little: move it by about 5 cm."
    axis, along = max(zip("xyz", moved, strict=True), key=lambda pair: abs(pair[1]))
    if abs(along) < MAINLY * way:
        x, y, z = (f"{component * 1e3:+.0f}" for component in moved)
        return f"The position changed by ({x}, {y}, {z}) mm, not along one axis: move it straight {frame[asked]}."
    return ObservedMotion(asked, axis, along)


def check_signs(device: Device, frame: Frame, options: Mapping[str, str], dialog: Dialog) -> None:
    """Ask for a motion along every axis: with a wrong sign, a wall would push instead of resist.

    Args:
        device: open, without force.
        frame: directions of its axes.
        options: which option reverses an axis, by axis; for the advice.
        dialog: with the person.

    Raises:
        DeviceTestError: the position does not follow the hand.
    """
    dialog.tell("", "Check of signs: you move the handle; there is no force.")
    motions = [_motion(axis, device, frame, dialog) for axis in device.spec.axes]
    dialog.tell("")
    for each in motions:
        what = "right" if each.right else "WRONG AXIS" if each.axis != each.asked else "WRONG DIRECTION"
        dialog.tell(f"  +{each.asked} ({frame[each.asked]}): {each.way_m * 1e3:+.0f} mm along {each.axis}: {what}")
    crossed = [f"{each.asked} comes out as {each.axis}" for each in motions if each.axis != each.asked]
    if crossed:
        raise DeviceTestError(
            f"{device.spec.name}: axes are interchanged ({', '.join(crossed)}), so there must be no force: "
            "check that the options name the right model, and the cables"
        )
    flips = [f"{each.asked} ({options.get(each.asked, 'its direction')})" for each in motions if not each.right]
    if flips:
        raise DeviceTestError(
            f"{device.spec.name}: moves the wrong way, so there must be no force; in the options, reverse "
            f"{', '.join(flips)}, and test it again"
        )


def _motion(axis: str, device: Device, frame: Frame, dialog: Dialog) -> ObservedMotion:
    for _ in range(TRIES):
        dialog.ask("\nHold the handle in the middle of its workspace, then Enter: ")
        start = device.latest(dialog.now()).position
        dialog.watch(view_of(device), f"Move it {frame[axis]} by about 5 cm, hold it there, then Enter: ")
        found = classify_motion(axis, subtract(device.latest(dialog.now()).position, start), frame)
        if isinstance(found, ObservedMotion):
            return found
        dialog.tell(found)
    raise DeviceTestError(
        f"{device.spec.name}: no clear motion along {axis}; check that it is at its home pose when it is "
        "homed, and that the options name the right model"
    )


def check_force(
    device: Device, push_n: float, frame: Frame, options: Mapping[str, str], dialog: Dialog, *, may_move: bool
) -> None:
    """Push a little along every axis, and ask whether it was felt there.

    Args:
        device: open, with force.
        push_n: size of the push [N].
        frame: directions of its axes.
        options: which option reverses the force along an axis, by axis; for the advice.
        dialog: with the person.
        may_move: whether the handle moves by itself.

    Raises:
        DeviceTestError: the force was felt in another direction, or not at all.
    """
    spec, gives_way, wrong = device.spec, inf if may_move else GIVES_WAY_M, []
    for axis in spec.axes:
        answer = "r"
        while answer == "r":
            dialog.ask(f"\nPress Enter for a push {frame[axis]}: ")
            _push(scale(UNITS[axis], push_n), device, gives_way, dialog)
            answer = dialog.choose(f"Did it push {frame[axis]}? y, n, or r to repeat it: ", ("y", "n", "r"))
        if answer == "n":
            wrong.append(axis)
    if wrong:
        advice = ", ".join(f"{axis} ({options.get(axis, 'the direction of its motor')})" for axis in wrong)
        raise DeviceTestError(
            f"{spec.name}: the force is wrong along {', '.join(wrong)}: leave signs_checked out of the file; check "
            f"that the options name the right model; where it pushes the other way, reverse {advice}, and test it again"
        )
    dialog.tell("The force is right.")


def _push(force: Vector, device: Device, gives_way: float, dialog: Dialog) -> None:
    """Ramp up, hold, ramp down; stop at once if the handle gives way."""
    began = dialog.now()
    start = device.latest(began).position
    is_held = True

    def tick(now: float) -> None:
        nonlocal is_held
        is_held = is_held and distance(device.latest(now).position, start) <= gives_way
        elapsed = now - began
        into = min(elapsed, 2.0 * RAMP_S + HOLD_S - elapsed) / RAMP_S
        share = 0.5 - 0.5 * cos(pi * min(1.0, max(0.0, into)))  # half a cosine up and down
        device.command(scale(force, share) if is_held else ZERO, now)

    try:
        dialog.wait(2.0 * RAMP_S + HOLD_S, tick)
    finally:
        with uninterrupted():
            device.command(ZERO, dialog.now())
    if not is_held:
        dialog.tell(f"The handle moved by {gives_way * 1e3:.0f} mm, so the force ended: hold it, and repeat the push.")
