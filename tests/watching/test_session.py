"""Figures, rows, events and end of a watched session, Cartesian or of arms."""

import json
from typing import Any

import numpy as np
import pytest

from tests.cli import arm_sessions as arms
from tests.watching.sources import BANK, RATE, WALL_OFFSET_S, HandSource, description, pieces, records
from weberlink.figures.session import Layout, SessionScore
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.watching.rows import CARTESIAN
from weberlink.watching.session import BACKLOG_S, WatchedSession


def both() -> tuple[HandSource, HandSource, WatchedSession]:
    slave, master = HandSource("slave"), HandSource("master")
    session = WatchedSession("7", slave)
    session.admit(master)
    return master, slave, session


def alone(*made: Any, file: str = "loopback.yaml", side: str = "slave") -> tuple[HandSource, WatchedSession]:
    """A session of one side that was looked at after each of these records."""
    source = HandSource(side)
    source.description = description(side, file)
    session = WatchedSession("7", source)
    for piece in made:
        source.put(piece)
        session.look()
    return source, session


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
    _, session = alone(*pieces(made, [10, 1300, 3460, 4950]))
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
