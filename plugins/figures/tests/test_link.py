"""The figures of each way of the link."""

import numpy as np
import pytest

from plugins.figures.tests.test_session import NONE, records, score
from weberlink.protocol.states import State


def test_each_way_is_measured_by_its_receiver() -> None:
    master = records(1000, one_way_us=20e3, rtt_us=25e3, datagrams_received=900, datagrams_lost=100, jitter_us=700.0)
    slave = records(1000, one_way_us=5e3, rtt_us=25e3, datagrams_received=999, datagrams_lost=1)
    slave["peer_burst"][500:] = 3.0
    both = score(master, slave, pieces=7)["ways"]
    assert both["jitter_us"]["p50"] == pytest.approx(700.0, rel=0.005)
    to_slave, to_master = both["to_slave"], both["to_master"]
    assert to_slave["one_way_us"]["p50"] == pytest.approx(5e3, rel=0.005)
    assert to_master["one_way_us"]["p99"] == pytest.approx(20e3, rel=0.005)
    assert (to_slave["loss"], to_master["loss"]) == (0.001, 0.1)
    assert (to_slave["burst"], to_master["burst"]) == (3.0, None)
    assert not to_slave["is_reported"] and not to_master["is_reported"]


def test_one_side_alone_tells_both_ways() -> None:
    master = records(1000, rtt_us=25e3, one_way_us=20e3, outgoing_loss=np.linspace(0.0, 0.02, 1000))
    alone = score(master, NONE)["ways"]["to_slave"]
    assert alone["one_way_us"]["p50"] == pytest.approx(5e3, rel=0.005)
    assert alone["loss"] == pytest.approx(0.01)
    assert alone["is_reported"]


def test_without_a_session_nothing_is_known() -> None:
    waiting = records(100, state=State.CONNECTING.value, jitter_us=np.nan)
    for told in (score(waiting, NONE)["ways"], score(NONE, NONE)["ways"]):
        assert told["jitter_us"] == {"p50": None, "p99": None}
        assert {way["loss"] for way in (told["to_slave"], told["to_master"])} == {None}
        assert told["to_master"]["one_way_us"]["p50"] is None
