"""The report of known findings, its targets and its figure."""

import numpy as np
import pytest

from benchmarks.arrangement import RATES_HZ
from benchmarks.latency import Latency, OneWay
from benchmarks.lateness import Lateness, LatenessLimit
from benchmarks.live_side import LiveSide, Resources
from benchmarks.report import targets
from tests.records import ticks
from weberlink.compiled import is_compiled

SHARE, WORK_US = (0.06, 30.0) if is_compiled() else (0.1, 65.0)


def side(rate_hz: float, *, late_us: float, missed: int, cpu_s: float) -> LiveSide:
    """A daemon over 10 s, every tick equally late, all its missed deadlines at once in the middle."""
    records = ticks(int(10.0 * rate_hz) - missed, lateness_us=late_us, work_us=WORK_US, codec_us=5.0)
    records["ticks_missed"][len(records) // 2 :] = missed
    used = [(0.0, Resources(1.0, 40_000, 12)), (10.0, Resources(1.0 + cpu_s, 40_004, 12))]
    return LiveSide(records, rate_hz, used)


def rates(
    *of: float, late_us: float = 30.0, missed: int = 0, cpu_s: float = 1.0, stalls: int = 0
) -> dict[float, Lateness]:
    """The slave twice as late as the master; the limit is 20 us in 1000 wake-ups, of which some miss a period.

    `missed` are those of the slave at 1 kHz, and as many more as its rate is higher.
    """
    made = {}
    for hz in of or RATES_HZ:
        late = np.full(1000, 20.0)
        late[:stalls] = 1.5e6 / hz
        slave = side(hz, late_us=late_us, missed=missed * int(hz) // 1000, cpu_s=cpu_s)
        master = side(hz, late_us=late_us / 2.0, missed=0, cpu_s=cpu_s / 2.0)
        made[hz] = Lateness(hz, {"master": master, "slave": slave}, LatenessLimit("cyclictest 2.40", late))
    return made


def latency(position_us: float = 100.0, force_us: float = 120.0, bare_us: float = 100.0) -> Latency:
    coded, bare = (
        {"position": np.full(10, there), "force": np.full(10, back)}
        for there, back in ((position_us, force_us), (100.0, bare_us))
    )
    return Latency(OneWay(coded, bare), OneWay(coded, bare))


def judged(found: dict[float, Lateness], ways: Latency) -> dict[str, tuple[float | None, bool | None]]:
    return {target.name: (target.value, target.met) for target in targets(found, ways)}


def test_targets_judge_the_worse_side_and_way_and_are_met_at_the_bound() -> None:
    slow = latency(90.0, 99.0, 66.0)
    found = judged(rates(late_us=20.0, cpu_s=(1.0 - 1e-9) * SHARE * 10.0, missed=11, stalls=1), slow)
    expected: dict[str, float] = {"cpu_share_1khz": SHARE, "work_p50_us_1khz": WORK_US, "one_way_p50_us": 99.0}
    expected |= {f"one_way_{name}_ratio": 1.5 for name in ("p50", "p99", "every_p50", "every_p99")}
    expected |= {f"lateness_p99_ratio_{khz}khz": 1.0 for khz in (1, 2, 4)}
    expected |= {f"missed_share_{khz}khz": 0.0011 for khz in (1, 2, 4)}  # the limit's is 1 in 1001
    assert {name: value for name, (value, _) in found.items()} == pytest.approx(expected)
    assert all(met for _, met in found.values())
    assert judged(rates(1000.0), latency())["missed_share_1khz"] == (0.0, True), "where the limit has none"


def test_targets_beyond_the_bound_are_missed() -> None:
    late = rates(late_us=20.1, cpu_s=SHARE * 10.1, missed=13, stalls=1)
    for each in late[1000.0].sides.values():
        each.records["work_us"] = WORK_US + 0.1
    assert {met for _, met in judged(late, latency(151.0, 90.0)).values()} == {False}
