"""Figures, rows and end of a watched session."""

import json

import numpy as np
import pytest

from tests.watching.sources import BANK, RATE, HandSource, description, pieces, records
from weberlink.system.scoring.session import SessionScore
from weberlink.telemetry.fault import Fault
from weberlink.watching.session import BACKLOG_S, WatchedSession


def both() -> tuple[HandSource, HandSource, WatchedSession]:
    slave, master = HandSource("slave"), HandSource("master")
    session = WatchedSession("7", slave)
    session.admit(master)
    return master, slave, session


def test_figures_equal_those_of_the_launcher() -> None:
    master, slave, session = both()
    ours, theirs = records(3000, seed=1), records(3000, phase=3e-4, seed=2)
    launcher = SessionScore(RATE, BANK)
    launcher.add(ours, theirs)
    for one, other in zip(pieces(ours, [100, 900, 1700]), pieces(theirs, [40, 950, 2900]), strict=True):
        master.put(one)
        slave.put(other)
        session.look()
    told, expected = session.figures()["figures"], launcher.summary()
    assert told["ticks"] == expected["ticks"]
    for channel in ("force", "position"):
        for name, value in expected[channel].items():
            if isinstance(value, float):
                assert told[channel][name] == pytest.approx(value, rel=1e-12), name
    assert told["force"]["selected"] == expected["force"]["selected"]


def test_backlog_repeats_the_messages_of_looks() -> None:
    master, slave, session = both()
    assert session.look() == [] and session.backlog() == []
    told = []
    for piece in np.split(records(2000, seed=3), 20):
        master.put(piece)
        slave.put(piece)
        told += session.look()
    kinds = {(message["type"], message.get("side")) for message in told}
    assert kinds == {("samples", "master"), ("samples", "slave"), ("felt", None)}
    again = session.backlog()
    json.dumps(again, allow_nan=False)
    for message in again:
        same = [one for one in told if (one["type"], one.get("side")) == (message["type"], message.get("side"))]
        assert message["t"] == [t for one in same for t in one["t"]]
    assert again[-1]["type"] == "felt"


def test_backlog_covers_only_the_last_seconds() -> None:
    master, _, session = both()
    for first in range(0, 12_000, 500):
        master.put(records(500, first=first))
        session.look()
    (message,) = session.backlog()
    assert 11.99 - BACKLOG_S - 0.51 < message["t"][0] <= 12.0 - BACKLOG_S
    assert message["t"][-1] == pytest.approx(11.996)


def test_faults_are_counted_at_their_beginning() -> None:
    _, slave, session = both()
    made = records(100)
    made["fault"][20:60] = Fault.SILENCE
    made["fault"][60:70] = Fault.DEVICE
    made["fault"][90:] = Fault.SILENCE
    for piece in pieces(made, [10, 30, 65, 95]):
        slave.put(piece)
        session.look()
    told = session.figures()
    assert told["faults"] == {"master": {}, "slave": {"silence": 2, "device": 1}}
    assert told["faults_now"] == {"master": None, "slave": "silence"}


def test_session_ends_with_its_last_side() -> None:
    master, slave, session = both()
    assert session.seen_from_start
    master.end(in_order=True)
    session.look()
    assert not session.ended
    slave.end(in_order=True)
    slave.lost = 3
    session.look()
    assert session.ended
    told = session.figures()
    assert told["ended"] and not told["seen_from_start"]
    session.close()
    assert master.is_closed and slave.is_closed


def test_reported_settings_override_those_of_the_file() -> None:
    _, _, session = both()
    assert session.hello()["settings"]["weber"] == 0.1
    assert "settings" not in session.figures()
    session.settings, session.generation = {"weber": 0.2}, 3
    assert session.hello()["settings"] == session.figures()["settings"] == {"weber": 0.2}
    assert session.figures()["generation"] == 3


def test_side_without_description_has_figures() -> None:
    source = HandSource("slave")
    source.description = None
    session = WatchedSession("7", source)
    made = records(10)
    made["sent"], made["selected"] = 1, 3
    source.put(made)
    session.look()
    assert session.figures()["figures"]["force"]["selected"] == {"predictor 3": 10}
    assert session.hello()["readonly"]


@pytest.mark.parametrize("file", ["loopback.yaml", "rotation.yaml"])
def test_rows_include_rotation_of_6_dof_sessions(file: str) -> None:
    source = HandSource("slave")
    source.description = description("slave", file)
    session = WatchedSession("7", source)
    source.put(records(10))
    (told,) = session.look()
    assert ("rotation_raw" in told["columns"]) is (file == "rotation.yaml")
    assert ("torque" in session.figures()["figures"]) is (file == "rotation.yaml")
