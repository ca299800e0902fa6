"""The figures of each way, on records made by hand and on emulated links that are known."""

from typing import Any

import numpy as np
import pytest

from tests.system.scoring.test_session import NONE, RATE, records
from tests.system.systems import system
from weberlink.protocol.states import State
from weberlink.system.scoring.session import Records, SessionScore
from weberlink.system.scoring.ways import ways_now
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.record import RECORD


def ways(master: Records, slave: Records, pieces: int = 1) -> dict[str, Any]:
    scored = SessionScore(RATE, ("zoh", "plane"))
    for one, other in zip(np.array_split(master, pieces), np.array_split(slave, pieces), strict=True):
        scored.add(one, other)
    return scored.ways()


def simulated(*overrides: str, ticks: int = 2500) -> tuple[Records, Records]:
    """Both sides of a session in virtual time."""
    simulation = system(*overrides)
    made = [simulation.step() for _ in range(ticks)]
    master, slave = (b"".join(RECORD.pack(*each) for each in side) for side in zip(*made, strict=True))
    return np.frombuffer(master, DTYPE), np.frombuffer(slave, DTYPE)


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
    assert alone["is_reported"] and alone["received"] is None


def test_without_a_session_nothing_is_known() -> None:
    waiting = records(100)
    waiting["state"] = State.CONNECTING.value
    waiting["jitter_us"] = np.nan
    for told in (ways(waiting, NONE), ways(NONE, NONE)):
        assert told["jitter_us"] == {"p50": None, "p99": None}
        assert {way["loss"] for way in (told["to_slave"], told["to_master"])} == {None}
        assert told["to_master"]["one_way_us"]["p50"] is None
    assert ways_now({})["to_slave"] == {"one_way_us": None, "loss": None, "burst": None}


def test_newest_records_tell_the_present() -> None:
    master, slave = records(1)[0], records(1)[0]
    master["rtt_us"], master["one_way_us"], master["outgoing_loss"], master["jitter_us"] = 25e3, 20e3, 0.5, np.nan
    slave["one_way_us"], slave["incoming_loss"], slave["peer_burst"] = 6e3, 0.25, 2.0
    both, alone = ways_now({"master": master, "slave": slave}), ways_now({"master": master})
    assert both["to_slave"] == {"one_way_us": 6e3, "loss": 0.25, "burst": 2.0}
    assert alone["to_slave"] == {"one_way_us": 5e3, "loss": 0.5, "burst": None}
    assert both["jitter_us"] is None


def test_known_link_is_measured_right() -> None:
    """Delay 20 ms, jitter uniform up to 4 ms, loss 10 % to the slave only, in virtual time."""
    to_slave = "{delay_ms: 20, jitter_ms: 4, loss: 0.1}"
    link = f"link.emulate={{to_slave: {to_slave}, to_master: {{delay_ms: 20, jitter_ms: 4}}, seed: 7}}"
    master, slave = simulated(link)
    both, alone = ways(master, slave), ways(master, NONE)
    for told in (both, alone):
        for name in ("to_slave", "to_master"):
            assert told[name]["one_way_us"]["p50"] == pytest.approx(22e3, abs=1e3)
    sent = int(master["datagrams_sent"][-1])
    spread = 3.0 * (0.1 * 0.9 / sent) ** 0.5
    assert both["to_slave"]["loss"] == pytest.approx(0.1, abs=spread)
    assert both["to_master"]["loss"] == 0.0
    assert alone["to_slave"]["loss"] == pytest.approx(0.1, abs=0.05)
    assert 2e3 < both["jitter_us"]["p50"] < 10e3, "mean excess 2 ms, and a bound that few datagrams exceed"
