"""The kinds of sessions in virtual time: a hand, a hand that turns, an arm; each presses on something at `begin`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.session.systems import ARMS, HAS_ARMS, system
from weberlink.master.devices.operator import OperatorDevice
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.session.simulation import Simulation, as_array
from weberlink.slave.robots.computed import PointRobot
from weberlink.telemetry import record
from weberlink.telemetry.fault import Fault

TICK = 1e-3
SILENCE, RAMP = 0.1, 0.05  # of the default configuration [s]
STEP = TICK / RAMP  # by which share a fade goes on in a tick
Values = NDArray[Any]
ALL = slice(0, record.MOST_AXES)  # the axes of an arm


@dataclass(frozen=True)
class Channel:
    """One pair of channels: what is felt, and what the robot is commanded."""

    axes: slice  # its places in the vectors of a record
    limit: float  # largest value on the hand [N, or N m]
    approach: float  # speed of the robot towards the hand [m/s, or rad/s]
    correction: float  # what one update may change of the robot's command [m, or rad]
    pressed: float  # what is felt at least before an interruption

    def size(self, values: Values) -> Values:
        """Lengths of vectors; of an arm, its largest axes."""
        if self.axes == ALL:
            return np.abs(values).max(axis=-1)
        return np.linalg.norm(values.astype(float), axis=-1)

    def output(self, records: Values) -> Values:
        return records["output"][..., self.axes]

    def raw(self, records: Values) -> Values:
        return records["raw"][..., self.axes]

    def decoded(self, records: Values) -> Values:
        return records["decoded"][..., self.axes]

    def steps(self, records: Values) -> Values:
        """Size of what changes from tick to tick of what is commanded here."""
        return self.size(np.diff(self.output(records).astype(float), axis=0))


@dataclass(frozen=True)
class Kind:
    """A kind of session."""

    file: str | Path  # that is shipped
    overrides: tuple[str, ...]  # that make it a session in contact at `begin`
    begin: float  # [s]
    channels: tuple[Channel, ...]  # of force and motion
    device: Any  # a computed one, for tests to derive from, and so
    robot: Any


FORCE = Channel(record.FORCE, 10.0, 0.25, 0.5e-3, 1.0)
TORQUE = Channel(record.TORQUE, 0.5, 1.5, 0.01, 0.02)
HAND = Kind("loopback.yaml", (), 0.9, (FORCE,), OperatorDevice, PointRobot)
TURNING = Kind("rotation.yaml", (), 1.4, (FORCE, TORQUE), OperatorDevice, PointRobot)
KINDS = {"hand": HAND, "turning": TURNING}
if HAS_ARMS:
    from weberlink_mujoco.arms.follower import MujocoArm
    from weberlink_mujoco.arms.operator import ArmOperator

    MODEL = ARMS.with_name("arm.xml")
    ARM = Kind(
        ARMS,
        (
            "link={listen: 127.0.0.1:0, slave: 127.0.0.1:0, security: none}",
            "codec={joints: {names: [pan, lift, elbow, pitch, roll]}, gripper: {}}",
            f"master.device={{driver: arm_operator, model: {MODEL}, torque_nm: 0.215, script: [{{motion: move,"
            f" duration_s: 0.5, joints_rad: [0.1, 0.4, 0.3, 0, 0]}}, {{motion: hold, duration_s: 10}}]}}",
            "master.joint_mapping={torque_scale: 0.08, gripper: {follower_rad: [0, 1.7]}}",
            f"slave.robot={{driver: mujoco_arm, model: {MODEL},"
            " objects: [{kind: box, position_m: [0.4, 0, 0.1], size_m: [0.2, 0.6, 0.2]}]}",
        ),
        0.8,
        (Channel(ALL, 2.7, 0.5, 3e-3, 0.2),),
        ArmOperator,
        MujocoArm,
    )
    KINDS["arm"] = ARM

each_kind = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)


@dataclass(frozen=True)
class Run:
    """A session that has run: the records of its sides, one for each tick."""

    simulation: Simulation
    master: Values
    slave: Values

    def at(self, seconds: float) -> int:
        return round(seconds / TICK)


def run(
    kind: Kind,
    seconds: float,
    *overrides: str,
    stop: tuple[str, float, float] | None = None,
    acts: Mapping[float, Callable[[Simulation], object]] | None = None,
    watch: Callable[[Simulation], object] = lambda _: None,
    after: float = 0.0,
    **parts: Any,
) -> Run:
    """Run a session to its end, or for so long [s].

    Args:
        kind: of session.
        seconds: how long at most.
        overrides: of its file.
        stop: the side whose process stands still, over a link of 5 ms each way; when, and how long [s].
        acts: what to do, and when [s].
        watch: is called after each tick.
        after: for how long the slave goes on when the master has left [s].
        parts: `device` and `robot` in place of the drivers.
    """
    built = simulation = system(*kind.overrides, *overrides, file=kind.file, **parts)
    if stop is not None:
        side, begin, lasts = stop
        sides: dict[str, Any] = {"master": built.master, "slave": built.slave}
        sides[side] = StoppedSide(sides[side], begin, begin + lasts)
        links = EmulatedLink[Address](Emulation(delay_s=0.005), lambda: 0.0)
        back = EmulatedLink[Address](Emulation(delay_s=0.005), lambda: 0.0)
        simulation = Simulation(**sides, links=(links, back), tick_period=TICK)
    records = []
    due = {round(at / TICK): act for at, act in (acts or {}).items()}
    left = round(after / TICK)
    for tick in range(round(seconds / TICK)):
        if simulation.master.stopped:
            left -= 1
            if left < 0:
                break
        due.get(tick, lambda _: None)(simulation)
        records.append(simulation.step())
        watch(simulation)
    masters, slaves = (as_array(side) for side in zip(*records, strict=True))
    return Run(built, masters, slaves)


@dataclass(frozen=True)
class Interruption:
    """What interrupts a session for a while."""

    lasts: float  # [s]
    faults: tuple[set[str], set[str]]  # of master and slave, by name
    link: str = ""  # faults of the link, with the place of `begin`
    stops: str = ""  # the side whose process stands still instead
    fades: Fault = Fault.NONE  # the fault that closes the gate of the force; none where it need not close


CUT = "link.emulate={{delay_ms: 2, {}blackouts_s: [[BEGIN, 0.6]]{}}}"
INTERRUPTIONS = {
    "cut both ways": Interruption(0.6, ({"silence"}, {"silence"}), CUT.format("", ""), fades=Fault.SILENCE),
    "cut to the master": Interruption(
        0.6, ({"silence"}, {"unheard"}), CUT.format("to_master: {", "}"), fades=Fault.SILENCE
    ),
    "cut to the slave": Interruption(
        0.6, ({"unheard"}, {"silence"}), CUT.format("to_slave: {", "}"), fades=Fault.UNHEARD
    ),
    "master stopped": Interruption(0.3, ({"stalled", "unheard"}, {"silence"}), stops="master", fades=Fault.DEVICE),
    "master stopped shortly": Interruption(0.03, ({"stalled"}, set()), stops="master", fades=Fault.DEVICE),
    "slave stopped": Interruption(0.3, ({"silence"}, {"stalled", "unheard"}), stops="slave", fades=Fault.SILENCE),
    "slave stopped shortly": Interruption(0.03, (set(), {"stalled"}), stops="slave"),
}


def interrupted(kind: Kind, how: Interruption, *overrides: str, after: float = 0.6, **parts: Any) -> Run:
    seconds = kind.begin + how.lasts + after
    if how.stops:
        return run(kind, seconds, *overrides, stop=(how.stops, kind.begin, how.lasts), **parts)
    return run(kind, seconds, how.link.replace("BEGIN", str(kind.begin)), *overrides, **parts)


def says(**fields: Any) -> Callable[[Any], Any]:
    return lambda reading: reading._replace(**fields)


def changed(base: Any, change: Callable[[Any], Any], since: float, until: float = inf) -> Any:
    """A device or robot that reports something else for a while."""

    class Changed(base):  # type: ignore[misc]
        def latest(self, now: float) -> Any:
            reading = super().latest(now)
            return change(reading) if since <= now < until else reading

    return Changed


class StoppedSide:
    """Either side, and its endpoint, whose process stands still between two moments [s].

    Datagrams wait meanwhile, as in the buffer of a socket, and are read before anything else once it goes on.
    """

    def __init__(self, loop: Any, begin: float, end: float) -> None:
        self._loop, self._begin, self._end = loop, begin, end
        self._waiting: list[tuple[bytes, Address]] = []
        self.endpoint = self

    def __getattr__(self, name: str) -> Any:
        return getattr(self._loop, name)

    def _runs(self, now: float) -> bool:
        if self._begin <= now < self._end:
            return False
        for waiting in self._waiting:
            self._loop.endpoint.receive_datagram(*waiting, now)
        self._waiting.clear()
        return True

    def receive_datagram(self, data: bytes, address: Address, now: float) -> None:
        self._waiting.append((data, address))
        self._runs(now)

    def handle_timer(self, now: float) -> None:
        if self._runs(now):
            self._loop.endpoint.handle_timer(now)

    def tick(self, index: int, deadline: float, now: float) -> None:
        if self._runs(now):
            self._loop.tick(index, deadline, now)

    def datagrams_to_send(self) -> list[tuple[bytes, Address]]:
        told: list[tuple[bytes, Address]] = self._loop.endpoint.datagrams_to_send()
        return told
