"""What who watches is told: figures, faults, events and end of a session, the felt error, rates, and the scene."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from plugins.figures.tests.sources import BANK, RATE, WALL_OFFSET_S, HandSource, description, pieces, records, watched
from tests.examples import examples
from tests.session.systems import CONFIGS
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink_figures.session import Layout, SessionScore, TickPairs
from weberlink_figures.tree import to_json
from weberlink_figures.watching.rows import Pace, felt_message
from weberlink_figures.watching.scene import drawn
from weberlink_figures.watching.session import WatchedSession


def both() -> tuple[HandSource, HandSource, WatchedSession]:
    slave, master = HandSource("slave"), HandSource("master")
    session = WatchedSession("7", slave)
    session.admit(master)
    return master, slave, session


def test_figures_equal_those_of_the_launcher() -> None:
    master, slave, session = both()
    ours, theirs = records(3000, seed=1), records(3000, phase=3e-4, seed=2)
    launcher = SessionScore(Layout.hand(RATE, BANK))
    launcher.add(ours, theirs)
    for one, other in zip(pieces(ours, [100, 900, 1700]), pieces(theirs, [40, 950, 2900]), strict=True):
        master.put(one)
        slave.put(other)
        session.look()
    told, expected = session.score.figures().to_json(), launcher.figures().to_json()
    assert told["ticks"] == expected["ticks"]
    for channel in ("force", "position"):
        for name, value in expected[channel].items():
            if isinstance(value, float):
                assert told[channel][name] == pytest.approx(value, rel=1e-12), name
    assert told["force"]["selected"] == expected["force"]["selected"]


def test_faults_are_counted_at_their_beginning_and_are_events_with_times() -> None:
    made = records(5000)
    made["fault"][1200:3450] = Fault.SILENCE
    made["fault"][3450:3500] = Fault.DEVICE
    made["fault"][4900:] = Fault.SILENCE
    session = watched(*pieces(made, [10, 1300, 3460, 4950]))
    assert session.faults == {"slave": {"silence": 2, "device": 1}}
    assert session.faults_now == {"slave": "silence"}
    assert session.alarms()[0].name == "slave_silence"
    shown = [(event.at, event.level, event.side) for event in session.log.events if event.level != "info"]
    assert shown == [(at, "alarm", "slave") for at in (1.2, 4.9)]  # what lasts for 50 ms is not told beside its second
    began = next(event for event in session.log.events if event.level == "alarm")
    assert began.wall == pytest.approx(WALL_OFFSET_S + 11.2, abs=1e-3)
    assert [event.at for event in session.log.events if "over after 2.25 s" in event.text] == [3.45]


@pytest.mark.parametrize(("in_order", "level"), [(True, "info"), (False, "alarm")])
def test_session_ends_with_its_last_side(in_order: bool, level: str) -> None:
    master, slave, session = both()
    assert session.seen_from_start
    master.end(in_order=True)
    session.look()
    assert not session.ended
    made = records(1500)
    made["state"][1400:] = State.SILENT.value
    slave.put(made)
    slave.end(in_order=in_order)
    slave.lost = 3
    session.look()
    session.look()
    *_, change, end = session.log.events
    assert (change.at, change.level, end.level, end.side) == (1.4, "warn", level, "slave")
    assert (session.ended, session.seen_from_start) == (True, False)
    session.close()
    assert master.is_closed
    assert slave.is_closed


HAND = Layout.hand(RATE, BANK)


@pytest.mark.parametrize(
    "name", sorted(path.name for path in CONFIGS.glob("*.yaml") if "key_file" not in path.read_text())
)
def test_every_shipped_scene_can_be_drawn(name: str) -> None:
    scene = drawn(description("slave", name)["system"]["slave"]["scene"])
    json.dumps(scene, allow_nan=False)
    for shape in scene:
        assert shape["shape"] in ("plane", "sphere", "box", "height_field")
        assert shape.get("heights_m", ()) is not None


@examples(40)
@given(
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.sampled_from((0.0, 2e-4, 4.9e-4, 5.1e-4, 8e-4)),
)
def test_felt_error_equals_the_figures(cuts: list[int], others: list[int], phase: float) -> None:
    master, slave = records(900, phase=phase, seed=1), records(900, seed=2)
    slave["state"][200:300] = State.SILENT.value
    master["ramping"][400:450] = 1
    score, felt = SessionScore(HAND), TickPairs(RATE)
    errors: list[float] = []
    for one, other in zip(pieces(master, cuts), pieces(slave, others), strict=True):
        score.add(one, other)
        matched, now, counts = felt.add(one, other)
        told = felt_message(matched[counts], now[counts], 10.0, HAND)
        errors += told["error_n"]
        assert told["t"] == sorted(told["t"])
        assert told["deadbands"] == pytest.approx([error / 1.5 for error in told["error_n"]], abs=1e-4)
    force: dict[str, Any] = to_json(score.figures().felt)
    assert max(errors) == pytest.approx(force["error_max"], abs=1e-5)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(force["error_rms"], abs=1e-5)
    assert np.mean(np.array(errors) > 1.5) == pytest.approx(force["violation_fraction"], abs=2 / len(errors))


def test_pace_covers_the_last_second_of_a_session() -> None:
    pace, made = Pace(), records(5000)
    assert (pace.packets_per_s, pace.reduction) == (None, None)
    # 100 a second for 3 s, then 10 a second.
    made["updates_sent"] = np.minimum(np.arange(5000) // 10, 300) + np.maximum(np.arange(5000) - 3000, 0) // 100
    for part, rate, reduction in ((made[:3000], 100.0, 0.9), (made[3000:], 10.0, 0.99)):
        for piece in np.split(part, 50):
            pace.add(piece)
        assert pace.packets_per_s == pytest.approx(rate, rel=0.11 if rate < 20 else 0.02)
        assert pace.reduction == pytest.approx(reduction, abs=0.005 if reduction < 0.95 else 0.002)
