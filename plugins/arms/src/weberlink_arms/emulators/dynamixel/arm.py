"""An emulated arm on a bus of Dynamixel motors, whatever its mechanics: servos, time, watchdogs and faults.

Mechanics advance on a fixed grid of steps, and instructions and watchdogs take effect when they are due, independent of
when `advance` is called. Temperature, backlash and cables are not modelled.
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping, Sequence
from math import inf
from random import Random
from typing import ClassVar

from weberlink.hardware.emulator import WireFaults
from weberlink_arms.dynamixel.layouts import ArmLayout
from weberlink_arms.dynamixel.motor_models import CurrentLaw
from weberlink_arms.emulators.dynamixel.bus import ServoBus
from weberlink_arms.emulators.dynamixel.servo import Measured, Servo, amperes

STEP = 0.0005
"""Of integration [s]."""
GAP_STEPS = round(1.0 / STEP)
"""Most steps per call; the rest of a longer silence is skipped."""
OVERLOAD = 1 << 5


class ArmEmulator(ABC):
    """Sans-I/O: bytes and `now` go in, messages come out. See `weberlink.hardware.emulator`.

    Args:
        layout: The arm.
        ids: Of its motors, in the order of the axes.
        baud: Rate of the bus [bit/s].
        noise_a: Standard deviation of the measured current of a motor [A].
        seed: Of that noise.
        law: What the current registers mean; that of each model if None.
        constant: True torque constants over those of the data sheets.
    """

    transport: ClassVar[str] = "serial"
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        "overload": "a joint raises its alarm and goes limp; 1 is the first joint, the gripper is the last number",
        "low_voltage": "the supply of every motor falls below its limit; any value",
        "trip_watchdog": "the bus watchdog of every motor with its torque on trips; any value",
        "stuck_encoder": "a joint measures a constant angle from now on; 0 for none",
        "dead": "a joint does not receive or answer, its motor keeps its order; 0 for none",
        "restart": "power cycle, which also ends `dead`; any value",
        "wrong_model": "every motor reports this model number, 1060 is an XL430-W250; 0: its own",
    }

    def __init__(
        self,
        layout: ArmLayout,
        ids: Sequence[int],
        *,
        baud: int,
        noise_a: float,
        seed: int,
        law: CurrentLaw | None = None,
        constant: float = 1.0,
    ) -> None:
        self.faults = WireFaults()
        self._random = Random(seed)  # noqa: S311 - noise of a sensor
        self._noise = noise_a
        self._layout, self._models, self._constant = layout, layout.motors, constant
        self.motor_nm = [0.0] * len(ids)
        """Torques of the motors on the axes [N m]."""
        self.currents = [0.0] * len(ids)
        """Present currents of the motors [A]."""
        self.largest_current = 0.0
        """Of any motor since the start [A]."""
        self._stuck: dict[int, float] = {}
        self._injected: deque[tuple[str, float]] = deque()
        self.servos = tuple(self._servo(index, id_, baud, law) for index, id_ in enumerate(ids))
        """In the order of the joints."""
        self.bus = ServoBus(self.servos, baud)
        self._steps: int | None = None

    angles: list[float]
    """Of all axes, the gripper's 0 where it is closed [rad]; a subclass sets it, also before `__init__`."""
    velocities: list[float]
    """[rad/s]"""

    @abstractmethod
    def _move(self, torques: Sequence[float]) -> None:
        """Advance the mechanics by `STEP` under torques of the motors on the axes [N m]."""

    def _place(self, index: int) -> tuple[float, float]:
        """Angle [rad] and velocity [rad/s] of a motor."""
        sign, offset = self._layout.sign[index], self._layout.offset_rad[index]
        return sign * (self.angles[index] - offset), sign * self.velocities[index]

    def _performed(self) -> None:  # noqa: B027 - most arms have nothing to do
        """Called after every instruction."""

    @property
    def watchdog_trips(self) -> int:
        """Of all servos since the start."""
        return sum(servo.watchdog_trips for servo in self.servos)

    def receive(self, data: bytes, now: float) -> None:
        self.advance(now)
        self.bus.receive(data, now)

    def advance(self, now: float) -> None:
        if self._steps is None:
            self._steps = int(now / STEP)
        while self._injected:
            self._suffer(*self._injected.popleft(), now)
        while True:
            request, deadline = self.bus.next_request, self._deadline()
            due = min(request, deadline)
            if due > now:
                break
            self._move_to(due)
            if request <= deadline:
                self.bus.perform(due)
                self._performed()
            else:
                for servo in self.servos:
                    servo.watch(due)
        self._move_to(now)

    def replies(self, now: float) -> list[bytes]:
        return self.bus.leaving(now)

    def next_timer(self) -> float | None:
        soonest = min(self.bus.next_request, self.bus.next_reply, self._deadline())
        return soonest if soonest < inf else None

    def inject(self, name: str, value: float) -> None:
        """Cause one of its own faults at the next `advance`; callable from any thread.

        Raises:
            ValueError: unknown fault or value.
        """
        if name not in self.OWN_FAULTS:
            raise ValueError(f"no fault is called {name!r}; there are {', '.join(self.OWN_FAULTS)}")
        least = {"overload": 1, "stuck_encoder": 0, "dead": 0}.get(name)
        count = len(self.servos)
        if least is not None and value not in range(least, count + 1):
            raise ValueError(f"{name}: expected a joint from {least} to {count}, got {value:g}")
        if name == "wrong_model" and not 0 <= value <= 0xFFFF:
            raise ValueError(f"{name}: expected a model number, got {value:g}")
        self._injected.append((name, value))

    def _suffer(self, name: str, value: float, now: float) -> None:
        index = int(value) - 1
        match name:
            case "overload":
                self.servos[index].alarm(OVERLOAD)
            case "stuck_encoder":
                self._stuck = {} if index < 0 else {index: self._place(index)[0]}
            case "dead":
                self.bus.dead = set() if index < 0 else {self.servos[index].id}
            case _:
                self._suffer_all(name, value, now)

    def _suffer_all(self, name: str, value: float, now: float) -> None:
        if name == "restart":
            self.bus.restart()
        for servo in self.servos:
            match name:
                case "low_voltage":
                    servo.lose_supply()
                case "trip_watchdog":
                    servo.trip()
                case "wrong_model":
                    servo.rename(int(value) or servo.model.number)
                case _:
                    servo.reboot(now)

    def _deadline(self) -> float:
        """When a bus watchdog would trip next."""
        return min([servo.deadline for servo in self.servos])

    def _servo(self, index: int, id_: int, baud: int, law: CurrentLaw | None) -> Servo:
        model = self._models[index]
        # A motor that measures no current has a load only.
        law = model.law if law is None or not model.controls_current else law
        return Servo(id_, lambda: self._measured(index), baud=baud, model=model, law=law)

    def _measured(self, index: int) -> Measured:
        """Sensor values of a servo, with noise."""
        current = self.currents[index] + self._random.gauss(0.0, self._noise)
        if index in self._stuck:
            return Measured(self._stuck[index], 0.0, current)
        angle, velocity = self._place(index)
        return Measured(angle, velocity, current)

    def _move_to(self, now: float) -> None:
        """Advance the mechanics to a time, on the grid of steps."""
        assert self._steps is not None
        end = int(now / STEP)
        begin = max(self._steps, end - GAP_STEPS)
        self._steps = max(end, self._steps)
        for _ in range(begin, end):
            self._step()

    def _step(self) -> None:
        currents = []
        for index, (servo, model) in enumerate(zip(self.servos, self._models, strict=True)):
            angle, velocity = self._place(index)
            currents.append(amperes(servo.drive, self._stuck.get(index, angle), velocity, model))
        self.currents = currents
        self.largest_current = max(self.largest_current, *currents, -min(currents))
        self.motor_nm = [
            sign * self._constant * model.constant * current
            for sign, model, current in zip(self._layout.sign, self._models, currents, strict=True)
        ]
        self._move(self.motor_nm)
