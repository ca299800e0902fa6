"""Live runs, echoes, limits and facts of the host."""

import os
from pathlib import Path
from time import monotonic_ns

import numpy as np
import pytest
from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESCCM

from benchmarks import latency, lateness
from benchmarks.arrangement import Arrangement, BenchError, Rights, granted
from benchmarks.host import during, host, in_words, share_between
from benchmarks.latency import echo, join
from benchmarks.lateness import LatenessLimit
from benchmarks.live_side import LiveSide, Resources, memory, resident_kib, resources
from benchmarks.percentiles import summary
from benchmarks.sealed_echo import KEYS, SALT, TAG_BYTES, expand, seal, steps_of, unseal, work
from tests.system.systems import CONFIGS
from weberlink.apps.doctor import Machine, Needs
from weberlink.protocol.keys import generate
from weberlink.protocol.psk import CcmCipher
from weberlink.protocol.wire import CLEAR_BYTES
from weberlink.realtime.host import Steal
from weberlink.system.configuration.model import RealtimeSettings
from weberlink.telemetry.reader import DTYPE

BARE = Rights(priority=0, lock_memory=False, wakeful=False, cpus=None)


def test_trips_join_both_ends_without_warm_up() -> None:
    asked = {str(number): [number * 1000_000, number * 1000_000 + 90_000] for number in (8, 9, 10, 11)}
    answered = {str(number): [number * 1000_000 + 40_000, number * 1000_000 + 50_000] for number in (7, 8, 10, 11)}
    trips = join(asked, answered, 1)
    assert trips.there_us.tolist() == pytest.approx([40.0, 40.0])  # 10 and 11: 8 warms up, 9 had no answer
    assert trips.back_us.tolist() == pytest.approx([40.0, 40.0])
    assert trips.round_us.tolist() == pytest.approx([90.0, 90.0])


def test_an_unanswered_echo_is_an_error() -> None:
    with pytest.raises(BenchError, match="no question was answered"):
        join({"1": [1, 2]}, {}, 0)


def test_an_echo_that_does_not_start_is_an_error(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BenchError, match="did not start"):
        echo("no_such_echo", {}, 1000.0, 0.1, BARE)
    assert "no_such_echo" in capfd.readouterr().err


@pytest.mark.hunt
def test_without_programs_the_limits_are_python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(latency, "WARM_UP_S", 0.05)
    limit = lateness.limit(200.0, 0.2, BARE)
    assert limit.name == lateness.BARE_TIMER
    assert 2 <= len(limit.lateness_us) <= 80  # of two processes; after a stall, one for several deadlines
    assert all(limit.lateness_us > 0.0)
    key = tmp_path / "key"
    generate(key)
    asked = ("realtime.priority=0", "realtime.lock_memory=false", "realtime.wakeful=false")
    arrangement = Arrangement(CONFIGS / "loopback.yaml", key, asked, lambda _: [], 0.5)
    document = latency.measure(arrangement, BARE).as_json()
    assert document["sockperf"] is None
    assert document["ratio_to_sockperf"] is None
    for name in ("weberlink_us", "plain_socket_us", "sealed_socket_us"):
        for way in latency.WAYS:
            assert 0.0 < document[name][way]["p50"] <= document[name][way]["p99_9"] <= document[name][way]["max"]
        there, back, both = (document[name][way]["p50"] for way in latency.WAYS)
        assert both > max(there, back)
    assert document["updates"] > 50
    for limit_name in ("ratio_to_plain", "ratio_to_sealed"):
        assert document[limit_name]["force"]["p50"] > 0.0


def test_a_sealed_question_is_opened_under_its_number_alone() -> None:
    cipher, other = (AESCCM(key, tag_length=TAG_BYTES) for key in KEYS)
    datagram = seal(cipher, 70_000)
    assert len(datagram) == latency.SIZE
    assert expand(int.from_bytes(datagram[:CLEAR_BYTES], "little"), 69_000) == 70_000
    assert unseal(cipher, 70_000, datagram) == 70_000
    for wrong, number in ((cipher, 70_001), (other, 70_000)):
        with pytest.raises(InvalidTag):
            unseal(wrong, number, datagram)


def test_the_sealed_limit_seals_as_a_session_does() -> None:
    """Cipher, nonce and overhead: a session opens what the limit seals, given its key and salt."""
    session = CcmCipher(bytes(32))
    sealed = session.seal(3, bytes(CLEAR_BYTES) + b"twelve bytes")
    assert len(sealed) == CLEAR_BYTES + 12 + TAG_BYTES
    assert len(SALT + (3).to_bytes(8, "little")) == 13  # the nonce of AES-CCM with lengths of two bytes


def test_the_work_of_a_bare_tick_takes_about_its_time() -> None:
    steps = range(steps_of(50.0))
    took = []
    for _ in range(50):
        began = monotonic_ns()
        work(steps)
        took.append(monotonic_ns() - began)
    assert 10e3 < min(took) < 250e3


def test_steal_is_a_share_of_what_passed() -> None:
    assert share_between(Steal(35, 1000), Steal(55, 1200)) == pytest.approx(0.1)
    assert share_between(None, Steal(55, 1200)) is None
    assert "steal during the run unknown" in during(None)


def test_rights_are_tried_in_another_process() -> None:
    asked = RealtimeSettings(priority=0, lock_memory=False, wakeful=False, cpus=None)
    assert granted(asked) == BARE
    nowhere = asked.model_copy(update={"cpus": (0, 100_000)})
    assert granted(nowhere).cpus is None
    assert granted(asked.model_copy(update={"cpus": (0, 0)})).cpus == (0, 0)


@pytest.mark.parametrize(
    ("rate_hz", "lateness_us", "share"),
    [
        (1000.0, [10.0, 999.0], 0.0),
        (1000.0, [10.0, 1000.0], 1 / 3),
        (1000.0, [0.0] * 998 + [7440.0, 2001.0], 9 / 1009),
        (4000.0, [10.0, 740.0], 2 / 4),
    ],
)
def test_late_wake_ups_count_missed_periods(rate_hz: float, lateness_us: list[float], share: float) -> None:
    assert LatenessLimit("", np.array(lateness_us)).missed_share(rate_hz) == pytest.approx(share)


def side(lateness_us: list[float], missed: list[int], *, rate_hz: float = 1000.0) -> LiveSide:
    """Records with these latenesses and counts of deadlines that were missed so far; 12 s of 40 s of a processor."""
    records = np.zeros(len(lateness_us), DTYPE)
    records["lateness_us"], records["ticks_missed"] = lateness_us, missed
    used = [(100.0, Resources(3.0, 1000, 9)), (120.0, Resources(9.0, 1500, 11)), (140.0, Resources(15.0, 1040, 10))]
    return LiveSide(records, rate_hz, used)


def test_a_stall_counts_from_the_oldest_deadline() -> None:
    stalled = side([40.0, 50.0, 300.0, 60.0], [7, 7, 17, 17])
    assert stalled.lateness_us.tolist() == [40.0, 50.0, 10_300.0, 60.0]
    assert summary(stalled.lateness_us)["max"] == 10_300.0
    at_4_khz = side([40.0, 50.0], [0, 2], rate_hz=4000.0)
    assert at_4_khz.lateness_us.tolist() == [40.0, 550.0]


def test_resources_cover_the_measurement() -> None:
    used = side([1.0], [0])
    assert used.cpu_s / used.elapsed_s == pytest.approx(0.3)
    assert memory({"slave": used})["slave"] == {
        "first_kib": 1000,
        "last_kib": 1040,
        "max_kib": 1500,
        "growth_kib_per_minute": pytest.approx(60.0),
        "descriptors_first": 9,
        "descriptors_last": 10,
    }


def test_resources_of_processes() -> None:
    before = resources(os.getpid())
    with Path(os.devnull).open("rb"):
        after = resources(os.getpid())
    assert after.descriptors == before.descriptors + 1
    assert after.rss_kib > 1000
    assert after.cpu_s >= before.cpu_s > 0.0
    with pytest.raises(OSError, match="No such file"):
        resources(2**22 + 1)
    assert resident_kib("Name:\tdaemon\nState:\tZ (zombie)\n") == 0


def test_the_facts_are_those_of_the_doctor(tmp_path: Path) -> None:
    files = {
        "proc/version": "Linux version 6.1.0 (builder) #1 SMP PREEMPT_RT",
        "sys/devices/system/cpu/isolated": "2-3",
        "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor": "powersave",
        "sys/devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    facts = host(Needs(cpus=(2, 3)), Machine(tmp_path))
    assert facts["findings"]["preemption"] == "kernel 6.1.0, PREEMPT_RT"
    assert facts["findings"]["isolation"] == "daemons pinned to isolated processors 2, 3"
    assert facts["findings"]["clock source"] == "clock source tsc"
    assert "throttling: /proc/sys/kernel/sched_rt_runtime_us: this kernel has no such file" in in_words(facts)
    assert "frequency governor powersave" in in_words(facts)
