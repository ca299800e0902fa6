"""The figures of each way, on records made by hand and on emulated links that are known."""

from typing import Any

import numpy as np
import pytest

from tests.figures.test_session import NONE, RATE, records
from weberlink.figures.link import ways_now
from weberlink.figures.session import Layout, Records, SessionScore
from weberlink.figures.tree import to_json
from weberlink.protocol.states import State


def ways(master: Records, slave: Records, pieces: int = 1) -> dict[str, Any]:
    scored = SessionScore(Layout(RATE, ("zoh", "plane")))
    for one, other in zip(np.array_split(master, pieces), np.array_split(slave, pieces), strict=True):
        scored.add(one, other)
    ways: dict[str, Any] = to_json(scored.figures().ways)
    return ways


def test_each_way_is_measured_by_its_receiver() -> None:
    master, slave = records(1000), records(1000)
    master["one_way_us"], slave["one_way_us"] = 20e3, 5e3
    master["rtt_us"] = slave["rtt_us"] = 25e3
    master["datagrams_received"], master["datagrams_lost"] = 900, 100
    slave["datagrams_received"], slave["datagrams_lost"] = 999, 1
    master["jitter_us"] = 700.0
    slave["peer_burst"][500:] = 3.0
    both = ways(master, slave, pieces=7)
    assert both["jitter_us"]["p50"] == pytest.approx(700.0, rel=0.005)
    to_slave, to_master = both["to_slave"], both["to_master"]
    assert to_slave["one_way_us"]["p50"] == pytest.approx(5e3, rel=0.005)
    assert to_master["one_way_us"]["p99"] == pytest.approx(20e3, rel=0.005)
    assert (to_slave["loss"], to_master["loss"]) == (0.001, 0.1)
    assert (to_slave["burst"], to_master["burst"]) == (3.0, None)
    assert not to_slave["is_reported"] and not to_master["is_reported"]


def test_one_side_alone_tells_both_ways() -> None:
    master = records(1000)
    master["rtt_us"], master["one_way_us"] = 25e3, 20e3
    master["outgoing_loss"] = np.linspace(0.0, 0.02, 1000)
    alone = ways(master, NONE)["to_slave"]
    assert alone["one_way_us"]["p50"] == pytest.approx(5e3, rel=0.005)
    assert alone["loss"] == pytest.approx(0.01)
    assert alone["is_reported"]


def test_without_a_session_nothing_is_known() -> None:
    waiting = records(100)
    waiting["state"] = State.CONNECTING.value
    waiting["jitter_us"] = np.nan
    for told in (ways(waiting, NONE), ways(NONE, NONE)):
        assert told["jitter_us"] == {"p50": None, "p99": None}
        assert {way["loss"] for way in (told["to_slave"], told["to_master"])} == {None}
        assert told["to_master"]["one_way_us"]["p50"] is None
    assert ways_now({})["to_slave"] == {"one_way_us": None, "loss": None, "burst": None}
