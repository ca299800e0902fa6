"""`gamepad`: a game controller of the input layer (evdev) under rate control, with rumble by the felt force."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import hypot
from select import POLLERR, POLLHUP, POLLIN, poll
from time import monotonic
from typing import Annotated, Any, ClassVar

import evdev
from evdev import ff
from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.discovery import DeviceLocator, PluggedDevice, permission_advice
from weberlink.hardware.fault import HardwareFault
from weberlink.registry import Tier
from weberlink_devices.discovery import input_devices
from weberlink_devices.rate_control import WAIT_S, Deflection, RateDevice, RateOptions

NAME = "gamepad"
codes: Any = evdev.ecodes
"""Of the kernel, which the module makes when it is imported."""
KEYS = (*(codes.BTN_SOUTH, codes.BTN_EAST, codes.BTN_WEST, codes.BTN_NORTH), *(codes.BTN_TL, codes.BTN_TR))
"""The buttons 0 to 5; every gamepad has the first (Documentation/input/gamepad.rst of the kernel)."""
TRIGGER_KEYS = (codes.BTN_TL2, codes.BTN_TR2)
TRIGGERS = ("ABS_Z", "ABS_RZ")
"""Left and right, the buttons 6 and 7; as keys where they are not axes."""
PULLED = 0.5
"""A trigger that is pulled farther is a pressed button."""

RUMBLE_S = 0.25
"""Length of one rumble [s]: a program that stops leaves no longer one."""
RENEW_S = 0.1
RUMBLE_STEP = 0.03
"""Least change of the strength that is sent before it is due."""

Axis = Annotated[str, Field(pattern=r"^(-?ABS_[A-Z0-9_]+|-?triggers)$")]


class GamepadOptions(RateOptions):
    """Options of `gamepad`."""

    dead_zone: float = Field(default=0.15, ge=0.0, lt=1.0, description="share of the deflection that is ignored")
    axes: tuple[Axis, Axis, Axis] = Field(
        default=("ABS_Y", "ABS_X", "-ABS_RY"),
        description="axis of the kernel for x, y and z, - in front reverses it; triggers: the left less the right one",
    )
    rumble_n: float = Field(default=5.0, ge=0.0, le=1e3, description="force of the strongest rumble; 0 for none")


class Rumble:
    """Rumbles of an `evdev.InputDevice` by the force on the hand, of which `full_n` makes the strongest."""

    def __init__(self, pad: Any, full_n: float) -> None:
        self._pad, self._full = pad, full_n
        self._effect = -1
        self._strength = self._due = 0.0

    def feel(self, force: Vector, now: float) -> None:
        """Rumble for this force [N]; raises OSError where the device refuses or is gone."""
        strength = min(1.0, hypot(*force) / self._full)
        changed = abs(strength - self._strength) > RUMBLE_STEP or (strength == 0.0 < self._strength)
        if not changed and (strength == 0.0 or now < self._due):
            return
        self._strength, self._due = strength, now + RENEW_S
        if strength == 0.0:
            self.stop()
            return
        both = ff.Rumble(*[round(0xFFFF * strength)] * 2)
        length, kind = ff.Replay(round(RUMBLE_S * 1e3), 0), ff.EffectType(ff_rumble_effect=both)
        effect = ff.Effect(codes.FF_RUMBLE, self._effect, 0, ff.Trigger(0, 0), length, kind)
        self._effect = self._pad.upload_effect(effect)
        self._pad.write(codes.EV_FF, self._effect, 1)

    def stop(self) -> None:
        if self._effect >= 0:
            self._pad.write(codes.EV_FF, self._effect, 0)


class GamepadExchange:
    """Follows the events of a gamepad; the kernel sends one for each change.

    Args:
        options: of the driver.
        plugged: lists the devices that are plugged in.
        connect: gives an `evdev.InputDevice` for a path.
    """

    def __init__(
        self,
        options: GamepadOptions,
        plugged: Callable[[], list[PluggedDevice]],
        connect: Callable[[str], Any] = evdev.InputDevice,
    ) -> None:
        self._options = options
        self._locator = DeviceLocator(NAME, options.port, plugged)
        self._open_pad = connect
        self._path = ""
        self._pad: Any = None
        self._poll = poll()
        self._ranges: dict[int, tuple[int, int]] = {}
        self._values: dict[int, int] = {}
        self._keys: set[int] = set()
        self._has_lost = False
        """Whether events were lost, and the report is not complete in which they were."""
        self._rumble: Rumble | None = None

    def start_afresh(self) -> None:
        """Forget which device it was, at the next `open`."""
        self._locator.forget()

    def open(self) -> Deflection:
        self._path = self._locator.locate()
        try:
            with self._faults():
                self._pad = self._open_pad(self._path)
                self._poll, self._has_lost = poll(), False
                self._poll.register(self._pad.fd, POLLIN)
                self._resynchronize()
                self._check_axes()
                can_rumble = codes.FF_RUMBLE in self._pad.capabilities().get(codes.EV_FF, ())
                full_n = self._options.rumble_n
                self._rumble = Rumble(self._pad, full_n) if can_rumble and full_n else None
        except HardwareFault:
            self.close()
            raise
        return self._deflection()

    def exchange(self, command: Vector) -> Deflection:
        for _, events in self._poll.poll(round(WAIT_S * 1e3)):
            if events & (POLLHUP | POLLERR):
                raise HardwareFault(f"{self._path}: unplugged")
            with self._faults("unplugged"):
                self._follow()
        if self._rumble is not None:
            try:
                self._rumble.feel(command, monotonic())
            except OSError:  # where the device is gone, the next poll says so
                self._rumble = None
        return self._deflection()

    def close(self) -> None:
        pad, self._pad = self._pad, None
        if pad is not None:
            with suppress(OSError):
                if self._rumble is not None:
                    self._rumble.stop()
            with suppress(OSError):
                pad.close()

    @contextmanager
    def _faults(self, why: str | None = None) -> Iterator[None]:
        """Turns what the system says into faults of the device."""
        try:
            yield
        except PermissionError:
            raise HardwareFault(permission_advice(self._path)) from None
        except OSError as error:
            raise HardwareFault(f"{self._path}: {why or error.strerror or error}") from None

    def _follow(self) -> None:
        """Take the events that have come; after lost ones, the state in their place.

        What follows the lost events up to the next report is a part of one (Documentation/input/event-codes.rst of the
        kernel), and all that was read is older than the state: the kernel takes the keys up to it out of its queue.
        """
        is_old = self._has_lost
        for event in self._pad.read():
            if event.type == codes.EV_SYN:
                self._has_lost = event.code == codes.SYN_DROPPED or (self._has_lost and event.code != codes.SYN_REPORT)
                is_old |= self._has_lost
            elif event.type == codes.EV_ABS and not is_old:
                self._values[event.code] = event.value
            elif event.type == codes.EV_KEY and not is_old:
                (self._keys.add if event.value else self._keys.discard)(event.code)
        if is_old:
            self._resynchronize()

    def _resynchronize(self) -> None:
        """Ask for the state, at the start and after events were lost."""
        axes = dict(self._pad.capabilities().get(codes.EV_ABS, ()))
        self._ranges = {code: (info.min, info.max) for code, info in axes.items()}
        self._values = {code: self._pad.absinfo(code).value for code in axes}
        self._keys = set(self._pad.active_keys())

    def _check_axes(self) -> None:
        for name in self._options.axes:
            for part in TRIGGERS if name.endswith("triggers") else (name.removeprefix("-"),):
                if codes.ecodes.get(part) not in self._ranges:
                    names = (codes.ABS.get(code, str(code)) for code in self._ranges)
                    there = sorted(each if isinstance(each, str) else each[0] for each in names)
                    raise HardwareFault(
                        f"{self._path}: has no axis {part}, it has {', '.join(there) or 'none'}; "
                        "set master.device.axes to three of them"
                    )

    def _deflection(self) -> Deflection:
        x, y, z = (self._along(name.removeprefix("-"), -1.0 if name[0] == "-" else 1.0) for name in self._options.axes)
        return Deflection((x, y, z), ZERO, self._buttons())

    def _along(self, name: str, sign: float) -> float:
        if name == "triggers":
            left, right = map(self._share, TRIGGERS)
            return sign * (left - right)
        return sign * (2.0 * self._share(name) - 1.0)

    def _share(self, name: str) -> float:
        """Where an axis is in its range, 0 to 1."""
        code = codes.ecodes.get(name, -1)
        low, high = self._ranges.get(code, (0, 0))
        return min(max((self._values[code] - low) / (high - low), 0.0), 1.0) if high > low else 0.0

    def _buttons(self) -> int:
        free = not any(name.removeprefix("-") in ("triggers", *TRIGGERS) for name in self._options.axes)
        pulled = [free and self._share(name) > PULLED for name in TRIGGERS]
        pressed = [code in self._keys for code in (*KEYS, *TRIGGER_KEYS)]
        return sum(each << bit for bit, each in enumerate(pressed)) | (pulled[0] | pulled[1] << 1) << len(KEYS)


class GamepadDevice(RateDevice):
    """Sticks that move a position; the force resists the rate, and rumbles where the controller can."""

    TIER: ClassVar[Tier] = "emulated only"
    Options = GamepadOptions
    SIGN_OPTIONS: ClassVar[dict[str, str]] = {axis: f"the entry of {axis} in axes" for axis in "xyz"}

    def __init__(self, options: GamepadOptions, tick_period: float) -> None:
        exchange = GamepadExchange(options, self.plugged)
        super().__init__(NAME, options, exchange, tick_period, buttons=len(KEYS) + len(TRIGGERS))

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return input_devices(KEYS[0])
