"""A haptic device and the person before it: readings, the sign check without force, and then a gentle force."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, runtime_checkable

import yaml
from pydantic import BaseModel

from weberlink.apps.device_test.dialog import Dialog
from weberlink.apps.device_test.force_check import agrees, check_force
from weberlink.apps.device_test.gauge import Gauge
from weberlink.apps.device_test.outcome import described, millimetres, uninterrupted
from weberlink.apps.device_test.sense import FRAME, Frame
from weberlink.apps.device_test.sign_check import check_signs
from weberlink.geometry.vector import ZERO
from weberlink.master.devices.contract import Device, DeviceReading

READY = "Put the handle where it has to be when a session begins."
SIGNS = "signs_checked"
"""The option of drivers that give no force until a person has seen and felt that their directions are right.

Its value is printed only after the last axis was felt: a position that goes the right way says nothing of the motors.
"""


@runtime_checkable
class Timed(Protocol):
    """A device that says how long its last exchange took [s]."""

    @property
    def round_trip_s(self) -> float: ...


def try_master(driver: Any, options: BaseModel, build: Callable[[BaseModel], Device], dialog: Dialog) -> None:
    """The whole test of a haptic device.

    Args:
        driver: its class.
        options: of the driver.
        build: makes a device of options.
        dialog: with the person.

    Raises:
        DeviceTestError: something is not as it should be; the force is at zero, as with the others.
        DeviceFault: the device cannot go on.
        Left: the person does not go on.
    """
    frame: Frame = {**FRAME, **getattr(driver, "FRAME", {})}
    is_hardware = hasattr(driver, "plugged")
    fingerprint: str | None = driver.fingerprint(options) if hasattr(driver, "fingerprint") else None
    idle, armed = (build(_with_signs(options, signs)) for signs in (None, fingerprint))
    dialog.tell(*described(armed.spec))
    if is_hardware:
        dialog.tell(READY)
        dialog.ask("Enter opens it, without force: ")
    with _opened(idle, dialog) as device:
        dialog.watch(DeviceView(device), "Enter to go on: ")
        if is_hardware:
            check_signs(device, frame, getattr(driver, "SIGN_OPTIONS", {}), DeviceView, dialog)
        else:
            dialog.tell("It is computed: there is no handle to move, and no sign to check.")
    if not armed.spec.force_feedback:
        dialog.tell("There is no force to feel with these options; that was all.")
        return
    if not agrees(armed, dialog):
        if fingerprint is not None:
            dialog.tell(f"The signs of its motors are not checked, so there is no {SIGNS} to print.")
        return
    if is_hardware:
        dialog.tell(READY)
        dialog.ask("Hold it; Enter opens it, with force: ")
    with _opened(armed, dialog) as device:
        check_force(device, frame, getattr(driver, "FORCE_OPTIONS", {}), dialog, may_move=not is_hardware)
    if fingerprint is not None:
        dialog.tell("Put this line under master.device:", f"  {SIGNS}: {_yaml(fingerprint)}")


def _with_signs(options: BaseModel, fingerprint: str | None) -> BaseModel:
    return options.model_copy(update={SIGNS: fingerprint}) if SIGNS in type(options).model_fields else options


def _yaml(text: str) -> str:
    """A text that a file takes for one, also where it has digits alone."""
    return text if yaml.safe_load(text) == text else f'"{text}"'


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


class DeviceView:
    """Position, rate and age, and what else the device has."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._timed = device if isinstance(device, Timed) else None
        self._gauge = Gauge()
        self._reading: DeviceReading | None = None

    def look(self, now: float) -> None:
        self._reading = self._device.latest(now)
        self._gauge.note(now, self._reading.at)

    def lines(self) -> list[str]:
        reading, spec = self._reading, self._device.spec
        assert reading is not None
        round_trip = None if self._timed is None else self._timed.round_trip_s
        lines = [f"{millimetres(reading.position)}   {self._gauge.in_words(round_trip)}"]
        if reading.orientation is not None:
            lines.append("orientation (w, x, y, z) " + " ".join(f"{part:+.3f}" for part in reading.orientation))
        if spec.buttons:
            pressed = [str(button) for button in range(spec.buttons) if reading.buttons >> button & 1]
            lines.append(f"buttons pressed: {', '.join(pressed) or 'none'} (of 0 to {spec.buttons - 1})")
        return lines
