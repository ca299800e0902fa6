"""The contract of every haptic device driver."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from weberlink.geometry.vector import Vector, is_finite

if TYPE_CHECKING:  # rotations are imported where something turns
    from weberlink.geometry.rotation import Quaternion


class DeviceFault(RuntimeError):  # noqa: N818 - a fault is what the operator meets, an error is ours
    """The device cannot continue; the message says why. The loop ends the session with the force at zero."""


@dataclass(frozen=True, slots=True)
class DeviceSpec:
    """What a device can do, known before it is opened."""

    name: str  # of the driver
    axes: str  # that move, for example "xyz" or "z"; the others stay at 0
    force_n: float  # largest that it displays, more is cut to it; 0 without force feedback
    stiffness_n_m: float  # of the stiffest wall that it displays stably at `rate_hz`
    workspace_m: tuple[Vector, Vector]  # lower and upper corner of where the hand may be
    rate_hz: float  # at which it gives positions and takes forces
    force_feedback: bool  # whether the hand feels what `command` says
    buttons: int = 0  # how many it has
    orientation: bool = False  # whether its readings have one
    torque_n_m: float = 0.0  # largest that it displays, more is cut to it; 0 without torque feedback
    watchdog_s: float | None = None
    """After this time the board itself removes the force when its host stops; None if it never does. 0 for a computed
    device, whose force ends with the program."""
    note: str = ""  # what a person should know before a run, for example why there is no force feedback
    push_n: float = 0.0
    """Force against which a full deflection holds a rate-controlled device; 0 for a device that the hand moves. Such a
    device takes `command` as the resistance of its rate, without force feedback too."""


class DeviceReading(NamedTuple):
    """Measured at `at` [s]: position of the handle [m]; `ended` once a script or a recording is over.

    `orientation` is the unit quaternion (w, x, y, z) that turns the frame of the handle into that of the device, None
    where the device has no sensors for it. `buttons` has bit i set while button i is pressed.
    """

    at: float
    position: Vector
    ended: bool = False
    orientation: "Quaternion | None" = None
    buttons: int = 0


class Device(Protocol):
    """A haptic device. `latest` and `command` never block; `open` and `close` end in bounded time.

    `spec` is readable before `open`. Two more attributes are looked for: `trouble`, the error of the last attempt
    where samples are missing, else None; and `guarded`, whether a guardian process takes the force off when this
    process stops, known before `open`.
    """

    @property
    def spec(self) -> DeviceSpec: ...

    def open(self, now: float) -> None: ...

    def latest(self, now: float) -> DeviceReading:
        """The newest reading; the same one for the same `now`. Raises DeviceFault if the device is not open, or cannot
        go on.
        """
        ...

    def command(self, force: Vector, now: float) -> None:
        """The force to display on the operator's hand [N]; holds until the next command. No effect unless open. Raises
        ValueError if the force is not finite.
        """
        ...

    def close(self) -> None:
        """Leave the force at zero; may be called at any time, any number of times."""
        ...


@runtime_checkable
class TorqueDevice(Device, Protocol):
    """A haptic device that displays torque. `spec.torque_n_m` is the limit; with 0, `turn` must not be called.

    `turn` never blocks, has no effect outside of `open` and `close`, and raises ValueError for a torque that is not
    finite. `close` leaves the torque at zero.
    """

    def turn(self, torque: Vector, now: float) -> None:
        """The torque to display on the operator's hand [N m], axes of the device; holds until the next one."""
        ...


def check_finite(name: str, what: str, vector: Vector) -> None:
    """Raise ValueError, which names the driver, for a command that is not finite."""
    if not is_finite(vector):
        raise ValueError(f"{name}: commanded a {what} that is not finite: {vector}")
