"""Findings of a run with known numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.arrangement import RATES_HZ, Arrangement, Rights
from benchmarks.codec_speed import CodecSpeed
from benchmarks.latency import Latency, Trips
from benchmarks.lateness import Lateness, LatenessLimit
from benchmarks.live_side import LiveSide, Resources
from benchmarks.start_up import StartUp
from benchmarks.study import Findings
from benchmarks.update_cost import UpdateCost
from weberlink.telemetry.reader import DTYPE

ARRANGEMENT = Arrangement(Path("loopback.yaml"), Path("key"), (), lambda _: [])
RIGHTS = Rights(priority=50, lock_memory=True, wakeful=True, cpus=(2, 3))
HOST: Mapping[str, Any] = {
    "findings": {"preemption": "kernel 6.1.0, PREEMPT_RT", "governor": "frequency governor performance"},
    "load_average": [0.01, 0.02, 0.03],
}


def side(rate_hz: float, *, late_us: float, missed: int, cpu_s: float) -> LiveSide:
    """A daemon over 10 s, every tick equally late, all its missed deadlines at once in the middle."""
    records = np.zeros(int(10.0 * rate_hz) - missed, DTYPE)
    records["lateness_us"], records["work_us"], records["codec_us"] = late_us, 50.0, 5.0
    records["ticks_missed"][len(records) // 2 :] = missed
    used = [(0.0, Resources(1.0, 40_000, 12)), (10.0, Resources(1.0 + cpu_s, 40_004, 12))]
    return LiveSide(records, rate_hz, used)


def lateness(
    rate_hz: float, *, late_us: float = 30.0, missed: int = 0, cpu_s: float = 1.0, stalls: int = 0
) -> Lateness:
    """The slave twice as late as the master; the limit is 20 us in 1000 wake-ups, of which some miss a period."""
    sides = {
        "master": side(rate_hz, late_us=late_us / 2.0, missed=0, cpu_s=cpu_s / 2.0),
        "slave": side(rate_hz, late_us=late_us, missed=missed, cpu_s=cpu_s),
    }
    late = np.full(1000, 20.0)
    late[:stalls] = 1.5e6 / rate_hz
    return Lateness(rate_hz, sides, LatenessLimit("cyclictest 2.40", late))


def latency(position_us: float = 100.0, force_us: float = 120.0, *, fast: bool = True) -> Latency:
    """Plain sockets take 50 us each way, sealed ones 100."""
    coded = Trips(np.full(10, position_us), np.full(10, force_us), np.full(10, position_us + force_us))
    plain = Trips(np.full(10, 50.0), np.full(10, 50.0), np.full(10, 100.0))
    sealed = Trips(np.full(10, 100.0), np.full(10, 100.0), np.full(10, 200.0))
    return Latency(coded, plain, sealed, np.full(10, 40.0) if fast else None, "sockperf 3.7" if fast else None)


def codec() -> CodecSpeed:
    return CodecSpeed(2e5, np.full(10, 5.0))


def findings(
    *, rates: Mapping[float, Lateness] | None = None, trips: Latency | None = None, rate: CodecSpeed | None = None
) -> Findings:
    return Findings(
        rates={hz: lateness(hz) for hz in RATES_HZ} if rates is None else rates,
        latency=latency() if trips is None else trips,
        update_cost=UpdateCost(
            {
                "send": {"warm": np.full(9, 12.0), "cold": np.full(9, 57.0)},
                "receive": {"warm": np.full(9, 21.0), "cold": np.full(9, 88.0)},
            }
        ),
        codec=codec() if rate is None else rate,
        start_up=StartUp({"interpreter": [0.02, 0.04, 0.03], "help": [0.3], "loopback": [1.2]}),
        rights=RIGHTS,
        host=HOST,
        run_time_s=120.0,
        steal_share=0.015,
    )
