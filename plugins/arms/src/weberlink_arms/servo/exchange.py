"""One cycle on the bus of an arm: how it opens, and how it is left."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from time import monotonic, sleep
from typing import Any, Final, Generic, TypeVar

from weberlink.geometry.joints import Joints
from weberlink.hardware.fault import HardwareFault
from weberlink_arms.servo.bus import ServoBus, Servos
from weberlink_arms.servo.options import AngleScale
from weberlink_mujoco.arms.models import load

Command = TypeVar("Command")
Sample = TypeVar("Sample")
Present = list[Any]  # measurements of all servos, of a type of their own
Gravity = Callable[[Joints], Joints]  # torques of all axes [N m] that hold the arm at these angles [rad]

WATCH_EVERY: Final = 25  # cycles between two checks of a servo
BEYOND_RAD: Final = 0.35  # largest angle of an axis beyond its range at opening; more means that its zero is wrong
TRIES: Final = 40  # readings, so that a busy host does not look like a slow adapter


def no_gravity(angles: Joints) -> Joints:
    return (0.0,) * len(angles)


def gravity_of(model: str, wanted: bool) -> Gravity:
    """By the model of this name, or none; raises ValueError where MuJoCo is missing."""
    return load(model).gravity if wanted else no_gravity


class ServoExchange(ABC, Generic[Command, Sample]):
    """The work of the bus thread: `connect` opens the port, at every opening, and `pause` sleeps [s]."""

    ZERO_ADVICE = "check ids, sign, offset_rad, lower_rad and upper_rad"

    def __init__(
        self,
        options: Any,
        connect: Callable[[], Any],
        gravity: Gravity = no_gravity,
        clock: Callable[[], float] = monotonic,
        pause: Callable[[float], None] = sleep,
    ) -> None:
        self._options: Any = options  # of the arm: BusOptions at least
        self._connect, self._gravity, self._clock, self._pause = connect, gravity, clock, pause
        self._scale = AngleScale((), ())
        self._port: Any = None
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

    def _begin(self, port: Any) -> Sample:
        options = self._options
        ids, names = options.bus_ids, options.axis_names
        bus = options.BUS(port, options.baud, ids, names, options.margin_s, self._clock, self._pause)
        servos = self._group = self._made(bus)
        servos.find()
        self._scale = self._scaled(servos)
        places = zip(ids, self._angles(self._first()), options.lower, options.upper, strict=True)
        for id_, angle, low, high in places:
            if not low - BEYOND_RAD <= angle <= high + BEYOND_RAD:
                raise HardwareFault(
                    f"{bus.label(id_)}: stands at {angle:.2f} rad, where it cannot be ({low:.2f} to {high:.2f}): "
                    f"{self.ZERO_ADVICE}"
                )
        self._prepare()
        check_pace(self._first, options.rate_hz, self._clock, port.path, self._advice)
        now = self._clock()
        present = self._first()
        angles = self._angles(present)
        self._cycle = 0
        self._engaged = True  # from here on, `close` must make the servos safe
        self._engage(angles, now)
        return self._sample(present, angles, now)

    def _first(self) -> Present:
        bus: ServoBus = self._servos.bus
        return bus.insist(bus.present)

    def _angles(self, present: Present) -> Joints:
        return self._scale.angles([each.position for each in present])

    def close(self) -> None:
        """Leave the arm safe; any number of times."""
        engaged, self._engaged = self._engaged, False
        if self._group is not None and engaged:
            self._leave()
        self._group = None
        port, self._port = self._port, None
        if port is not None:
            port.close()

    @abstractmethod
    def _made(self, bus: Any) -> Servos[Any]:
        """The servos on a bus."""

    def _scaled(self, servos: Any) -> AngleScale:  # noqa: ARG002
        scale: AngleScale = self._options.scale
        return scale

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


def check_pace(
    read: Callable[[], object], rate_hz: float, clock: Callable[[], float], path: str, advice: Callable[[], str]
) -> None:
    """Raise HardwareFault, with what to do about it, if even the best reading of all motors does not fit into a period
    of the bus at `path`.
    """
    period, best = 1.0 / rate_hz, 1.0
    for _ in range(TRIES):
        began = clock()
        read()
        best = min(best, clock() - began)
        if best <= period:
            return
    raise HardwareFault(
        f"{path}: a reading takes {best * 1e3:.1f} ms at best, {rate_hz:g} Hz leave {period * 1e3:.1f} ms; {advice()}"
    )
