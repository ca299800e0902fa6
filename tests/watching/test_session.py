"""What a page is told: the greeting, rows, the felt error, rates, and figures, events and end of a session."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.cli import arm_sessions as arms
from tests.examples import examples
from tests.session.systems import CONFIGS
from tests.watching.sources import BANK, RATE, WALL_OFFSET_S, HandSource, description, pieces, records, watched
from weberlink.figures.session import Layout, SessionScore, TickPairs
from weberlink.figures.tree import to_json
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.watching.hello import hello
from weberlink.watching.rows import CARTESIAN, COLUMNS, ROTATION, Pace, Thinning, felt_message, samples_message
from weberlink.watching.session import BACKLOG_S, WatchedSession


def both() -> tuple[HandSource, HandSource, WatchedSession]:
    slave, master = HandSource("slave"), HandSource("master")
    session = WatchedSession("7", slave)
    session.admit(master)
    return master, slave, session


def test_figures_equal_those_of_the_launcher() -> None:
    master, slave, session = both()
    ours, theirs = records(3000, seed=1), records(3000, phase=3e-4, seed=2)
    launcher = SessionScore(Layout(RATE, BANK))
    launcher.add(ours, theirs)
    for one, other in zip(pieces(ours, [100, 900, 1700]), pieces(theirs, [40, 950, 2900]), strict=True):
        master.put(one)
        slave.put(other)
        session.look()
    told, expected = session.figures()["figures"], launcher.figures().to_json()
    assert told["ticks"] == expected["ticks"]
    for channel in ("force", "position"):
        for name, value in expected[channel].items():
            if isinstance(value, float):
                assert told[channel][name] == pytest.approx(value, rel=1e-12), name
    assert told["force"]["selected"] == expected["force"]["selected"]


def test_backlog_repeats_the_messages_of_the_last_seconds() -> None:
    master, slave, session = both()
    assert session.look() == session.backlog() == []
    told = []
    for first in range(0, 12_000, 500):
        for source in (master, slave):
            source.put(records(500, first=first, seed=first))
        told += session.look()
    kinds = {("samples", "master"), ("samples", "slave"), ("felt", None)}
    assert {(message["type"], message.get("side")) for message in told} == kinds
    again = session.backlog()
    json.dumps(again, allow_nan=False)
    assert [message["type"] for message in again] == ["samples", "samples", "felt"]
    for message in again:
        same = [one for one in told if (one["type"], one.get("side")) == (message["type"], message.get("side"))]
        assert message["t"] == [t for one in same for t in one["t"]][-len(message["t"]) :]
        assert 11.99 - BACKLOG_S - 0.51 < message["t"][0] <= 12.0 - BACKLOG_S


def test_faults_are_counted_at_their_beginning_and_are_events_with_times() -> None:
    made = records(5000)
    made["fault"][1200:3450] = Fault.SILENCE
    made["fault"][3450:3500] = Fault.DEVICE
    made["fault"][4900:] = Fault.SILENCE
    session = watched(*pieces(made, [10, 1300, 3460, 4950]))
    told = session.figures()
    assert told["faults"] == {"slave": {"silence": 2, "device": 1}}
    assert told["faults_now"] == {"slave": "silence"}
    assert [alarm["name"] for alarm in told["alarms"]][:1] == ["slave_silence"]
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
    told = session.figures()
    assert (session.ended, told["ended"], told["seen_from_start"]) == (True, True, False)
    session.close()
    assert master.is_closed
    assert slave.is_closed


def test_arms_are_told_by_axis_and_channel() -> None:
    made = {side: arms.records(side, 2000) for side in ("master", "slave")}
    sources = {side: HandSource(side) for side in made}
    for side, source in sources.items():
        source.description = {"side": side, "system": arms.SYSTEM, "bank": ["zoh"], "changes": ["weber"]}
        source.put(made[side])
    session = WatchedSession("7", sources["slave"])
    session.admit(sources["master"])
    told = {(each["type"], each.get("side")): each for each in session.look()}
    hello = session.hello()
    assert (hello["axes"], hello["settings"]["weber"], hello["scene"]) == ([*arms.NAMES, "gripper"], 0.13, [])
    assert WatchedSession("8", HandSource("slave")).hello()["axes"] is None

    places = list(arms.PLACES)
    for side in made:
        rows = told["samples", side]
        json.dumps(rows, allow_nan=False)
        ticks = np.rint(np.array(rows["t"]) * arms.RATE).astype(int)
        assert {0, arms.SENT_EVERY, arms.GRIPPER_SENT_EVERY} <= set(ticks.tolist())
        assert not set(CARTESIAN) & set(rows["columns"])
        for name in ("joint_position", "joint_raw", "joint_output"):
            shown = np.array(rows["columns"][name]).T
            np.testing.assert_allclose(shown, made[side][name][ticks][:, places], atol=1e-6)
    columns = told["samples", "slave"]["columns"]
    bound = np.maximum(0.13 * np.abs(columns["joint_raw"]), 0.02)
    np.testing.assert_allclose(columns["joint_bound"], bound, atol=1e-6)

    felt = told["felt", None]
    ticks = np.rint(np.array(felt["t"]) * arms.RATE).astype(int)
    actual = made["slave"]["joint_raw"][ticks][:, places].astype(float)
    error = np.abs(made["master"]["joint_output"][ticks][:, places] - actual)
    worst = (error / np.maximum(0.13 * np.abs(actual), 0.02)).max(axis=1)
    assert worst.max() > 0.1
    np.testing.assert_allclose(felt["deadbands"], worst, atol=1e-3)

    figures = session.figures()
    for channel, every in (("joint_torque", arms.SENT_EVERY), ("gripper_angle", arms.GRIPPER_SENT_EVERY)):
        assert figures["packets_per_s_now"][channel] == pytest.approx(arms.RATE / every, rel=0.03)
        assert figures["reduction_now"][channel] == pytest.approx(1.0 - 1.0 / every, abs=0.002)


HAND = Layout(RATE, BANK)


def test_greeting_has_scene_settings_choices_and_who_is_there() -> None:
    told = hello("7", {"master": description("master"), "slave": None})
    assert told["scene"][0]["normal"] == [0.0, 0.0, 1.0]
    sphere = {"center_m": [0.0, 0.0, -0.045], "radius_m": 0.05, "inside": False, "stiffness_n_m": 500.0, "carve": []}
    assert told["scene"][1] == {"shape": "sphere"} | sphere
    assert told["predictors"] == ["zoh", "linear", "plane", "sphere", "hybrid"]
    assert told["settings"] == {"weber": 0.1, "predictor": "hybrid"}
    assert (told["rate_hz"], told["readonly"]) == (1000.0, False)
    assert (told["states"]["4"], told["faults"]["1"]) == ("engaged", "silence")
    assert (set(told["sides"]), told["present"]) == ({"master", "slave"}, ["master", "slave"])
    unknown = hello("7", {"slave": None})
    assert (unknown["readonly"], unknown["changes"], set(unknown["names"].values())) == (True, [], {None})


@pytest.mark.parametrize(
    "name", sorted(path.name for path in CONFIGS.glob("*.yaml") if "key_file" not in path.read_text())
)
def test_every_shipped_scene_can_be_drawn(name: str) -> None:
    told = hello("7", {"slave": description("slave", name)})
    json.dumps(told, allow_nan=False)
    for shape in told["scene"]:
        assert shape["shape"] in ("plane", "sphere", "box", "height_field")
        assert shape.get("heights_m", ()) is not None


@given(st.lists(st.integers(0, 2000), max_size=12))
def test_every_fourth_tick_and_all_events_are_shown(cuts: list[int]) -> None:
    made = records(2000)
    made["sent"][[7, 501, 502, 503]] = 1
    made["rotation_sent"][[1999, 41]] = 1
    made["fault"][801:1203] = Fault.SILENCE
    made["state"][1301:] = 5
    thinning = Thinning(RATE)
    ticks = [tick for piece in pieces(made, cuts) for tick in thinning.choose(piece)["tick"].tolist()]
    assert ticks == sorted({*range(0, 2000, 4), 7, 41, 501, 502, 503, 801, 1203, 1301, 1999})


def test_rows_have_their_columns_and_null_for_what_is_unknown() -> None:
    rows = records(3)
    rows["position"] = [[0.1, 0.2, 0.3]] * 3
    rows["energy"] = [0.5, np.nan, np.inf]
    told = json.loads(json.dumps(samples_message("master", rows, 9.5, HAND), allow_nan=False))
    assert (told["t"], set(told["columns"])) == ([0.5, 0.501, 0.502], set(COLUMNS))
    assert told["columns"]["position"] == [[0.1] * 3, [0.2] * 3, [0.3] * 3]
    assert told["columns"]["rtt_us"] == [None] * 3
    assert told["columns"]["energy"] == [0.5, None, None]
    assert told["columns"]["state"] == [4, 4, 4]
    turned = samples_message("master", rows, 0.0, replace(HAND, torque_bank=("zoh",)))["columns"]
    assert (set(turned), len(turned["rotation_raw"])) == (set(COLUMNS) | set(ROTATION), 3)


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
