"""The cost of a tick: stages, floors, system calls, and what they add up to."""

import os
import socket
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.arrangement import Arrangement, BenchError, Rights
from benchmarks.bare_tick import STAGES, BareTick, WakeCost, letters, on_epoll, on_ticker, on_uvloop
from benchmarks.budget import LEAD, LOOP, PARTS, SIDE_LOOP, WAKE, WORK, tables
from benchmarks.kernel_counts import ALL_CALLS, MISSES, KernelCounts, count, parse
from benchmarks.latency import SIZE
from benchmarks.staged_tick import (
    CLOCK,
    DECRYPT,
    DEVICE,
    ENCODE,
    PACK,
    PARSE,
    READ,
    SEAL,
    SEND,
    TELEMETRY,
    TIMERS,
    CipherWatch,
    Row,
    StagedSide,
    WatchedSecurity,
    chunk_median,
    cold_sides,
    costs,
    warm,
)
from benchmarks.staged_tick import PARTS as STAGED
from tests.benchmarks.findings import budget
from tests.system.systems import CONFIGS
from weberlink.cli.sessions import free_port
from weberlink.protocol.keys import generate
from weberlink.protocol.psk import PSK_BYTES, PresharedKey
from weberlink.system.configuration import SIDES

BARE = Rights(priority=0, lock_memory=False, wakeful=False, cpus=None)
NAMES = (READ, PARSE, TIMERS, DEVICE, ENCODE, PACK, SEND, TELEMETRY, CLOCK)


def stamps(*durations: int) -> list[int]:
    return [1000 + sum(durations[:place]) for place in range(len(durations) + 1)]


def test_a_staged_tick_is_divided_without_loss() -> None:
    row = Row(stamps(110, 510, 60, 310, 410, 210, 120, 90, 10), 150, 80, 1, 2, 1, 1, 2)
    spent = dict(zip(STAGED, row.parts(NAMES, 10.0), strict=True))
    assert spent[READ] == (100.0, 1)
    assert spent[DECRYPT] == (140.0, 1)  # without the clock that timed it
    assert spent[PARSE] == (340.0, 1)  # without what it decrypted, and the other half of that timing
    assert spent[SEAL] == (60.0, 2)
    assert spent[PACK] == (150.0, 1)  # one of two datagrams that were sealed
    assert spent[TIMERS] == (0.0, 1)  # the other one
    assert spent[SEND] == (110.0, 2)
    assert spent[DEVICE][0] + spent[ENCODE][0] + spent[TELEMETRY][0] == 300.0 + 400.0 + 80.0


def test_a_tick_without_datagrams_charges_no_cipher() -> None:
    row = Row(stamps(110, 10, 60, 310, 410, 10, 10, 90, 10), 0, 0, 0, 0, 0, 0, 0)
    spent = dict(zip(STAGED, row.parts(NAMES, 10.0), strict=True))
    assert [spent[part] for part in (DECRYPT, PARSE, PACK, SEAL, SEND)] == [(0.0, 0)] * 5
    assert spent[TIMERS] == (50.0, 1)


def test_rare_work_counts_in_the_mean_and_each_time() -> None:
    rare = STAGED.index(SEND)
    ticks = [
        [(1000.0, 1) if place != rare else (8000.0, 2) if tick % 4 == 0 else (0.0, 0) for place in range(len(STAGED))]
        for tick in range(400)
    ]
    found = costs(ticks)
    assert found[SEND] == {"times": 0.5, "us": pytest.approx(2.08, abs=0.1), "each_us": 4.0}
    assert found[READ] == {"times": 1.0, "us": 1.0, "each_us": 1.0}


def test_one_disturbed_tick_changes_nothing() -> None:
    assert chunk_median([20.0] * 150 + [9e9] + [20.0] * 49) == 20.0
    assert chunk_median([1.0, 3.0]) == 2.0


def test_watched_ciphers_do_the_same_and_are_counted() -> None:
    suite, watch = PresharedKey(bytes(range(PSK_BYTES))), CipherWatch()
    watched = WatchedSecurity(suite, watch)
    assert (watched.tag_size, watched.overhead) == (suite.tag_size, suite.overhead)
    call = watched.call(b"prologue", os.urandom(watched.private_size))
    heard = suite.hear(b"prologue", call.hello(b"question"))
    assert heard is not None
    answered = heard.answer(b"answer", os.urandom(suite.private_size))
    assert answered is not None
    opened = call.open(answered[0])
    assert opened is not None
    assert opened[0] == b"answer"
    assert answered[1].open(7, opened[1].seal(7, b"abcdef")) == b"def"
    assert opened[1].open(3, answered[1].seal(3, b"abcxyz")) == b"xyz"
    assert opened[1].open(4, b"no such datagram") is None
    assert (watch.sealed, watch.opened) == (1, 2)
    assert min(watch.seal_ns, watch.open_ns) > 0
    other = WatchedSecurity(PresharedKey(bytes(PSK_BYTES)), watch)
    assert other.hear(b"prologue", suite.call(b"prologue", os.urandom(suite.private_size)).hello(b"")) is None


def arrangement(folder: Path, *given: str) -> Arrangement:
    key = folder / "key"
    generate(key)
    file = CONFIGS / "loopback.yaml"
    return Arrangement(file, key, given, lambda overrides: free_port(file, overrides), 1.0, quick=True)


@pytest.mark.parametrize("given", [(), ("control.scheme=none", "link.security=none")])
def test_every_stage_of_both_sides_is_measured(tmp_path: Path, given: tuple[str, ...]) -> None:
    arranged = arrangement(tmp_path, *given)
    overrides = arranged.overrides(1000.0)
    order = {"ticks": 1000, "rights": vars(BARE)}
    found = warm(order, arranged.configuration(overrides))
    for side in SIDES:
        parts = found[side]["parts"]
        assert tuple(parts) == STAGED
        assert all(part["us"] > 0.0 and part["times"] > 0.0 for part in parts.values()), parts
        assert parts[SEAL]["times"] == pytest.approx(parts[SEND]["times"])
        assert parts[DECRYPT]["times"] == pytest.approx(parts[PARSE]["times"])
        assert 100 < found[side]["ticks"] < 600
        # Both kinds of tick are the same work, so their costs are close.
        work = sum(part["us"] for name, part in parts.items() if name != TELEMETRY)
        assert 0.6 * work < found[side]["whole_us"] < 2.0 * work
        assert len(found[side]["record"]) == len(letters())


def test_a_cipher_that_is_not_watched_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CipherWatch, "protection", lambda _, protection: protection)
    arranged = arrangement(tmp_path)
    with pytest.raises(BenchError, match="the ciphers are not watched"):
        warm({"ticks": 200, "rights": vars(BARE)}, arranged.configuration(arranged.overrides(1000.0)))


def test_a_session_that_does_not_engage_is_an_error() -> None:
    staged = object.__new__(StagedSide)
    staged.clear()
    with pytest.raises(BenchError, match="no tick was staged"):
        staged.result()


def test_bare_parts_and_loops_have_a_cost() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bare = BareTick(bound, SIZE, [1.0] * len(letters()))
        for _ in range(200):
            bare.tick()
        found = bare.result()
    assert tuple(found) == STAGES
    assert all(0.0 < us < 1e3 for us in found.values()), found
    assert found[SEND] > 0.1
    for loop in (on_epoll, on_uvloop, lambda rate_hz, cost: on_ticker(rate_hz, cost, leads=True)):
        assert 0.5 < loop(2000.0, WakeCost(100)) < 500.0


def test_the_parts_add_up_to_a_tick() -> None:
    made = budget()
    parts = made.parts("master")
    assert tuple(parts) == PARTS
    assert parts[WAKE]["cold_us"] == 20.0
    assert parts[WAKE]["floor_cold_us"] == 15.0
    assert parts[LEAD]["cold_us"] == 3.0
    assert parts[LOOP]["cold_us"] == 7.0  # of 30 us outside of the ticks
    assert parts[LOOP]["floor_cold_us"] == 2.0
    assert parts[SIDE_LOOP]["cold_us"] == parts[SIDE_LOOP]["warm_us"] == 1.0
    work = 4.0 * (len(STAGED) - 1) + 1.0
    assert made.sum_us("master", parts=WORK) == work
    assert made.sum_us("master") == 30.0 + work + 4.0
    assert made.sum_us("slave", "warm_us") == 2.0 * len(STAGED) + 1.0
    live = made.of_daemon("slave")
    assert live["work_us"] == live["work_p50_us"] == 50.0
    assert live["work_gap_us"] == 50.0 - work
    assert live["cpu_us_per_tick"] == pytest.approx(100.0)
    assert live["cpu_gap_us"] == pytest.approx(100.0 - made.sum_us("slave"))
    assert (live["system_calls"], live["cache_misses"]) == (3.5, None)


def printed(document: dict[str, object]) -> str:
    screen = StringIO()
    Console(width=80, file=screen).print(tables(document))
    return screen.getvalue()


def test_the_tables_say_what_is_not_counted() -> None:
    document = budget().as_json()
    text = printed(document)
    assert "cache misses of a live tick, master: not counted by this machine" in text
    assert "system calls of a live tick, slave: 3.5" in text
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text
    assert "perf is not installed" in printed(document | {"not_counted": "perf is not installed"})


def test_the_output_of_perf_is_read() -> None:
    lines = ["8203,,raw_syscalls:sys_enter,2000,100.00,,", "<not supported>,,cache-misses,0,100.00,,", "", "# text"]
    assert parse(lines) == {ALL_CALLS: 8203.0, MISSES: None}
    counts = KernelCounts({"slave": {ALL_CALLS: 4.0, "syscalls:sys_enter_read": 1.0, "syscalls:sys_enter_sendto": 2.5}})
    assert list(counts.named("slave").items()) == [("sendto", 2.5), ("read", 1.0), ("other", 0.5)]
    assert counts.calls("master") is None
    assert counts.named("master") == {}


def test_without_perf_nothing_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    counts = count({"slave": os.getpid()}, 0.1, 1000.0)
    assert counts.complaint == "perf is not installed"
    assert counts.calls("slave") is None


@pytest.mark.realtime(alone=True)
def test_a_staged_tick_wakes_as_a_daemon_does(tmp_path: Path) -> None:
    arranged = arrangement(tmp_path)
    order = {"file": str(arranged.file), "overrides": arranged.overrides(1000.0), "ticks": 400}
    found = cold_sides(order, BARE)
    assert found.keys() == set(SIDES)
    for each in found.values():
        assert each["outside_us"] > 1.0
        assert each["whole_us"] > 1.0
