"""Echoes between two processes, and the moments of both joined."""

from pathlib import Path

import pytest

from benchmarks import bare_timer, latency, lateness
from benchmarks.arrangement import Arrangement, BenchError
from benchmarks.echo import join, measure
from benchmarks.rights import Rights, granted
from tests.system.systems import CONFIGS
from weberlink.protocol.keys import generate
from weberlink.system.configuration.model import RealtimeSettings

BARE = Rights(priority=0, lock_memory=False, wakeful=False, cpus=None)


def test_trips_are_those_that_both_ends_know_without_the_first() -> None:
    asked = {str(number): [number * 1000_000, number * 1000_000 + 90_000] for number in (8, 9, 10, 11)}
    answered = {str(number): [number * 1000_000 + 40_000, number * 1000_000 + 50_000] for number in (7, 8, 10, 11)}
    trips = join(asked, answered, 1)
    assert trips.there_us.tolist() == pytest.approx([40.0, 40.0])  # 10 and 11: 8 warms up, 9 had no answer
    assert trips.back_us.tolist() == pytest.approx([40.0, 40.0])
    assert trips.round_us.tolist() == pytest.approx([90.0, 90.0])


def test_an_echo_that_nobody_answers_is_one_line() -> None:
    with pytest.raises(BenchError, match="no question was answered"):
        join({"1": [1, 2]}, {}, 0)


def test_an_echo_that_does_not_start_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BenchError, match="did not start"):
        measure("no_such_echo", {}, 1000.0, 0.1, BARE)
    assert "no_such_echo" in capfd.readouterr().err


def test_without_tools_the_limits_are_bare_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    limit = lateness.limit(200.0, 0.2, BARE)
    assert limit.name == bare_timer.NAME
    assert 2 <= len(limit.lateness_us) <= 80  # of two processes; after a stall, one for several deadlines
    assert all(limit.lateness_us > 0.0)
    key = tmp_path / "key"
    generate(key)
    asked = ("realtime.priority=0", "realtime.lock_memory=false", "realtime.wakeful=false")
    arrangement = Arrangement(CONFIGS / "loopback.yaml", key, asked, lambda _: [], 1.0)
    document = latency.measure(arrangement, BARE).as_json()
    assert document["sockperf"] is None
    assert document["ratio_to_sockperf"] is None
    for name in ("weberlink_us", "plain_socket_us"):
        for way in latency.WAYS:
            assert 0.0 < document[name][way]["p50"] <= document[name][way]["p99_9"] <= document[name][way]["max"]
        there, back, both = (document[name][way]["p50"] for way in latency.WAYS)
        assert both > max(there, back)
    assert document["updates"] > 100
    assert document["ratio_to_plain"]["force"]["p50"] > 0.0


def test_an_answer_longer_than_a_pipe_arrives_whole(tmp_path: Path) -> None:
    key = tmp_path / "key"
    generate(key)
    order = {
        "file": str(CONFIGS / "loopback.yaml"),
        "overrides": ["link.security=psk", f"link.key_file={key}", "rate_hz=1000"],
    }
    trips = measure("coded_echo", order, 1000.0, 1.5, BARE)
    assert len(trips.round_us) > 500  # more than 64 KiB, with those before them


def test_rights_are_asked_for_outside_of_this_process() -> None:
    asked = RealtimeSettings(priority=0, lock_memory=False, wakeful=False, cpus=None)
    assert granted(asked) == BARE
    nowhere = asked.model_copy(update={"cpus": (0, 100_000)})
    assert granted(nowhere).cpus is None
    assert granted(asked.model_copy(update={"cpus": (0, 0)})).cpus == (0, 0)
