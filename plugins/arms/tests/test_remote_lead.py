"""A program reads a live session in a loop of its own, and leads a `remote_leader`, alone, in the units of LeRobot."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from math import degrees, inf, nan, radians
from pathlib import Path
from time import monotonic
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import strategies as st

from plugins.arms.tests.arm_rings import REMOTE, SYSTEM, ArmRings, arm_rings
from weberlink.telemetry.runtime_directory import ForeignFileError
from weberlink.testing.messages import Message, MessageContract
from weberlink_arms.live_ends import find_end
from weberlink_arms.remote_lead import AxisUnits, LeaderSender, NotRemoteError, RemoteLead, TargetInUseError
from weberlink_arms.remote_leader import LeaderTarget, pack_angles, unpack_angles
from weberlink_figures.watching.rings import NoSessionError
from weberlink_pointer.target_link import LEADER, TargetSocket, link_path

HERE = (0.1, -0.2, 0.3)
ME = os.getpid()
ANGLES = st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3)


class TestAngles(MessageContract):
    MESSAGES: ClassVar = {
        "remote leader": Message(
            st.builds(LeaderTarget, ANGLES, st.booleans(), st.integers(0, 2**64 - 1)),
            lambda target: pack_angles(*target),
            lambda data: unpack_angles(data, 3),
            refused=(b"WLA1" + pack_angles(HERE, True, 1)[4:], pack_angles((*HERE, 0.0), True, 1)),
            unsendable=(((nan, 0.0, 0.0), True, 1), ((0.0, inf, 0.0), True, 1)),
        )
    }


@pytest.fixture
def rings(tmp_path: Path) -> Iterator[ArmRings]:
    with arm_rings(tmp_path) as made:
        yield made


def expected(place: int, tick: int) -> list[float]:
    return [0.125 * place + (1 + axis) / 128 + tick / 1024 for axis in range(3)]


@pytest.mark.parametrize(("side", "position", "command", "effort"), [("master", 0, 1, 3), ("slave", 0, 3, 1)])
def test_sample_has_each_axis_the_gripper_last_and_the_newest_ticks_in_order(
    tmp_path: Path, rings: ArmRings, side: str, position: int, command: int, effort: int
) -> None:
    end = find_end(side, ticks=4, where=tmp_path)
    assert (end.names, end.is_arm, end.has_gripper) == (("pan", "lift", "gripper"), True, True)
    steps = ((range(2), [0, 0, 0, 1]), (range(2, 5), [1, 2, 3, 4]), (range(5, 41), [37, 38, 39, 40]))
    for ticks, window in steps:
        for tick in ticks:
            rings.write(tick)
        sample = end.sample()
        assert sample.efforts.tolist() == [expected(effort, tick) for tick in window]
    assert sample.position.tolist() == expected(position, 40) == end.sample().position.tolist()
    assert (sample.command.tolist(), sample.effort.tolist()) == (expected(command, 40), expected(effort, 40))
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
        with pytest.raises(NoSessionError, match=r"2 sessions have a master on this host; .* one of 77, 78"):
            find_end("master", where=tmp_path)
        find_end("master", "78", where=tmp_path).close()
    rings.end("master")
    with pytest.raises(NoSessionError, match="no master runs on this host"):
        find_end("master", where=tmp_path)


# --- leading


@pytest.fixture
def leader() -> Iterator[Any]:
    source = TargetSocket(LEADER, partial(unpack_angles, axes=3))
    source.open()
    yield source
    source.close()


def units(folder: Path, use_degrees: bool = True) -> AxisUnits:
    end = find_end("slave", where=folder)
    try:
        return AxisUnits(end, use_degrees=use_degrees)
    finally:
        end.close()


@pytest.mark.parametrize(
    ("use_degrees", "angles", "shown"),
    [
        (True, (0.5, -1.0, 0.125), (degrees(0.5), degrees(-1.0), 25.0)),
        (False, (0.5, -1.0, 0.125), (50.0, -50.0, 25.0)),
        (False, (7.0, -7.0, -7.0), (100.0, -100.0, 0.0)),
    ],
)
def test_names_and_units_are_those_of_lerobot(
    tmp_path: Path, rings: ArmRings, use_degrees: bool, angles: tuple[float, ...], shown: tuple[float, ...]
) -> None:
    axes = units(tmp_path, use_degrees)
    features = dict(zip(("pan.pos", "lift.pos", "gripper.pos"), shown, strict=True))
    assert axes.features(np.array(angles)) == pytest.approx(features)
    assert abs(angles[0]) > 1.0 or axes.values(features) == pytest.approx(angles)
    assert axes.window_names(1) == ["pan.torque.0", "lift.torque.0", "gripper.torque.0"]
    with pytest.raises(ValueError, match=r"the action lacks lift\.pos, gripper\.pos; it has pan\.pos"):
        axes.values({"pan.pos": 0.0})


def test_unknown_range_is_needed_for_shares_only(tmp_path: Path) -> None:
    codec = {"joints": {"names": ("pan", "lift")}, "gripper": None}
    with arm_rings(tmp_path, system=SYSTEM | {"codec": codec}, ranges={}):
        assert units(tmp_path).features(np.array([1.0, 0.0])) == {"pan.pos": degrees(1.0), "lift.pos": 0.0}
        with pytest.raises(ValueError, match="does not tell the range of pan"):
            units(tmp_path, use_degrees=False)


def test_cartesian_session_is_in_metres(tmp_path: Path) -> None:
    with arm_rings(tmp_path, system={"codec": {}}) as rings:
        rings.write(1)
        axes, end = units(tmp_path), find_end("master", where=tmp_path)
        sample = end.sample()
        position, force = ([place + (1 + i) / 128 + 1 / 1024 for i in range(3)] for place in (0.0, 0.375))
        assert axes.features(sample.position) == dict(zip(("x.pos", "y.pos", "z.pos"), position, strict=True))
        assert (axes.efforts, sample.effort.tolist()) == (["x.force", "y.force", "z.force"], force)
        end.close()


def test_lead_writes_angles_within_the_leaders_limits(tmp_path: Path, rings: ArmRings) -> None:
    memory = TargetSocket(LEADER, partial(unpack_angles, axes=3))  # of this process, whose rings these are
    memory.open()
    lead = RemoteLead(where=tmp_path)
    assert lead.send((radians(20.0), -3.0, 0.25)).tolist() == [radians(20.0), -1.0, 0.25]
    assert (memory.newest() or ())[:2] == ((radians(20.0), -1.0, 0.25), True)
    with pytest.raises(ValueError, match="expected 3 angles, not 2"):
        lead.send((0.0, 0.0))
    lead.close()
    newest = memory.newest()
    assert newest is not None and not newest.leads
    memory.close()


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


def test_angles_are_read_once_and_who_leaves_lets_go(leader: Any) -> None:
    assert leader.newest() is None
    with LeaderSender(ME) as sender:
        sender.send((9.0, 9.0, 9.0))
        sender.send(HERE)
        assert leader.newest()[:2] == (HERE, True)
        assert leader.newest() is None
        for angles in ((0.0, nan, 0.0), (inf, 0.0, 0.0)):
            with pytest.raises(ValueError, match="expected finite angles"):
                sender.send(angles)
        sender.send(HERE[:2])
        assert leader.newest() is None, "of another number of axes"
        sender.send(HERE)
    assert leader.newest()[:2] == (HERE, False)


PROGRAM = """
import sys, time
from weberlink_arms.remote_lead import LeaderSender
sender = LeaderSender(int(sys.argv[1]))
print("x", flush=True)
time.sleep(60)
"""


def test_one_program_leads_at_a_time_until_it_ends_or_is_killed(leader: Any) -> None:
    first = LeaderSender(ME)
    with pytest.raises(TargetInUseError, match="another process leads this arm already"):
        LeaderSender(ME)
    first.close()
    first.close()
    child = subprocess.Popen([sys.executable, "-c", PROGRAM, str(ME)], stdout=subprocess.PIPE)
    assert child.stdout is not None
    assert child.stdout.read(1) == b"x"
    with pytest.raises(TargetInUseError):
        LeaderSender(ME)
    child.kill()
    child.communicate()
    with LeaderSender(ME) as sender:
        sender.send((1.0, 1.0, 1.0))
        assert leader.newest().leads


def test_who_led_an_arm_that_has_ended_does_not_lead_the_next_and_a_file_in_its_place_is_refused(leader: Any) -> None:
    with LeaderSender(ME) as sender:
        leader.close()
        assert not any(link_path(ME, kind).exists() for kind in (LEADER, f"{LEADER}.lock"))
        sender.send(HERE)
        leader.open()
        sender.send(HERE)
        assert leader.newest() is None
    leader.close()
    with pytest.raises(FileNotFoundError):
        LeaderSender(ME)
    path = link_path(ME, LEADER)
    path.write_bytes(b"")
    with pytest.raises(ForeignFileError):
        LeaderSender(ME)
    path.unlink()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as killed:
        killed.bind(str(path))
    with pytest.raises(FileNotFoundError):
        LeaderSender(ME)
    path.unlink()
