"""The bridge to ROS 2 beside a live session of 1 kHz, received by zenoh-ros2-sdk.

    python -m trials.ros2 [--seconds 60] [--period 10] [--json OUT]

Periods with and without bridge and receiver alternate in one session. It prints for each topic the messages lost and
the latency from the deadline of the tick to the callback in the receiver's Python, and for each side the lateness of
the ticks with and without. The exit status is 1 if a topic is missing or has no messages.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic, sleep, time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trials.rig import Command, Loopback
from weberlink.system.configuration import MASTER, SIDES, SLAVE

POSE, WRENCH = (f"geometry_msgs/msg/{name}Stamped" for name in ("Pose", "Wrench"))
TOPICS = {
    "/weberlink/hand": POSE,
    "/weberlink/felt": WRENCH,
    "/weberlink/robot": POSE,
    "/weberlink/measured": WRENCH,
    "/tf": "tf2_msgs/msg/TFMessage",
}
STREAMS = {
    **dict.fromkeys(("/weberlink/hand", "/weberlink/felt", "/tf hand"), MASTER),
    **dict.fromkeys(("/weberlink/robot", "/weberlink/measured", "/tf robot"), SLAVE),
}
"""What is received of the topics, and whose ticks they show."""
ALL = len(TOPICS) + 3
"""And scene, bodies and diagnostics."""
PORT = 17_447
PATIENCE_S = 60.0
SETTLE_S = 1.0
"""After processes have started or ended [s]."""
NOTHING: dict[str, list[int]] = {"stamps_ns": [], "received_ns": []}
SAME_TICK_S = 0.0004

Array = NDArray[np.float64]
Period = tuple[float, float]
Found = dict[str, Any]


def receive(session: str, period_s: float) -> tuple[Period, Found, Found]:
    """One period with bridge and receiver: its time, the topics listed, and what was received of each."""
    with Command("bridge", "ros2", "--session", session, "--connect", f"tcp/127.0.0.1:{PORT}"):
        command = [sys.executable, "-m", "tests.ros2.sdk", str(PORT), "0", str(ALL)]
        judge = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert judge.stdout is not None
        listed = json.loads(judge.stdout.readline())
        sleep(SETTLE_S)
        begin = monotonic()
        sleep(period_s)
        end = monotonic()
        sleep(SETTLE_S)
        output, _ = judge.communicate(timeout=PATIENCE_S)
    sleep(SETTLE_S)
    return (begin, end), listed, json.loads(output)


def arrivals(stream: Mapping[str, Any], ticks_at: Array, period: Period, wall_offset_s: float) -> Found:
    """What became of the ticks of a side in a period: lost, received twice, with which latency."""
    expected = ticks_at[(ticks_at >= period[0]) & (ticks_at < period[1])]
    stamps = np.asarray(stream["stamps_ns"], np.int64)
    latency_us = (np.asarray(stream["received_ns"], np.int64) - stamps) * 1e-3
    at = stamps * 1e-9 - wall_offset_s
    chosen = (at >= period[0] - SAME_TICK_S) & (at < period[1] + SAME_TICK_S)
    at, latency_us = np.sort(at[chosen]), latency_us[chosen]
    found = np.searchsorted(at, expected + SAME_TICK_S) - np.searchsorted(at, expected - SAME_TICK_S)
    gap = float(np.diff(at, prepend=period[0], append=period[1]).max())
    counts = {"ticks": len(expected), "lost": int(np.sum(found == 0)), "twice": int(np.sum(found > 1))}
    return counts | {"longest_gap_ms": 1e3 * gap, "latency_us": latency_us}


def judged(heard: Sequence[Mapping[str, Any]], ticks_at: Array, periods: list[Period], offset_s: float) -> Found:
    """What became of the messages of one stream in all periods."""
    each = [arrivals(stream, ticks_at, period, offset_s) for stream, period in zip(heard, periods, strict=True)]
    return {
        **{name: sum(one[name] for one in each) for name in ("ticks", "lost", "twice")},
        "lost_by_period": [one["lost"] for one in each],
        "longest_gap_ms": round(max(one["longest_gap_ms"] for one in each), 1),
        "latency_us": percentiles(np.concatenate([one["latency_us"] for one in each])),
    }


def percentiles(values: Array) -> dict[str, float]:
    if not len(values):
        return {}
    names = ("p50", "p99", "p99.9", "max")
    return dict(zip(names, np.percentile(values, (50, 99, 99.9, 100)).round(1).tolist(), strict=True))


def overwritten(heard: Mapping[str, Any]) -> int | None:
    """Ticks that the bridge could not read in time, by its last diagnostics; None without any."""
    statuses = heard.get("/diagnostics", {"newest": {"status": []}})["newest"]["status"]
    own = [pair for status in statuses if status["name"] == "weberlink: bridge" for pair in status["values"]]
    return next((int(pair["value"]) for pair in own if pair["key"] == "ticks lost"), None)


def run(seconds: float, period_s: float) -> Found:
    heard: list[Found] = []
    unlisted: set[str] = set()
    periods: dict[str, list[Period]] = {"without the bridge": [], "with bridge and receiver": []}
    apart, beside = periods.values()
    with Loopback() as session:
        sleep(2 * SETTLE_S)
        for _ in range(max(1, round(seconds / period_s))):
            begin = monotonic()
            sleep(period_s)
            apart.append((begin, monotonic()))
            period, listed, received = receive(session.name, period_s)
            beside.append(period)
            heard.append(received)
            unlisted |= {name for name, kind in TOPICS.items() if listed.get(name) != [kind]}
        offset_s = time() - monotonic()
        ticks = {side: session.sides[side].records for side in SIDES}
    lateness: Found = {side: {} for side in SIDES}
    for side, records in ticks.items():
        for name, each in periods.items():
            inside = [records[(records["at"] >= begin) & (records["at"] < end)] for begin, end in each]
            lateness[side][name] = percentiles(np.concatenate(inside)["lateness_us"])
    return {
        "topics_not_listed": sorted(unlisted),
        "ticks_lost_by_the_bridge": [overwritten(each) for each in heard],
        "streams": {
            name: judged([each.get(name, NOTHING) for each in heard], ticks[side]["at"], beside, offset_s)
            for name, side in STREAMS.items()
        },
        "tick_lateness_us": lateness,
        "seconds": sum(end - begin for begin, end in beside),
        "load_average": os.getloadavg(),
        "processors": os.cpu_count(),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--period", type=float, default=10.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    document = run(options.seconds, options.period)
    text = json.dumps(document, indent=2)
    if options.json is not None:
        options.json.write_text(text + "\n", encoding="utf-8")
    sys.stdout.write(text + "\n")
    is_complete = not document["topics_not_listed"] and all(s["latency_us"] for s in document["streams"].values())
    return 0 if is_complete else 1


if __name__ == "__main__":
    sys.exit(main())
