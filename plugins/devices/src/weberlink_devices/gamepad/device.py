"""`gamepad`: a game controller of the input layer (evdev) under rate control, with rumble by the felt force."""

from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from math import hypot
from select import POLLERR, POLLHUP, POLLIN, poll
from time import monotonic
from typing import Annotated, Any, ClassVar

from pydantic import Field

from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.discovery import DeviceLocator, PluggedDevice, input_devices, permission_advice
from weberlink.hardware.fault import HardwareFault
from weberlink.registry import Tier
from weberlink_devices.rate_control import WAIT_S, Deflection, RateDevice, RateOptions

NAME = "gamepad"
EV_SYN, EV_KEY, EV_ABS, EV_FF = 0x00, 0x01, 0x03, 0x15
SYN_REPORT, SYN_DROPPED = 0, 3
FF_RUMBLE = 0x50
BTN_GAMEPAD = 0x130
"""Every gamepad has it: its lower button, Documentation/input/gamepad.rst of the kernel."""
KEYS = (0x130, 0x131, 0x134, 0x133, 0x136, 0x137)
"""Codes of the buttons 0 to 5: south, east, west, north, left and right shoulder."""
TRIGGER_KEYS = (0x138, 0x139)
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
    """Rumbles by the force on the hand.

    Args:
        pad: an `evdev.InputDevice` with force feedback.
        full_n: force of the strongest rumble [N], > 0.
    """

    def __init__(self, pad: Any, full_n: float) -> None:
        self._pad, self._full = pad, full_n
        self._ff = import_module("evdev.ff")
        self._effect: Any = None
        self._strength = 0.0
        self._due = 0.0

    def feel(self, force: Vector, now: float) -> None:
        """Rumble for this force [N].

        Raises:
            OSError: the device refuses or is gone.
        """
        strength = min(1.0, hypot(*force) / self._full)
        changed = abs(strength - self._strength) > RUMBLE_STEP or (strength == 0.0 < self._strength)
        if not changed and (strength == 0.0 or now < self._due):
            return
        self._strength, self._due = strength, now + RENEW_S
        if strength == 0.0:
            self.stop()
            return
        magnitude = round(0xFFFF * strength)
        ff = self._ff
        effect = ff.Effect(
            FF_RUMBLE,
            -1 if self._effect is None else self._effect,
            0,
            ff.Trigger(0, 0),
            ff.Replay(round(RUMBLE_S * 1e3), 0),
            ff.EffectType(ff_rumble_effect=ff.Rumble(strong_magnitude=magnitude, weak_magnitude=magnitude)),
        )
        self._effect = self._pad.upload_effect(effect)
        self._pad.write(EV_FF, self._effect, 1)

    def stop(self) -> None:
        if self._effect is not None:
            self._pad.write(EV_FF, self._effect, 0)


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
        connect: Callable[[str], Any] = lambda path: import_module("evdev").InputDevice(path),
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
            self._pad = self._open_pad(self._path)
        except PermissionError:
            raise HardwareFault(permission_advice(self._path)) from None
        except OSError as error:
            raise HardwareFault(f"{self._path}: {error.strerror or error}") from None
        try:
            self._poll = poll()
            self._poll.register(self._pad.fd, POLLIN)
            self._has_lost = False
            self._resynchronize()
            self._check_axes()
            can_rumble = FF_RUMBLE in self._pad.capabilities().get(EV_FF, ())
            self._rumble = Rumble(self._pad, self._options.rumble_n) if can_rumble and self._options.rumble_n else None
        except HardwareFault:
            self.close()
            raise
        except OSError as error:
            self.close()
            raise HardwareFault(f"{self._path}: {error.strerror or error}") from None
        return self._deflection()

    def exchange(self, command: Vector) -> Deflection:
        for _, events in self._poll.poll(round(WAIT_S * 1e3)):
            if events & (POLLHUP | POLLERR):
                raise HardwareFault(f"{self._path}: unplugged")
            try:
                self._follow()
            except OSError:
                raise HardwareFault(f"{self._path}: unplugged") from None
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

    def _follow(self) -> None:
        """Take the events that have come; after lost ones, the state in their place.

        What follows the lost events up to the next report is a part of one (Documentation/input/event-codes.rst of the
        kernel), and all that was read is older than the state: the kernel takes the keys up to it out of its queue.
        """
        is_old = self._has_lost
        for event in self._pad.read():
            if event.type == EV_SYN and event.code == SYN_DROPPED:
                self._has_lost = is_old = True
            elif event.type == EV_SYN and event.code == SYN_REPORT:
                self._has_lost = False
            elif is_old:
                continue
            elif event.type == EV_ABS:
                self._values[event.code] = event.value
            elif event.type == EV_KEY:
                (self._keys.add if event.value else self._keys.discard)(event.code)
        if is_old:
            self._resynchronize()

    def _resynchronize(self) -> None:
        """Ask for the state, at the start and after events were lost."""
        axes = dict(self._pad.capabilities().get(EV_ABS, ()))
        self._ranges = {code: (info.min, info.max) for code, info in axes.items()}
        self._values = {code: self._pad.absinfo(code).value for code in axes}
        self._keys = set(self._pad.active_keys())

    def _check_axes(self) -> None:
        for name in self._options.axes:
            for part in TRIGGERS if name.endswith("triggers") else (name.removeprefix("-"),):
                if code_of(part) not in self._ranges:
                    there = ", ".join(sorted(map(name_of, self._ranges))) or "none"
                    raise HardwareFault(
                        f"{self._path}: has no axis {part}, it has {there}; set master.device.axes to three of them"
                    )

    def _deflection(self) -> Deflection:
        x, y, z = (self._along(name) for name in self._options.axes)
        return Deflection((x, y, z), ZERO, self._buttons())

    def _along(self, name: str) -> float:
        sign = -1.0 if name.startswith("-") else 1.0
        name = name.removeprefix("-")
        if name == "triggers":
            left, right = map(self._share, TRIGGERS)
            return sign * (left - right)
        return sign * (2.0 * self._share(name) - 1.0)

    def _share(self, name: str) -> float:
        """Where an axis is in its range, 0 to 1."""
        code = code_of(name)
        low, high = self._ranges.get(code, (0, 0))
        return min(max((self._values[code] - low) / (high - low), 0.0), 1.0) if high > low else 0.0

    def _buttons(self) -> int:
        pressed = sum((code in self._keys) << bit for bit, code in enumerate(KEYS))
        free = not any(name.removeprefix("-") in ("triggers", *TRIGGERS) for name in self._options.axes)
        for bit, (name, key) in enumerate(zip(TRIGGERS, TRIGGER_KEYS, strict=True), len(KEYS)):
            pulled = key in self._keys or (free and self._share(name) > PULLED)
            pressed |= pulled << bit
        return pressed


@lru_cache
def code_of(name: str) -> int:
    """Code of an axis of the kernel; -1 for an unknown name."""
    code: int = import_module("evdev").ecodes.ecodes.get(name, -1)
    return code


def name_of(code: int) -> str:
    name = import_module("evdev").ecodes.ABS.get(code, str(code))
    return name if isinstance(name, str) else str(name[0])


class GamepadDevice(RateDevice):
    """Sticks that move a position; the force resists the rate, and rumbles where the controller can."""

    TIER: ClassVar[Tier] = "emulated only"
    Options = GamepadOptions
    SIGN_OPTIONS: ClassVar[dict[str, str]] = {axis: f"the entry of {axis} in axes" for axis in "xyz"}

    def __init__(self, options: GamepadOptions, tick_period: float) -> None:
        super().__init__(
            NAME, options, GamepadExchange(options, self.plugged), tick_period, buttons=len(KEYS) + len(TRIGGERS)
        )

    @classmethod
    def plugged(cls) -> list[PluggedDevice]:
        return input_devices(BTN_GAMEPAD)
