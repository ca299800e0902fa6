"""What a program with a loop of its own reads of a live session."""

from collections.abc import Iterator
from pathlib import Path
from time import monotonic

import pytest

from plugins.arms.tests.arm_rings import ArmRings, arm_rings
from weberlink.watching.rings import NoSessionError
from weberlink_arms.live_ends import find_end


@pytest.fixture
def rings(tmp_path: Path) -> Iterator[ArmRings]:
    with arm_rings(tmp_path) as made:
        yield made


def expected(place: int, tick: int) -> list[float]:
    return [0.125 * place + (1 + axis) / 128 + tick / 1024 for axis in (0, 1, 8)]


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
