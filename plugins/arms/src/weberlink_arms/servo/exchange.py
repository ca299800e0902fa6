"""One cycle on the bus of an arm: how it opens, how it is left, and what a follower senses."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import monotonic, sleep
from typing import Any, Final, Generic, TypeVar

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.servo.bus import ServoPort
from weberlink_arms.servo.filter import LowPass
from weberlink_arms.servo.gravity import Gravity, no_gravity
from weberlink_arms.servo.on_close import LEAST_RAD, LIES_S, SETTLE_S, SINK_RAD_S, give_way
from weberlink_arms.servo.options import AngleScale
from weberlink_arms.servo.pace import check_pace
from weberlink_arms.servo.servos import Servos

Command = TypeVar("Command")
Sample = TypeVar("Sample")
Present = list[Any]
"""Measurements of all servos, of a type of their own."""

WATCH_EVERY: Final = 25
"""Cycles between two checks of a servo."""
BEYOND_RAD: Final = 0.35
"""Largest angle of an axis beyond its range at opening; more means that its zero is wrong."""


class ServoExchange(ABC, Generic[Command, Sample]):
    """The work of the bus thread.

    Args:
        options: Of the arm.
        connect: Opens the port, at every opening.
        gravity: Of the arm.
        clock: Monotonic [s].
        pause: Sleeps [s].
    """

    def __init__(
        self,
        options: Any,
        connect: Callable[[], ServoPort],
        gravity: Gravity = no_gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._options: Any = options  # of the arm: BusOptions at least
        self._connect, self._gravity = connect, gravity
        self._clock, self._pause = clock, pause
        self._scale = AngleScale((), ())
        self._port: ServoPort | None = None
        self._group: Servos[Any] | None = None
        self._engaged = False
        self._cycle = 0

    @property
    def _servos(self) -> Any:
        assert self._group is not None
        return self._group

    @abstractmethod
    def exchange(self, command: Command) -> Sample:
        """See `weberlink.hardware.worker.Exchange`."""

    def open(self) -> Sample:
        self._port = self._connect()
        try:
            return self._begin(self._port)
        except BaseException:
            self.close()
            raise

    def _begin(self, port: ServoPort) -> Sample:
        servos = self._group = self._made(port)
        servos.find()
        self._scale = self._scaled(servos)
        self._check_place(self._angles(self._first()))
        self._prepare()
        check_pace(self._first, self._options.rate_hz, self._clock, port.path, self._advice)
        now = self._clock()
        present = self._first()
        angles = self._angles(present)
        self._cycle = 0
        self._engaged = True  # from here on, `close` must make the servos safe
        self._engage(angles, now)
        return self._sample(present, angles, now)

    def _first(self) -> Present:
        measured: Present = self._servos.bus.insist(self._measured)
        return measured

    def _angles(self, present: Present) -> Joints:
        return self._scale.angles([each.position for each in present])

    def _check_place(self, angles: Joints) -> None:
        lower, upper = self._range()
        bus = self._servos.bus
        for id_, angle, low, high in zip(bus.ids, angles, lower, upper, strict=True):
            if not low - BEYOND_RAD <= angle <= high + BEYOND_RAD:
                raise HardwareFault(
                    f"{bus.label(id_)}: stands at {angle:.2f} rad, where it cannot be ({low:.2f} to {high:.2f}): "
                    f"{self.ZERO_ADVICE}"
                )

    ZERO_ADVICE = "check ids, sign, offset_rad, lower_rad and upper_rad"

    def close(self) -> None:
        """Leave the arm safe; any number of times."""
        engaged, self._engaged = self._engaged, False
        if self._group is not None and engaged:
            self._leave()
        self._group = None
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _range(self) -> tuple[Joints, Joints]:
        """Of the angles [rad]."""
        return self._options.lower, self._options.upper

    @abstractmethod
    def _made(self, port: ServoPort) -> Servos[Any]:
        """The servos on a port."""

    @abstractmethod
    def _scaled(self, servos: Any) -> AngleScale: ...

    @abstractmethod
    def _measured(self) -> Present: ...

    @abstractmethod
    def _prepare(self) -> None:
        """Settings before the torque is on."""

    @abstractmethod
    def _advice(self) -> str:
        """What makes a bus quicker."""

    @abstractmethod
    def _engage(self, angles: Joints, now: float) -> None:
        """Torque on, without a motion."""

    @abstractmethod
    def _sample(self, present: Present, angles: Joints, at: float) -> Sample: ...

    @abstractmethod
    def _leave(self) -> None:
        """Make the servos safe; never raises."""


class PositionControl:
    """What a follower under the position control of its servos senses, and how it is left; for exchanges.

    At rest and in slow motion the motors carry weight, friction and the torque of the environment:

        environment = weight + friction - motor

    less a dead zone. The inertia of links and rotors is not subtracted.
    """

    def __init__(self, stiffness: Joints, dead_zone: Joints, cutoff: float) -> None:
        self._stiffness, self._dead_zone = stiffness, dead_zone
        self._filter = LowPass(cutoff)
        self.goal: Joints = ()
        """The last one [rad]."""
        self.sinks = self.lies = False
        """Whether the arm is to sink by its weight, and whether the motors have nothing to carry any more."""
        self._still: tuple[float, Joints] = (-inf, ())

    def restart(self, goal: Joints) -> None:
        self.goal = goal
        self.sinks = self.lies = False
        self._still = (-inf, goal)
        self._filter.restart()

    def sink(self, angles: Joints, now: float, period: float) -> None:
        """In each cycle of an arm that sinks: the goals, below which it sags, follow it down at `SINK_RAD_S`."""
        way = SINK_RAD_S * period
        left = [at - goal for at, goal in zip(angles, self.goal, strict=True)]
        self.goal = tuple([goal + min(max(each, -way), way) for goal, each in zip(self.goal, left, strict=True)])
        since, there = self._still
        moved = [at - was for at, was in zip(angles, there, strict=True)]
        if since == -inf or max(map(abs, left + moved)) > LEAST_RAD:
            self._still = (now, angles)
        self.lies = now - self._still[0] > LIES_S

    def sensed(self, torques: Joints, at: float) -> Joints:
        """Filtered torques beyond the dead zone [N m]."""
        felt = zip(self._filter.next(torques, at), self._dead_zone, strict=True)
        return tuple([each - min(max(each, -zone), zone) for each, zone in felt])

    def raised(self, angles: Joints, weight: Joints) -> Joints:
        """Goals at which the motors carry a weight at these angles, and push on nothing [rad].

        Position control needs an error to push: the weight gets its share of it.
        """
        return tuple([angle + each / k for angle, each, k in zip(angles, weight, self._stiffness, strict=True)])

    def leave(
        self,
        place: Callable[[], Joints],
        go: Callable[[Joints], None],
        clock: Callable[[], float],
        pause: Callable[[], None],
    ) -> Joints | None:
        """Move the goals until the arm pushes on nothing; the last ones, or None where they are not known.

        Args:
            place: Measures goals at which the arm would push on nothing where it is [rad].
            go: Sets goals; called again and again, for watchdogs.
            clock: [s]
            pause: Waits for a cycle.
        """

        def settled(goals: Joints) -> Joints:
            until = clock() + SETTLE_S
            while clock() < until:
                go(goals)
                pause()
            return place()

        goals = None
        with suppress(HardwareFault):
            goals = give_way(self.goal, place(), settled)
        return goals
