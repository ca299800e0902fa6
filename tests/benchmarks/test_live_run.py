"""What is said of a daemon from its records and the kernel's account."""

import os
import socket
from pathlib import Path

import numpy as np
import pytest

from benchmarks.arrangement import Arrangement, BenchError
from benchmarks.live_run import Side, live_run
from benchmarks.memory import memory
from benchmarks.percentiles import summary
from benchmarks.resources import Resources, resident_kib, resources
from tests.system.systems import CONFIGS
from weberlink.protocol.keys import generate
from weberlink.telemetry.reader import DTYPE
from weberlink.telemetry.ring import default_path


def side(lateness_us: list[float], missed: list[int], *, rate_hz: float = 1000.0) -> Side:
    """Records with these latenesses and counts of deadlines that were missed so far; 12 s of 40 s of a processor."""
    records = np.zeros(len(lateness_us), DTYPE)
    records["lateness_us"], records["ticks_missed"] = lateness_us, missed
    used = [(100.0, Resources(3.0, 1000, 9)), (120.0, Resources(9.0, 1500, 11)), (140.0, Resources(15.0, 1040, 10))]
    return Side(records, rate_hz, used, {"realtime": None, "faults": {}, "garbage": {"young": 3}})


def test_a_stall_counts_from_the_oldest_deadline_that_passed() -> None:
    stalled = side([40.0, 50.0, 300.0, 60.0], [7, 7, 17, 17])
    assert stalled.lateness_us.tolist() == [40.0, 50.0, 10_300.0, 60.0]
    assert summary(stalled.lateness_us)["max"] == 10_300.0
    at_4_khz = side([40.0, 50.0], [0, 2], rate_hz=4000.0)
    assert at_4_khz.lateness_us.tolist() == [40.0, 550.0]


def test_what_was_missed_before_the_stretch_does_not_count() -> None:
    stalled = side([40.0, 50.0, 300.0, 60.0], [7, 7, 17, 17])
    assert (stalled.ticks, stalled.missed) == (4, 10)
    assert stalled.missed_share == pytest.approx(10 / 14)


def test_use_is_that_of_the_stretch() -> None:
    used = side([1.0], [0])
    assert used.cpu_s / used.elapsed_s == pytest.approx(0.3)
    assert memory({"slave": used})["slave"] == {
        "first_kib": 1000,
        "last_kib": 1040,
        "max_kib": 1500,
        "growth_kib_per_minute": pytest.approx(60.0),
        "descriptors_first": 9,
        "descriptors_last": 10,
        "garbage": {"young": 3},
    }


@pytest.mark.realtime
def test_a_daemon_that_ends_by_itself_ends_the_measurement_with_its_reason(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    key = tmp_path / "key"
    generate(key)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        ports = [f'link.listen="{address}"', f'link.slave="{address}"']
        arrangement = Arrangement(CONFIGS / "loopback.yaml", key, (), lambda _: ports)
        with pytest.raises(BenchError, match=f"the slave ended before the session began: UDP {address} is in use"):
            live_run(arrangement, 1000.0, 1.0)
    assert "is in use" in capfd.readouterr().err
    assert not list(default_path(f"{os.getpid()}-x").parent.glob(f"weberlink-{os.getpid()}-*"))


def test_the_kernel_is_asked_about_a_process_that_lives() -> None:
    before = resources(os.getpid())
    descriptor = os.open(os.devnull, os.O_RDONLY)
    block = np.ones(4_000_000)
    after = resources(os.getpid())
    os.close(descriptor)
    assert after.descriptors == before.descriptors + 1
    assert after.rss_kib > before.rss_kib + block.nbytes // 2048
    assert after.cpu_s >= before.cpu_s > 0.0


def test_of_a_process_that_is_gone_nothing_can_be_said() -> None:
    with pytest.raises(OSError, match="No such file"):
        resources(2**22 + 1)
    assert resident_kib("Name:\tdaemon\nState:\tZ (zombie)\n") == 0
