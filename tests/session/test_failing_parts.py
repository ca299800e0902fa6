"""Devices and robots that fail, report what cannot be, or whose force outlives their host, in every kind of session."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, nan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.session.kinds import KINDS, TICK, Kind, changed, each_kind, run, says
from tests.session.systems import system
from weberlink.arms.contract import ArmFault
from weberlink.config import ConfigurationError
from weberlink.master.devices.contract import DeviceFault, DeviceSpec
from weberlink.protocol.states import State
from weberlink.session.composition.master import check_force_ends
from weberlink.slave.robots.contract import RobotFault
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import FINITE

AT = 0.5
Change = Callable[[Any], Any]


def unplugged(fault: type[Exception]) -> Change:
    def fail(_: object) -> None:
        raise fault("unplugged")

    return fail


def angles(reading: Any) -> Any:
    return reading._replace(angles=(*reading.angles[:-1], nan))


GRACE_TICKS = 20  # without a usable reading, until a side leaves
DEVICES = [
    ("hand", unplugged(DeviceFault), 0, "unplugged"),
    ("hand", says(position=(nan, 0.0, 0.0)), GRACE_TICKS, "position"),
    ("hand", says(position=(0.0, inf, 0.0)), GRACE_TICKS, "position"),
    ("hand", says(at=AT), GRACE_TICKS, "sample"),
    ("hand", says(at=nan), GRACE_TICKS, "time"),
    ("turning", says(orientation=None), GRACE_TICKS, "orientation"),
    ("turning", says(orientation=(nan, 0.0, 0.0, 0.0)), GRACE_TICKS, "orientation"),
    ("arm", unplugged(ArmFault), 0, "unplugged"),
    ("arm", angles, GRACE_TICKS, "angles"),
]
ROBOTS = [
    ("hand", unplugged(RobotFault), 0, "answer|unplugged"),
    ("hand", says(force=(nan, 0.0, 0.0)), GRACE_TICKS, "force"),
    ("hand", says(position=(0.0, nan, 0.0)), GRACE_TICKS, "position"),
    ("hand", says(position=(0.0, 0.0, -inf)), GRACE_TICKS, "position"),
    ("hand", says(at=nan), GRACE_TICKS, "time"),
    ("turning", says(torque=(nan, 0.0, 0.0)), GRACE_TICKS, "torque"),
    ("turning", says(torque=(0.0, 1e300, 0.0)), GRACE_TICKS, "torque"),
    ("arm", unplugged(ArmFault), 0, "unplugged"),
    ("arm", angles, GRACE_TICKS, "angles"),
]


@pytest.mark.parametrize(
    ("side", "name", "change", "within", "word"),
    [
        (side, *row)
        for side, table in (("master", DEVICES), ("slave", ROBOTS))
        for row in table
        if row[0] in KINDS
    ],
)  # fmt: skip
def test_a_part_that_fails_leaves_with_the_reason_at_both_ends(
    side: str, name: str, change: Change, within: int, word: str
) -> None:
    kind = KINDS[name]
    base, part = (kind.device, "device") if side == "master" else (kind.robot, "robot")
    ran = run(kind, 0.8, after=0.01, **{part: changed(base, change, AT)})
    own, peer = (ran.simulation.master, ran.simulation.slave)[:: 1 if side == "master" else -1]
    assert own.failure is not None and peer.failure is None
    assert own.failure.startswith(f"{part} fault: ") and any(each in own.failure for each in word.split("|"))
    assert peer.peer.farewell and own.failure.startswith(peer.peer.farewell)
    records = ran.master if side == "master" else ran.slave
    left = int(np.argmax(records["fault"] == Fault.DEVICE))
    assert max(0, within - 1) <= left - ran.at(AT) <= within
    for column in FINITE:
        assert np.isfinite(ran.master[column]).all() and np.isfinite(ran.slave[column]).all()
    for channel in kind.channels:
        assert (channel.output(ran.master)[left + 60 :] == 0.0).all()
        assert (channel.output(ran.master)[-1] == 0.0).all()
        assert len(np.unique(channel.output(ran.slave)[left + 5 :], axis=0)) <= 1
    assert (own.faults, peer.endpoint.state is State.ENGAGED) == ({"device": 1}, False)


@each_kind
@pytest.mark.parametrize("part", ["device", "robot"])
def test_a_single_bad_sample_is_passed_over(kind: Kind, part: str) -> None:
    change = angles if kind is KINDS.get("arm") else says(position=(nan, nan, nan))
    base = getattr(kind, part)

    class Glitch(changed(base, change, inf)):  # type: ignore[misc]
        def latest(self, now: float) -> Any:
            reading = super().latest(now)
            return change(reading) if now > AT and round(now / TICK) % 97 == 0 else reading

    ran = run(kind, kind.begin, **{part: Glitch})
    assert ran.simulation.master.faults == ran.simulation.slave.faults == {}
    assert np.isfinite(ran.slave["output"]).all()
    channel = kind.channels[0]
    assert channel.size(channel.output(ran.master)).max() > channel.pressed


@each_kind
def test_a_robot_that_does_not_know_where_it_is_cannot_be_opened(kind: Kind) -> None:
    change = angles if kind is KINDS.get("arm") else says(position=(nan, nan, nan))
    with pytest.raises((RobotFault, ArmFault), match="reports the"):
        run(kind, 0.1, robot=changed(kind.robot, change, 0.0))


@each_kind
@pytest.mark.parametrize("how", ["fails", "emergency"])
def test_a_loop_that_fails_or_is_stopped_at_once_releases_the_hand_and_holds_the_robot(kind: Kind, how: str) -> None:
    """Before the next tick."""
    told: dict[str, Any] = {}

    def noting(base: Any) -> Any:
        class Noting(base):  # type: ignore[misc]
            pass

        for method in ("command", "turn", "point", "display", "follow"):
            if hasattr(base, method):

                def note(self: Any, value: Any, now: float, method: str = method) -> None:
                    told[method if base is kind.device else f"robot {method}"] = value
                    getattr(base, method)(self, value, now)

                setattr(Noting, method, note)
        return Noting

    ran = run(kind, kind.begin, device=noting(kind.device), robot=noting(kind.robot))
    before = dict(told)
    simulation = ran.simulation
    for side in (simulation.master, simulation.slave):
        if how == "fails":
            side.fail(kind.begin, RuntimeError("test"))
            assert side.endpoint.state is State.CLOSED
        else:
            side.emergency(kind.begin)
    for method, value in told.items():
        if method.startswith("robot "):
            assert value == pytest.approx(before[method], abs=1e-6)
        else:
            assert not any(value) and any(before[method])


BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("spec", "guarded", "accepted", "is_refused"),
    [
        ({}, False, None, True),
        ({}, False, "paddle", True),
        ({}, False, "pusher", False),
        ({"watchdog_s": 0.5}, False, None, False),
        ({}, True, None, False),
        ({"force_feedback": False}, False, None, False),
    ],
)
def test_a_driver_ends_its_force_or_is_accepted_by_name(
    spec: dict[str, Any], guarded: bool, accepted: str | None, is_refused: bool
) -> None:
    made = DeviceSpec("pusher", "xyz", 3.0, 500.0, BOX, 1000.0, **{"force_feedback": True} | spec)
    device: Any = SimpleNamespace(spec=made, guarded=guarded)
    if not is_refused:
        check_force_ends(device, "pusher", accepted)
        return
    with pytest.raises(ConfigurationError, match=r"master\.device: .*set master\.accept_no_watchdog: pusher") as caught:
        check_force_ends(device, "pusher", accepted)
    assert "\n" not in str(caught.value)


@each_kind
def test_a_side_with_such_a_driver_is_not_built(kind: Kind) -> None:
    class Unguarded(kind.device):  # type: ignore[misc, name-defined]
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.spec = replace(self.spec, watchdog_s=None)

    with pytest.raises(ConfigurationError, match=r"set master\.accept_no_watchdog"):
        system(*kind.overrides, file=kind.file, device=Unguarded)
