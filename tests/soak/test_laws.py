"""Each law holds for telemetry of a healthy session, and is broken by made-up telemetry of a sick one."""

import numpy as np
import pytest

from tests.soak import laws
from tests.soak.processes import Footprint
from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records
from weberlink.telemetry.reader import DTYPE

PERIOD = 0.001


def healthy(count: int = 50, *, state: State = State.ENGAGED) -> Records:
    records = np.zeros(count, DTYPE)
    records["tick"] = np.arange(count)
    records["at"] = 100.0 + np.arange(count) * PERIOD
    records["state"] = state.value
    records["datagrams_sent"] = np.arange(count) // 20
    return records


def test_force_rests_without_a_session() -> None:
    records = healthy()
    records["output"][:, 2] = 1.5
    assert laws.force_rests(records) == []
    records["state"][10:] = State.SILENT.value
    records["output"][12:] = 0.0
    (told,) = laws.force_rests(records)
    assert "1.5 N without a session, in 2 ticks from tick 10 on, state SILENT" in told


@pytest.mark.parametrize("name", laws.COUNTERS)
def test_counters_grow(name: str) -> None:
    records = healthy()
    records[name] = np.arange(50)
    assert laws.counters_grow(records) == []
    records[name][30:] = 7
    assert laws.counters_grow(records) == [f"{name} fell from 29 to 7"]


def test_deadlines_hold() -> None:
    records = healthy()
    gaps = np.delete(records, [5, 6, 20])  # missed ticks are no fault here
    assert laws.deadlines_hold(gaps, PERIOD) == []
    stepped = records.copy()
    stepped["at"][25:] += 3600.0
    assert laws.deadlines_hold(stepped, PERIOD) == ["a deadline is 3600000.000 ms off the grid"]
    back = records.copy()
    back["tick"][25:] = 3
    assert laws.deadlines_hold(back, PERIOD) == ["the number of the tick fell"]


def test_stays() -> None:
    master, slave = healthy(), healthy()
    assert laws.stays({"master": master, "slave": slave}) == []
    slave["state"][7:9] = State.SILENT.value
    assert laws.stays({"master": master, "slave": slave}) == ["the slave left the session for 2 ticks (SILENT)"]


def stale(released: int = 5) -> Records:
    records = healthy(state=State.SILENT)
    records["position"] = records["output"] = (0.01, 0.0, -0.02)
    records["datagrams_dropped"][20:] = released
    return records


def test_nothing_stale() -> None:
    assert laws.nothing_stale(stale(), 5) == []
    assert laws.nothing_stale(stale(), 6) == ["6 stale datagrams were delivered, and only 5 counted as dropped"]
    assert laws.nothing_stale(stale(), 0) == ["nothing stale could be delivered, so nothing was shown"]


def test_a_robot_that_follows_what_is_stale_is_seen() -> None:
    for name in ("position", "output"):
        records = stale()
        records[name][30:, 1] += 0.002
        assert laws.nothing_stale(records, 5) == [f"{name} moved by 2 mm while all that arrived was stale"]
    applied = stale()
    applied["received"][22] = 1
    applied["updates_received"][22:] = 1
    assert laws.nothing_stale(applied, 5) == ["1 stale updates were applied"]
    returned = stale()
    returned["state"][22:] = State.ENGAGED.value
    assert laws.nothing_stale(returned, 5) == ["stale datagrams brought the session back"]


def test_holds_no_more() -> None:
    first = Footprint(1, 1, 1, 10, 2)
    assert laws.holds_no_more(first, Footprint(9, 9, 9, 12, 2)) == []
    assert laws.holds_no_more(first, Footprint(1, 1, 1, 13, 3)) == [
        "descriptors rose from 10 to 13",
        "threads rose from 2 to 3",
    ]


def test_a_stall_of_the_machine_is_measured() -> None:
    records = healthy()
    assert laws.longest_gap(records, PERIOD) == pytest.approx(0.0)
    assert laws.longest_gap(np.delete(records, slice(10, 30)), PERIOD) == pytest.approx(0.02)
    late = healthy()
    late["lateness_us"][20:] = 5000.0
    assert laws.longest_gap(late, PERIOD) == pytest.approx(0.005)


def test_motion_or_silence_after_the_limit_is_found() -> None:
    master, slave = healthy(state=State.SILENT), healthy(state=State.SILENT)
    since = float(master["at"][10])
    for records in (master, slave):
        records["fault"] = 1
        records["state"][:8], records["output"][:8, 2] = State.ENGAGED.value, 3.0
    assert laws.rests({"master": master, "slave": slave}, since) == []
    master["output"][20, 2], slave["output"][30:, 0] = 1.5, 0.004
    slave["fault"] = 0
    slave["state"][20:25] = State.ENGAGED.value
    assert laws.rests({"master": master, "slave": slave}, since) == [
        "1.5 N were on the hand after the limit",
        "the slave was still in the session 0.01 s after it",
        "the slave named no fault",
        "the robot went on by 4 mm after the limit",
    ]
    assert laws.rests({"slave": slave}, since + 9.0) == ["the slave wrote nothing once the limit was over"]


def test_session_of_one_side_alone_is_found() -> None:
    master, slave = healthy(), healthy()
    assert laws.engaged_alone({"master": master, "slave": slave}, 0.01) == []
    slave["state"][5:] = State.SILENT.value
    (told,) = laws.engaged_alone({"master": master, "slave": slave}, 0.01)
    assert told == "the master was in a session for 0.02 s while the slave was not"
    assert laws.engaged_alone({"master": master, "slave": slave}, 0.03) == []
    (told,) = laws.engaged_alone({"master": master, "slave": slave[:5]}, 0.01)  # it does not tick
    assert "the master was in a session for 0.02 s" in told


def woken(side: str) -> Records:
    """After a gap of a second the force rises evenly to 1 N, or the robot goes 1 mm."""
    records = healthy(state=State.SILENT)
    records["at"][20:] += 1.0
    records["fault"][20:] = 1
    rise = 1.0 if side == "master" else 0.001
    records["output"][20:, 0] = np.linspace(0.0, rise, 30)
    return records


@pytest.mark.parametrize(("side", "most"), [("master", 4.0), ("slave", 0.004)])
def test_a_side_that_stood_still_goes_on_gently(side: str, most: float) -> None:
    records = woken(side)
    assert laws.wakes_gently(records, side, most=most) == []
    records["output"][20] = (3.1, 0.0, 0.0) if side == "master" else (0.0567, 0.0, 0.0)
    records["fault"] = 0
    fault, jump = laws.wakes_gently(records, side, most=most)
    assert fault == f"the {side} stood still, and named no fault"
    assert jump.startswith(f"the {side} went on with {'3.1 N' if side == 'master' else '56.7 mm'} after 0 ms")
