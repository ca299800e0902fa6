"""What a program with a loop of its own reads of a live session, and how LeRobot names and scales it."""

from collections.abc import Iterator
from math import degrees, radians
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pytest

from tests.apps.arm_rings import REMOTE, SYSTEM, ArmRings, arm_rings
from weberlink.apps.axis_units import AxisUnits
from weberlink.apps.live_ends import NoSessionError, find_end
from weberlink.apps.remote_lead import NotRemoteError, RemoteLead
from weberlink.master.devices.remote_link import TargetMemory


@pytest.fixture
def rings(tmp_path: Path) -> Iterator[ArmRings]:
    with arm_rings(tmp_path) as made:
        yield made


def expected(place: int, tick: int) -> list[float]:
    return [0.125 * place + (1 + axis) / 128 + tick / 1024 for axis in (0, 1, 8)]


@pytest.mark.parametrize(("side", "position", "command", "effort"), [("master", 0, 1, 3), ("slave", 0, 3, 1)])
def test_sample_has_each_axis_and_the_gripper_last(
    tmp_path: Path, rings: ArmRings, side: str, position: int, command: int, effort: int
) -> None:
    end = find_end(side, where=tmp_path)
    assert (end.names, end.is_arm, end.has_gripper) == (("pan", "lift", "gripper"), True, True)
    rings.write(1)
    rings.write(2)
    sample = end.sample()
    assert sample.position.tolist() == expected(position, 2)
    assert sample.command.tolist() == expected(command, 2)
    assert sample.effort.tolist() == expected(effort, 2)
    assert end.sample().position.tolist() == expected(position, 2), "the newest, also where there is no newer one"
    end.close()


def test_window_holds_the_newest_ticks_in_order(tmp_path: Path, rings: ArmRings) -> None:
    end = find_end("slave", ticks=4, where=tmp_path)
    steps = (
        (range(2), [0, 0, 0, 1]),
        (range(2, 4), [0, 1, 2, 3]),
        (range(4, 5), [1, 2, 3, 4]),
        (range(5, 41), [37, 38, 39, 40]),
    )
    for ticks, window in steps:
        for tick in ticks:
            rings.write(tick)
        assert end.sample().efforts.tolist() == [expected(1, tick) for tick in window]
    end.close()


def test_end_that_has_nothing_new_is_refused(tmp_path: Path, rings: ArmRings) -> None:
    end = find_end("slave", where=tmp_path)
    with pytest.raises(NoSessionError, match="the slave of session 77 has written nothing yet"):
        end.sample()
    rings.write(1, at=monotonic() - 0.7)
    with pytest.raises(NoSessionError, match=r"stands still: no record for 0\.7 s"):
        end.sample()
    rings.write(2)
    assert end.is_alive
    rings.end("slave")
    assert not end.is_alive
    end.close()


def test_session_is_chosen_where_there_are_several(tmp_path: Path, rings: ArmRings) -> None:
    with arm_rings(tmp_path, "78"):
        with pytest.raises(
            NoSessionError, match="2 sessions have a master on this host; choose by session one of 77, 78"
        ):
            find_end("master", where=tmp_path)
        end = find_end("master", "78", where=tmp_path)
        assert end.session == "78"
        end.close()
    rings.end("master")
    with pytest.raises(NoSessionError, match="no master runs on this host"):
        find_end("master", where=tmp_path)


def units(folder: Path, use_degrees: bool = True) -> AxisUnits:
    end = find_end("slave", where=folder)
    try:
        return AxisUnits(end, use_degrees=use_degrees)
    finally:
        end.close()


def test_units_are_those_of_lerobot(tmp_path: Path, rings: ArmRings) -> None:
    angles = np.array([0.5, -1.0, 0.125])
    assert units(tmp_path).features(angles) == pytest.approx(
        {"pan.pos": degrees(0.5), "lift.pos": degrees(-1.0), "gripper.pos": 25.0}
    )
    shares = units(tmp_path, use_degrees=False)
    assert shares.features(angles) == pytest.approx({"pan.pos": 50.0, "lift.pos": -50.0, "gripper.pos": 25.0})
    assert shares.features(np.array([7.0, -7.0, -7.0])) == {"pan.pos": 100.0, "lift.pos": -100.0, "gripper.pos": 0.0}


@pytest.mark.parametrize("use_degrees", [True, False])
def test_action_of_the_features_gives_the_angles(tmp_path: Path, rings: ArmRings, use_degrees: bool) -> None:
    axes, angles = units(tmp_path, use_degrees), (0.3, -0.7, 0.4)
    assert axes.values(axes.features(np.array(angles))) == pytest.approx(angles)
    with pytest.raises(ValueError, match=r"the action lacks lift\.pos, gripper\.pos; it has pan\.pos"):
        axes.values({"pan.pos": 0.0})


def test_joints_in_degrees_need_no_range(tmp_path: Path) -> None:
    codec = {"joints": {"names": ("pan", "lift")}, "gripper": None}
    with arm_rings(tmp_path, system=SYSTEM | {"codec": codec}, ranges={}):
        assert units(tmp_path).features(np.array([1.0, 0.0])) == pytest.approx(
            {"pan.pos": degrees(1.0), "lift.pos": 0.0}
        )
        with pytest.raises(ValueError, match="does not tell the range of pan"):
            units(tmp_path, use_degrees=False)


def test_cartesian_session_is_in_metres(tmp_path: Path) -> None:
    with arm_rings(tmp_path, system={"codec": {}}) as rings:
        rings.write(1)
        axes, end = units(tmp_path), find_end("master", where=tmp_path)
        sample = end.sample()
        assert axes.features(sample.position) == {"x.pos": 0.25, "y.pos": 0.5, "z.pos": 0.75}
        assert dict(zip(axes.efforts, sample.effort, strict=True)) == {"x.force": 1.0, "y.force": 2.0, "z.force": 3.0}
        end.close()


def test_lead_writes_angles_within_the_leaders_limits(tmp_path: Path, rings: ArmRings) -> None:
    memory = TargetMemory()  # of this process, whose rings these are
    memory.open(3)
    lead = RemoteLead(where=tmp_path)
    assert lead.is_alive
    assert lead.send((radians(20.0), -3.0, 0.25)).tolist() == [radians(20.0), -1.0, 0.25]
    newest = memory.newest()
    assert newest is not None
    assert (newest.angles, newest.leads) == ((radians(20.0), -1.0, 0.25), True)
    with pytest.raises(ValueError, match="expected 3 angles, not 2"):
        lead.send((0.0, 0.0))
    lead.close()
    newest = memory.newest()
    assert newest is not None
    assert not newest.leads
    memory.close()
    with pytest.raises(NoSessionError, match="the master of session 77 has ended"):
        RemoteLead(where=tmp_path)


@pytest.mark.parametrize(
    ("master", "complaint"),
    [
        ({"device": {"driver": "koch_leader", "port": "x"}}, "koch_leader leads this session: to look on, observe"),
        ({"device": REMOTE, "joint_mapping": {"scale": 1.0}}, "leave out master.joint_mapping"),
    ],
)
def test_leader_that_is_not_for_programs_is_refused(tmp_path: Path, master: dict[str, Any], complaint: str) -> None:
    with arm_rings(tmp_path, system=SYSTEM | {"master": master}), pytest.raises(NotRemoteError, match=complaint):
        RemoteLead(where=tmp_path)
