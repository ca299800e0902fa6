"""Updates that are lost while heartbeats pass stop both ends, which name it: some of the cases of the trial."""

import pytest

from tests.session.systems import HAS_ARMS
from trials.safety.streams import MASTER, SLAVE, TICKS_MS, Lost, run
from weberlink.protocol.wire import Kind

UPDATE, SECOND, HEARTBEAT = Kind.UPDATE, Kind.SECOND_UPDATE, Kind.HEARTBEAT
CASES: list[tuple[str, Lost]] = [
    ("hand, bounded", ((SLAVE, UPDATE),)),
    ("hand, none", ((MASTER, UPDATE), (SLAVE, UPDATE))),
    ("hand with torque", ((MASTER, SECOND),)),
    ("hand with torque", ((SLAVE, SECOND),)),
    *([("arm", ((SLAVE, UPDATE), (SLAVE, SECOND))), ("arm", ((MASTER, SECOND),))] if HAS_ARMS else []),
]


@pytest.mark.parametrize(("name", "lost"), CASES)
def test_a_lost_stream_stops_both_ends_and_is_named(name: str, lost: Lost) -> None:
    found = run(name, lost)
    assert found.stopped_ms <= found.limit_ms + TICKS_MS
    assert found.unfelt_ms <= found.limit_ms
    name = "undelivered_second" if {kind for _, kind in lost} == {SECOND} else "undelivered"
    assert found.faults == ((name,), (name,))
    assert found.is_back


def test_sessions_that_begin_again_give_no_more_motion() -> None:
    """Only handshakes pass to the master, so that it calls again and again."""
    found = run("hand, none", ((SLAVE, UPDATE), (SLAVE, HEARTBEAT)))
    assert found.stopped_ms <= found.limit_ms + TICKS_MS
    assert found.faults[0] == ("silence",) and found.is_back


@pytest.mark.parametrize(
    ("name", "lost"),
    [("hand, bounded", ((SLAVE, HEARTBEAT),)), ("hand with torque", ((MASTER, SECOND), (SLAVE, HEARTBEAT)))],
)
def test_a_robot_that_comes_back_into_a_contact_is_felt(name: str, lost: Lost) -> None:
    """Without its heartbeats a robot at rest is unheard again and again, and approaches anew."""
    found = run(name, lost)
    assert found.alone_ms <= 12 and found.is_back
    assert "silence" in found.faults[0] and "unheard" in found.faults[1]


def test_heartbeats_of_one_end_are_not_needed_where_its_updates_pass() -> None:
    found = run("hand, none", ((MASTER, HEARTBEAT),))
    assert (found.stopped_ms, found.is_back) == (float("inf"), True)
