"""What is behind the board of an emulated device: the handle in a hand, encoders, motors and amplifiers; no bytes."""

from collections.abc import Mapping
from math import sin, tau

from pydantic import BaseModel, ConfigDict, Field

from weberlink.geometry.vector import ZERO, Vector, subtract
from weberlink.master.devices.polhem.mechanism import Mechanism
from weberlink.master.devices.polhem.options import SetName, Signs
from weberlink.master.emulators.handle import Handle, HandleOptions

Currents = tuple[float, float, float]
Counts6 = tuple[int, int, int, int, int, int]

OFF: Currents = (0.0, 0.0, 0.0)
WRIST_RAD = 0.3
WRIST_HZ = (0.21, 0.13, 0.08)

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


class BodyOptions(BaseModel):
    """Options that the emulated devices have in common."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    handle: HandleOptions = Field(default=HandleOptions(), description="who holds it, and what that person does")
    parameters: SetName | None = Field(default=None, description="set of its mechanism")
    encoder_signs: Signs = Field(default=(1, 1, 1), description="-1 for an encoder that counts the wrong way round")
    motor_signs: Signs = Field(default=(1, 1, 1), description="-1 for a motor wired the wrong way round")
    weight: bool = Field(default=False, description="the links have their published weight, which pulls at the hand")
    homed: bool = Field(
        default=True, description="was in its home pose at power-up; else counters begin where the handle is"
    )
    processing_s: float = Field(default=0.0002, ge=0.0, le=0.1, description="from a message to what it causes")


class Body:
    """A device as its board sees it: counters to read, currents to set.

    Args:
        options: of the device.
        mechanism: as it is wired.
        watchdog_s: how long the amplifiers stay on after a message [s].

    Raises:
        ValueError: it is to have a weight, and none is published.
    """

    def __init__(self, options: BodyOptions, mechanism: Mechanism, watchdog_s: float) -> None:
        if options.weight and mechanism.weight is None:
            raise ValueError("weight: no masses are published for this mechanism")
        self.mechanism = mechanism
        self._weight = options.weight
        self.handle = Handle(options.handle)
        self.currents_ma: Currents = OFF
        """That flow in the motors now [mA]."""
        self.enabled = False
        """Whether the amplifiers are on."""
        self.watchdog_trips = 0
        self.largest_current_ma = 0.0
        """There has ever been in a motor [mA]."""
        self.last_force_at: float | None = None
        """When there was last any current [s]."""
        self.button_pressed = False
        """Whether the calibration button was pressed since the board last looked."""
        self._motor_signs = options.motor_signs
        self._watchdog = watchdog_s
        self._fed = True
        self._off_at: float | None = None
        self._now: float | None = None
        self._zero: Counts6 = (0, 0, 0, 0, 0, 0)
        self._stuck: dict[int, int] = {}
        self._truth = self._true_counts(0.0)
        if not options.homed:
            self._zero = self._truth

    @property
    def counts(self) -> Counts6:
        """What the six counters hold."""
        a, b, c, d, e, f = (
            self._stuck.get(i, true - zero) for i, (true, zero) in enumerate(zip(self._truth, self._zero, strict=True))
        )
        return (a, b, c, d, e, f)

    @property
    def force(self) -> Vector:
        """On the hand now [N]; with `weight`, that of the links pulls too."""
        push = ZERO if self.currents_ma == OFF else self.mechanism.force(self.currents_ma, self._truth)
        return subtract(push, self.mechanism.carrying_force(self._truth)) if self._weight else push

    @property
    def next_timer(self) -> float | None:
        """When the watchdog will bite [s]."""
        return self._off_at

    def advance(self, now: float) -> None:
        """Let hand, encoders and watchdog come up to `now` [s]."""
        if self._off_at is not None and now >= self._off_at:
            self._move(self._off_at)
            self._switch_off()
            self.watchdog_trips += 1
        self._move(now)

    def drive(self, currents_ma: Currents, now: float) -> None:
        """A message has come: amplifiers on, the watchdog fed, these currents flow."""
        if not self._fed:
            return
        self.enabled = True
        self._off_at = now + self._watchdog
        self._set_currents(currents_ma)

    def set_counters(self, counts: Counts6) -> None:
        """From now on the counters hold these counts."""
        a, b, c, d, e, f = (true - count for true, count in zip(self._truth, counts, strict=True))
        self._zero = (a, b, c, d, e, f)

    def suffer(self, name: str, value: float) -> None:
        """One of `FAULTS` happens."""
        match name:
            case "stuck_encoder" if value == 0:
                self._stuck.clear()
            case "stuck_encoder":
                self._stuck[int(value) - 1] = self.counts[int(value) - 1]
            case "restart":
                self._switch_off()
                self._fed = True
                self.button_pressed = False
                self._stuck.clear()
                self._zero = self._truth
            case "trip_watchdog":
                self._fed = value == 0
                if not self._fed and self.enabled:
                    self._switch_off()
                    self.watchdog_trips += 1
            case "button":
                self.button_pressed = True
            case "release":
                self.handle.carry(None)
            case _:
                self.handle.carry(self._place(name, value))

    def _place(self, name: str, value: float) -> Vector:
        if name == "home":
            return self.mechanism.position((0, 0, 0))
        x, y, z = (1e-3 * value * (name == f"{axis}_mm") for axis in "xyz")
        return (x, y, z)

    def _move(self, now: float) -> None:
        if self._now is not None and now <= self._now:
            return
        if self.currents_ma != OFF:
            self.last_force_at = now
        self.handle.advance(self.force, now)
        self._now = now
        self._truth = self._true_counts(now)

    def _set_currents(self, currents_ma: Currents) -> None:
        a, b, c = (sign * current for sign, current in zip(self._motor_signs, currents_ma, strict=True))
        self.currents_ma = (a, b, c)
        self.largest_current_ma = max(self.largest_current_ma, *map(abs, self.currents_ma))
        if self.currents_ma != OFF:
            self.last_force_at = self._now

    def _switch_off(self) -> None:
        self.enabled = False
        self._off_at = None
        self.currents_ma = OFF

    def _true_counts(self, now: float) -> Counts6:
        """Relative to the home pose; a wrist that turns to and fro where there are sensors for it."""
        a, b, c = self.mechanism.counts_at(self.handle.position)
        d, e, f = (
            round(turn * WRIST_RAD * sin(tau * hz * now) / tau)
            for turn, hz in zip(self.mechanism.drive.gimbal_counts_per_turn, WRIST_HZ, strict=True)
        )
        return (a, b, c, d, e, f)
