"""The common part of the emulated Polhem boards: a handle in a hand, encoders, motors, amplifiers and faults."""

from collections.abc import Mapping
from dataclasses import replace
from math import sin, tau
from typing import ClassVar, Self

from pydantic import Field, model_validator

from weberlink.geometry.vector import ZERO, Vector, subtract
from weberlink.hardware.emulator import Emulator
from weberlink.master.devices.polhem.mechanism import Board
from weberlink.master.devices.polhem.parameters import BOARDS, PARAMETERS, Directions, SetName
from weberlink.master.devices.polhem.protocol import Counts
from weberlink.options import Options
from weberlink_devices.handle import Handle, HandleOptions

Currents = tuple[float, float, float]

OFF: Currents = (0.0, 0.0, 0.0)
WRIST_RAD = 0.3
WRIST_HZ = (0.21, 0.13, 0.08)
FARTHEST_MM = 200.0

FAULTS: Mapping[str, str] = {
    "stuck_encoder": "encoder 1 to 6 keeps its count from now on; 0: all are free again",
    "restart": "power goes and comes back: counters begin at 0 wherever the handle is, motors off",
    "trip_watchdog": "the watchdog is never fed: motors off for good; 0: it is fed again",
    "button": "the calibration button is pressed, wherever the handle is",
    "home": "the handle is carried to its home pose and held there",
    "x_mm": "the handle is carried so far toward the operator from the middle, and held there",
    "y_mm": "the same, to the right",
    "z_mm": "the same, up",
    "release": "the hand goes on with its script",
}


class BoardOptions(Options):
    """Options that the emulated Polhem devices have in common."""

    handle: HandleOptions = Field(default=HandleOptions(), description="who holds it, and what that person does")
    parameters: SetName | None = Field(default=None, description="set of its mechanism")
    encoder_signs: Directions = Field(
        default=(1, 1, 1), description="-1 for an encoder that counts the wrong way round"
    )
    motor_signs: Directions = Field(default=(1, 1, 1), description="-1 for a motor wired the wrong way round")
    weight: bool = Field(default=False, description="the links have their published weight, which pulls at the hand")
    homed: bool = Field(
        default=True, description="was in its home pose at power-up; else counters begin where the handle is"
    )
    processing_s: float = Field(default=0.0002, ge=0.0, le=0.1, description="from a message to what it causes")

    @property
    def board(self) -> Board:
        raise NotImplementedError

    @property
    def set_name(self) -> str:
        return self.parameters or "woodenhaptics_2015"

    @model_validator(mode="after")
    def _check(self) -> Self:
        wirings = PARAMETERS[self.set_name].wirings
        if self.board not in wirings:
            boards = " and ".join(BOARDS[each] for each in wirings)
            raise ValueError(f"parameters: {self.set_name} is published for {boards}, not for {BOARDS[self.board]}")
        return self


class PolhemBoard(Emulator):
    """The board of an emulated device (see `weberlink.hardware.emulator`); subclasses speak the wire formats.

    `messages` came, right or wrong, `errors` are the wrong ones among them. `watchdog_trips`: how often the amplifiers
    went off without a message. Raises ValueError if it is to have a weight, and none is published.
    """

    WATCHDOG_S: ClassVar[float]  # how long the amplifiers stay on after a message [s]

    OWN_FAULTS: ClassVar[Mapping[str, str]] = FAULTS
    fault_values: Mapping[str, range | float] = {
        "stuck_encoder": range(7),
        "gimbal_error": range(8),
        "wrong_model": range(4),
        **dict.fromkeys(("x_mm", "y_mm", "z_mm"), FARTHEST_MM),
    }

    def __init__(self, options: BoardOptions) -> None:
        super().__init__()
        self.messages = self.errors = 0
        mechanism, (a, b, c) = PARAMETERS[options.set_name], options.encoder_signs
        if options.weight and not mechanism.linkage.masses:
            raise ValueError("weight: no masses are published for this mechanism")
        wiring = mechanism.wirings[options.board]
        (d, e, f), (g, h, i) = wiring.encoder, wiring.home_counts
        # The home pose stays where it is: an encoder that counts the other way has its zero on the other side.
        wiring = replace(wiring, encoder=(a * d, b * e, c * f), home_counts=(a * g, b * h, c * i))
        self.mechanism = replace(mechanism, wiring=wiring)
        self.handle = Handle(options.handle)
        self.currents_ma: Currents = OFF
        self.largest_current_ma = 0.0
        self.enabled = False
        self.watchdog_trips = 0
        self._button_pressed = False  # whether the calibration button was pressed since the board last looked
        self._weight = options.weight
        self._processing = options.processing_s
        self._motor_signs = options.motor_signs
        self._fed = True
        self._off_at: float | None = None
        self._step_at: float | None = None  # when the board goes on: a message takes effect, or a report leaves
        self._now: float | None = None
        self._zero: Counts = (0,) * 6
        self._stuck: dict[int, int] = {}
        self._truth = self._true_counts(0.0)
        if not options.homed:
            self._zero = self._truth

    def advance(self, now: float) -> None:
        while self._step_at is not None and self._step_at <= now:
            at, self._step_at = self._step_at, None
            self._advance_to(at)
            self._step(at, now)
        self._advance_to(now)
        super().advance(now)

    def _step(self, at: float, now: float) -> None:
        """Go on at `at` [s], which may be before `now`."""
        raise NotImplementedError

    def next_timer(self) -> float | None:
        return min((each for each in (self._step_at, self._off_at) if each is not None), default=None)

    @property
    def counts(self) -> Counts:
        """Contents of the six counters."""
        since = (true - zero for true, zero in zip(self._truth, self._zero, strict=True))
        return tuple(self._stuck.get(i, count) for i, count in enumerate(since))

    @property
    def force(self) -> Vector:
        """Force on the hand now, in the device's frame [N]; with `weight`, that of the links is part of it."""
        push = ZERO if self.currents_ma == OFF else self.mechanism.force(self.currents_ma, self._truth)
        return subtract(push, self.mechanism.carrying_force(self._truth)) if self._weight else push

    def _advance_to(self, now: float) -> None:
        """Move hand, encoders and watchdog on to `now` [s]."""
        if self._off_at is not None and now >= self._off_at:
            self._move(self._off_at)
            self._switch_off()
            self.watchdog_trips += 1
        self._move(now)

    def _drive(self, currents_ma: Currents, now: float) -> None:
        """Act on a message: amplifiers on, watchdog fed, these currents flow."""
        if not self._fed:
            return
        self.enabled = True
        self._off_at = now + self.WATCHDOG_S
        a, b, c = (sign * current for sign, current in zip(self._motor_signs, currents_ma, strict=True))
        self.currents_ma = (a, b, c)
        self.largest_current_ma = max(self.largest_current_ma, *map(abs, self.currents_ma))

    def _set_counters(self, counts: Counts) -> None:
        self._zero = tuple(true - count for true, count in zip(self._truth, counts, strict=True))

    def apply_fault(self, name: str, value: float) -> None:
        match name:
            case "stuck_encoder" if value == 0:
                self._stuck.clear()
            case "stuck_encoder":
                self._stuck[int(value) - 1] = self.counts[int(value) - 1]
            case "restart":
                self._switch_off()
                self._fed = True
                self._button_pressed = False
                self._step_at = None
                self.leaving.clear()
                self._stuck.clear()
                self._zero = self._truth
            case "trip_watchdog":
                self._fed = value == 0
                if not self._fed and self.enabled:
                    self._switch_off()
                    self.watchdog_trips += 1
            case "button":
                self._button_pressed = True
            case "release":
                self.handle.carry(None)
            case "home":
                self.handle.carry(self.mechanism.position((0, 0, 0)))
            case "x_mm" | "y_mm" | "z_mm":
                x, y, z = (1e-3 * value * (name == f"{axis}_mm") for axis in "xyz")
                self.handle.carry((x, y, z))

    def _move(self, now: float) -> None:
        if self._now is not None and now <= self._now:
            return
        self.handle.advance(self.force, now)
        self._now = now
        self._truth = self._true_counts(now)

    def _switch_off(self) -> None:
        self.enabled = False
        self._off_at = None
        self.currents_ma = OFF

    def _true_counts(self, now: float) -> Counts:
        """Counts relative to the home pose; a wrist with sensors turns back and forth."""
        wrist = zip(self.mechanism.gimbal_counts_per_turn, WRIST_HZ, strict=True)
        gimbal = (round(turn * WRIST_RAD * sin(tau * hz * now) / tau) for turn, hz in wrist)
        return (*self.mechanism.counts_at(self.handle.position), *gimbal)
