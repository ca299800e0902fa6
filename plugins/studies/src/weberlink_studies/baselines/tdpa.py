"""Time-domain passivity control of a delayed link, as in the literature.

Each end books the energy that goes into the link at its port and the energy that comes out, and tells the other one
the sum of what went in. What comes out at a port must not exceed what the other end is known to have put in:

    W(k) = E_in of the other end, as received - E_out of this one(k) + dissipated(k - 1) >= 0

Where it would, the operator's end (impedance: its output is a force) displays a damper as well, F - alpha v with
alpha = -W / (v^2 T); the robot's end (admittance: its output is a motion) moves slower, v + beta f with
beta = -W / (f^2 T). Delay, loss and jitter only postpone what is told, so both ports together stay passive but for the
work of one tick and for what the largest damper cannot dissipate. Sources:

- Artigas, Ryu, Preusche, Hirzinger, "Network representation and passivity of delayed teleoperation systems", IROS 2011:
  the energies in and out of each port, and the two controllers.
- Hannaford, Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans. Robotics and Automation 18(1), 2002:
  the observer of a held force, and its controller.
- Artigas, Ryu, Preusche, "Position drift compensation in time domain passivity based teleoperation", IROS 2010: as far
  as W allows, the robot returns to where the operator leads it. Without it, every hold is a lasting offset.
"""

from weberlink.control.contract import CREDIT_STEP, MasterControl, SchemeParameters, SlaveControl
from weberlink.geometry.vector import ZERO, Vector, dot, subtract

MOST_DAMPING = 50.0  # largest alpha [N s/m]: a sampled damper reverses the velocity of a mass m from m / T on
STILL = 1e-9  # square of a speed [m^2/s^2], and of a force [N^2], at or below which no controller acts


class PortObserver:
    """The energies at one port [J]; `balance` is W."""

    __slots__ = ("_heard", "_put_in", "balance")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin a session."""
        self._put_in = self.balance = 0.0
        self._heard = 0

    def resume(self, peer_credit: int) -> None:
        """Begin anew within a session: nothing may come out yet, and what was told before counts no more."""
        self.balance = min(0.0, self.balance)
        self._heard = max(self._heard, peer_credit)

    @property
    def credit(self) -> int:
        """What went in so far, in units of `CREDIT_STEP`."""
        return int(self._put_in / CREDIT_STEP)

    def hear(self, peer_credit: int) -> None:
        """Take in what went in at the other end so far, in units of `CREDIT_STEP`."""
        if peer_credit > self._heard:
            self.balance += (peer_credit - self._heard) * CREDIT_STEP
            self._heard = peer_credit

    def book(self, energy: float) -> None:
        """Take in the energy that went into the link at this port in a tick; below 0 it came out."""
        if energy > 0.0:
            self._put_in += energy
        else:
            self.balance += energy


class TdpaMaster(MasterControl):
    """The operator's end, an impedance: the damper acts on the velocity of the last tick."""

    __slots__ = ("_damper", "_held", "_observer", "_position", "_velocity")

    def __init__(self, settings: SchemeParameters) -> None:
        super().__init__(settings)
        self._observer = PortObserver()
        self._forget()

    def _forget(self) -> None:
        self._position: Vector | None = None
        self._held: Vector = ZERO
        self._velocity: Vector = ZERO
        self._damper = 0.0

    def reset(self) -> None:
        super().reset()
        self._observer.reset()
        self._forget()

    def resume(self, peer_credit: int) -> None:
        super().reset()
        self._observer.resume(peer_credit)
        self._forget()

    @property
    def energy(self) -> float:
        return self._observer.balance

    @property
    def credit(self) -> int:
        return self._observer.credit

    def observe(self, position: Vector, elapsed: float, tick: float, peer_credit: int, rtt: float | None) -> None:  # noqa: ARG002
        observer = self._observer
        observer.hear(peer_credit)
        way = subtract(position, self._position or position)
        self._position = position
        observer.book(-dot(self._held, way))
        x, y, z = way
        self._velocity = (x / elapsed, y / elapsed, z / elapsed) if elapsed > 0.0 else ZERO
        square = dot(self._velocity, self._velocity)
        debt = -observer.balance
        self._damper = min(MOST_DAMPING, debt / (square * elapsed)) if debt > 0.0 and square > STILL else 0.0

    def render(self, force: Vector) -> Vector:
        damper, (u, v, w) = self._damper, self._velocity
        return (force[0] - damper * u, force[1] - damper * v, force[2] - damper * w) if damper else force

    def displayed(self, force: Vector) -> None:
        self._held = force


class TdpaSlave(SlaveControl):
    """The robot's end, an admittance: it goes towards the operator's motion as far as its work is paid for."""

    __slots__ = ("_force", "_observer", "_position")

    def __init__(self, settings: SchemeParameters) -> None:  # noqa: ARG002 - as the contract has it
        self._observer = PortObserver()
        self._forget()

    def _forget(self) -> None:
        self._position: Vector | None = None
        self._force: Vector = ZERO

    def reset(self) -> None:
        self._observer.reset()
        self._forget()

    def resume(self, peer_credit: int) -> None:
        self._observer.resume(peer_credit)
        self._forget()

    @property
    def energy(self) -> float:
        return self._observer.balance

    @property
    def credit(self) -> int:
        return self._observer.credit

    def follow(self, target: Vector, here: Vector, elapsed: float, peer_credit: int, rtt: float | None) -> Vector:  # noqa: ARG002
        observer, force = self._observer, self._force
        observer.hear(peer_credit)
        square = dot(force, force)
        cost = -dot(force, subtract(target, here))  # of the way to the target, at the force of the last tick
        lack = cost - max(0.0, observer.balance)
        if cost <= 0.0 or lack <= 0.0 or square <= STILL:
            return target
        back = lack / square  # beta T
        return (target[0] + back * force[0], target[1] + back * force[1], target[2] + back * force[2])

    def observe(self, position: Vector, force: Vector) -> None:
        x, y, z = subtract(position, self._position or position)
        a, b, c = force
        u, v, w = self._force
        self._observer.book(0.5 * ((a + u) * x + (b + v) * y + (c + w) * z))
        self._position, self._force = position, force
