"""Control schemes for arms that are led joint by joint: `none`, and `tdpa` with one energy tank for all joints.

The ports of the passivity approach work on three axes in metres and newtons. Joints come to them in parts of three, by
a lever r: x = r q, F = tau / r. Work does not depend on the lever, so all ports of an end share one tank, and what one
joint gains pays for another. Each of P ports may spend 1/P of the tank in a tick, so that together they spend no more
than one port would.

Sources are those of `weberlink.control.tdpa`.
"""

from dataclasses import dataclass
from math import hypot, inf
from typing import ClassVar

from weberlink.control.contract import LEAST_CONTACT, JointMaster, JointSlave, LinkQuality
from weberlink.control.energy import CreditPrediction, EnergyTank, LevelDrag
from weberlink.control.force_port import ForcePort
from weberlink.control.motion_port import MotionPort
from weberlink.control.tdpa import FIRST_DEBT, PREDICTED, SHARE_AT_MASTER, CatchUp, book_hand, book_robot
from weberlink.geometry.joints import Joints, joined, parts
from weberlink.geometry.vector import Vector

LEVER = 0.2
"""Distance from the joints of a desktop arm to the hand that leads it, roughly [m]."""
STIFFEST = 1e5
"""A follower whose position control is ideal counts as this stiff at the lever [N/m]."""


@dataclass(frozen=True)
class JointParameters:
    """Parameters of both ends of a scheme for joints. All tuples have one entry for each axis.

    Args:
        tick_period: tick period of both sides [s].
        torque_range: largest torque that the follower reports [N m], >= 0; infinite where that is unknown.
        level: energy at which a tank counts as full [J].
        damping: damping of the drag that fills an empty tank, at the lever [N s/m].
        catch_up_rad_s: speed at which the follower reduces its distance to the leader, added to the leader's own
            motion [rad/s].
        coupling: stiffness of the follower towards its command [N m/rad], >= 0; infinite for an ideal one. The
            leader's end does not read it.
        lever: distance from a joint at which forces and speeds are those of a hand [m].

    Raises:
        ValueError: for no axes, tuples of different lengths, or a number out of its range.
    """

    tick_period: float
    torque_range: Joints
    level: float
    damping: float
    catch_up_rad_s: float
    coupling: Joints
    lever: float = LEVER

    def __post_init__(self) -> None:
        if not self.coupling or len(self.coupling) != len(self.torque_range):
            raise ValueError(f"coupling has {len(self.coupling)} axes, torque_range {len(self.torque_range)}")
        for name in ("torque_range", "coupling"):
            values: Joints = getattr(self, name)
            if not all(value >= 0.0 for value in values):
                raise ValueError(f"{name} must be >= 0, not {values!r}")
        for name in ("tick_period", "level", "damping", "catch_up_rad_s", "lever"):
            value: float = getattr(self, name)
            if not 0.0 < value < inf:
                raise ValueError(f"{name} must be above 0 and finite, not {value!r}")

    @property
    def count(self) -> int:
        """Number of axes."""
        return len(self.coupling)


class _Uncontrolled:
    """One end without control."""

    __slots__ = ()

    active: ClassVar[str] = "none"
    tank: ClassVar[float] = 0.0
    credit: ClassVar[int] = 0

    def reset(self) -> None: ...

    def resume(self, peer_credit: int) -> None: ...


class DirectJointMaster(_Uncontrolled):
    """Displays the decoded torques."""

    __slots__ = ()

    def __init__(self, settings: JointParameters) -> None: ...

    def observe(
        self, position: Joints, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality
    ) -> None: ...

    def command(self, position: Joints) -> Joints:
        return position

    def render(self, torque: Joints) -> Joints:
        return torque

    def displayed(self, torque: Joints) -> None: ...


class DirectJointSlave(_Uncontrolled):
    """Follows the decoded angles."""

    __slots__ = ()

    def __init__(self, settings: JointParameters) -> None: ...

    def follow(self, target: Joints, here: Joints, elapsed: float, peer_credit: int, quality: LinkQuality) -> Joints:  # noqa: ARG002
        return target

    def observe(self, position: Joints, torque: Joints) -> None: ...


class _TankedJoints:
    """One end of `tdpa`: the ports of its parts, and their tank."""

    __slots__ = ("_count", "_lever", "_share", "_tank")

    active: ClassVar[str] = "tdpa"

    def __init__(self, settings: JointParameters) -> None:
        self._tank = EnergyTank()
        self._count = settings.count
        self._lever = settings.lever
        self._share = 1.0 / len(parts(settings.coupling))

    @property
    def tank(self) -> float:
        return self._tank.level

    @property
    def credit(self) -> int:
        return self._tank.credit

    def _places(self, angles: Joints) -> list[Vector]:
        """The displacements at the lever [m]."""
        lever = self._lever
        return parts(tuple([lever * angle for angle in angles]))

    def _forces(self, torques: Joints) -> list[Vector]:
        """The forces at the lever [N]."""
        lever = self._lever
        return parts(tuple([torque / lever for torque in torques]))


class TdpaJointMaster(_TankedJoints):
    """Observer and controller of the leader's joints."""

    __slots__ = ("_drag", "_elapsed", "_in_contact", "_level", "_ports")

    def __init__(self, settings: JointParameters) -> None:
        super().__init__(settings)
        self._level = SHARE_AT_MASTER * settings.level
        share = self._share * self._level
        self._ports = [ForcePort(settings.tick_period, share) for _ in parts(settings.coupling)]
        self._drag = LevelDrag(settings.damping, share)
        self._elapsed = 0.0
        self._in_contact = False

    def reset(self) -> None:
        self._tank.reset()
        self._forget()

    def resume(self, peer_credit: int) -> None:
        self._tank.renounce(peer_credit)
        self._forget()

    def _forget(self) -> None:
        for port in self._ports:
            port.reset()
        self._in_contact = False

    def observe(self, position: Joints, elapsed: float, tick: float, peer_credit: int, quality: LinkQuality) -> None:  # noqa: ARG002
        work = 0.0
        for port, place in zip(self._ports, self._places(position), strict=True):
            work += port.move(place)
        book_hand(self._tank, work, self._level, peer_credit, elapsed, in_contact=self._in_contact)
        self._elapsed = elapsed

    def command(self, position: Joints) -> Joints:
        return position

    def render(self, torque: Joints) -> Joints:
        elapsed, lever = self._elapsed, self._lever
        energy = self._share * self._tank.level
        self._in_contact = False
        rendered: list[Vector] = []
        for port, force in zip(self._ports, self._forces(torque), strict=True):
            self._in_contact |= hypot(force[0], force[1], force[2]) > LEAST_CONTACT
            passive = port.passive(force, energy, elapsed)
            x, y, z = port.secured(self._drag.added(passive, port.way, elapsed, energy, port.mobility), energy)
            rendered.append((lever * x, lever * y, lever * z))
        return joined(rendered, self._count)

    def displayed(self, torque: Joints) -> None:
        for port, force in zip(self._ports, self._forces(torque), strict=True):
            port.hold(force)


class TdpaJointSlave(_TankedJoints):
    """Observer and controller of the follower's joints."""

    __slots__ = ("_catch_ups", "_elapsed", "_level", "_ports", "_prediction")

    def __init__(self, settings: JointParameters) -> None:
        super().__init__(settings)
        self._level = settings.level
        lever, debt = settings.lever, self._share * FIRST_DEBT * settings.level
        self._ports = [
            MotionPort(hypot(*ranges) / lever, min(STIFFEST, max(stiffness) / (lever * lever)), debt)
            for ranges, stiffness in zip(parts(settings.torque_range), parts(settings.coupling), strict=True)
        ]
        self._catch_ups = [CatchUp(settings.catch_up_rad_s * lever) for _ in self._ports]
        self._prediction = CreditPrediction(PREDICTED * settings.level)
        self._elapsed = 0.0

    def reset(self) -> None:
        self._tank.reset()
        self._prediction.reset()
        for port in self._ports:
            port.renew()
        self._forget()

    def resume(self, peer_credit: int) -> None:
        self._tank.renounce(peer_credit)
        self._prediction.reset(peer_credit)
        self._forget()

    def _forget(self) -> None:
        for port in self._ports:
            port.reset()
        for catch_up in self._catch_ups:
            catch_up.reset()

    def follow(self, target: Joints, here: Joints, elapsed: float, peer_credit: int, quality: LinkQuality) -> Joints:  # noqa: ARG002
        self._elapsed = elapsed
        self._tank.receive(peer_credit)
        energy = self._share * (self._tank.level + self._prediction.ahead(peer_credit, elapsed))
        lever = self._lever
        followed: list[Vector] = []
        pairs = zip(self._places(target), self._places(here), strict=True)
        for port, catch_up, (goal, start) in zip(self._ports, self._catch_ups, pairs, strict=True):
            ahead = catch_up.goal(goal, start, elapsed, waits=energy <= 0.0 and port.touches)
            x, y, z = port.affordable(ahead, start, energy)
            followed.append((x / lever, y / lever, z / lever))
        return joined(followed, self._count)

    def observe(self, position: Joints, torque: Joints) -> None:
        work, taken, touches = 0.0, 0.0, False
        for port, place, force in zip(self._ports, self._places(position), self._forces(torque), strict=True):
            work += port.book(place, force)
            taken += port.taken
            touches |= port.touches
        book_robot(self._tank, work, self._level, taken if touches else None, self._elapsed)


JOINT_SCHEMES = ("none", "tdpa")
"""Schemes that lead joints; the others read Cartesian positions."""


def build_joint_master(scheme: str, parameters: JointParameters) -> JointMaster:
    """The leader's end of a scheme.

    Raises:
        ValueError: for a scheme that does not lead joints.
    """
    _check(scheme)
    return DirectJointMaster(parameters) if scheme == "none" else TdpaJointMaster(parameters)


def build_joint_slave(scheme: str, parameters: JointParameters) -> JointSlave:
    """The follower's end of a scheme; raises as `build_joint_master`."""
    _check(scheme)
    return DirectJointSlave(parameters) if scheme == "none" else TdpaJointSlave(parameters)


def _check(scheme: str) -> None:
    if scheme not in JOINT_SCHEMES:
        raise ValueError(f"control.scheme {scheme!r} does not lead joints; use {' or '.join(JOINT_SCHEMES)}")
