"""The bridge to ROS 2 beside a live session of 1 kHz, received by zenoh-ros2-sdk.

    python -m tests.ros2.trial [--seconds 60] [--period 10] [--json OUT]

Periods with and without bridge and receiver alternate in one session. It prints for each topic the messages lost and
the latency from the deadline of the tick to the callback in the receiver's Python, and for each side the lateness of
the ticks with and without. The exit status is 1 if a topic is missing or has no messages.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from signal import SIGTERM
from threading import Event, Thread
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from weberlink.watching.rings import RingOpener, RingSource, find_rings

TOPICS = {
    "/weberlink/hand": "geometry_msgs/msg/PoseStamped",
    "/weberlink/felt": "geometry_msgs/msg/WrenchStamped",
    "/weberlink/robot": "geometry_msgs/msg/PoseStamped",
    "/weberlink/measured": "geometry_msgs/msg/WrenchStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
}
STREAMS = {
    "/weberlink/hand": "master",
    "/weberlink/felt": "master",
    "/tf hand": "master",
    "/weberlink/robot": "slave",
    "/weberlink/measured": "slave",
    "/tf robot": "slave",
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


class Session:
    """A loopback session, and the ticks of its sides so far."""

    def __init__(self, duration_s: float) -> None:
        command = [sys.executable, "-m", "weberlink", "loopback", "--duration", str(round(duration_s))]
        self._process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.name = str(self._process.pid)
        self._sources: list[RingSource] = []
        self._pieces: dict[str, list[Any]] = defaultdict(list)
        opener, give_up = RingOpener(), time.monotonic() + PATIENCE_S
        while len(self._sources) < 2:
            if time.monotonic() > give_up or self._process.poll() is not None:
                raise SystemExit("the session did not start")
            time.sleep(0.1)
            opened = (opener.open(ring) for ring in find_rings(None).get(self.name, {}).values())
            self._sources += [source for source in opened if source is not None]
        self._over = Event()
        self._reader = Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        while not self._over.wait(0.1):
            for source in self._sources:
                records = source.read()
                if len(records):
                    self._pieces[source.side].append((records["at"].copy(), records["lateness_us"].astype(float)))

    def ticks(self, side: str) -> tuple[Array, Array]:
        """Deadlines [s] and lateness [us] of all ticks so far."""
        at, lateness = zip(*list(self._pieces[side]), strict=True)
        return np.concatenate(at), np.concatenate(lateness)

    def close(self) -> None:
        self._over.set()
        self._reader.join()
        self._process.send_signal(SIGTERM)
        self._process.wait(PATIENCE_S)
        for source in self._sources:
            source.close()


@contextmanager
def bridge(session: str) -> Iterator[None]:
    command = [sys.executable, "-m", "weberlink", "bridge", "ros2", "--session", session]
    process = subprocess.Popen([*command, "--connect", f"tcp/127.0.0.1:{PORT}"], stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.send_signal(SIGTERM)
        process.wait(PATIENCE_S)


def receive(session: str, period_s: float) -> tuple[Period, dict[str, Any], dict[str, Any]]:
    """One period with bridge and receiver: its time, the topics listed, and what was received of each."""
    with bridge(session):
        command = [sys.executable, "-m", "tests.ros2.sdk", str(PORT), "0", str(ALL)]
        judge = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert judge.stdout is not None
        listed = json.loads(judge.stdout.readline())
        time.sleep(SETTLE_S)
        begin = time.monotonic()
        time.sleep(period_s)
        end = time.monotonic()
        time.sleep(SETTLE_S)
        output, _ = judge.communicate(timeout=PATIENCE_S)
    time.sleep(SETTLE_S)
    return (begin, end), listed, json.loads(output)


class Arrivals(NamedTuple):
    """What became of the ticks of one period.

    Args:
        ticks: number of them.
        lost: that never came.
        twice: messages that came again.
        longest_gap_ms: between two messages that came.
        latency_us: from the deadline of the tick to the callback of the receiver.
    """

    ticks: int
    lost: int
    twice: int
    longest_gap_ms: float
    latency_us: Array


def arrivals(stream: Mapping[str, Any], ticks_at: Array, period: Period, wall_offset_s: float) -> Arrivals:
    """Compare what was received with the ticks of the side in a period."""
    expected = ticks_at[(ticks_at >= period[0]) & (ticks_at < period[1])]
    stamps = np.asarray(stream["stamps_ns"], np.int64)
    latency_us = (np.asarray(stream["received_ns"], np.int64) - stamps) * 1e-3
    at = stamps * 1e-9 - wall_offset_s
    chosen = (at >= period[0] - SAME_TICK_S) & (at < period[1] + SAME_TICK_S)
    at, latency_us = np.sort(at[chosen]), latency_us[chosen]
    found = np.searchsorted(at, expected + SAME_TICK_S) - np.searchsorted(at, expected - SAME_TICK_S)
    gaps = np.diff(at, prepend=period[0], append=period[1])
    return Arrivals(len(expected), int(np.sum(found == 0)), int(np.sum(found > 1)), 1e3 * float(gaps.max()), latency_us)


def percentiles(values: Array) -> dict[str, float]:
    if not len(values):
        return {}
    p50, p99, p999 = np.percentile(values, (50, 99, 99.9))
    return {"p50": round(p50, 1), "p99": round(p99, 1), "p99.9": round(p999, 1), "max": round(float(values.max()), 1)}


def inside(session: Session, side: str, periods: list[Period]) -> Array:
    """Lateness of the ticks of a side in some periods [us]."""
    at, lateness = session.ticks(side)
    return np.concatenate([lateness[(at >= begin) & (at < end)] for begin, end in periods])


def run(seconds: float, period_s: float) -> dict[str, Any]:
    cycles = max(1, round(seconds / period_s))
    session = Session(cycles * (2 * period_s + 2 * PATIENCE_S))
    heard: list[dict[str, Any]] = []
    unlisted: set[str] = set()
    apart: list[Period] = []
    beside: list[Period] = []
    try:
        time.sleep(2 * SETTLE_S)
        for cycle in range(cycles):
            begin = time.monotonic()
            time.sleep(period_s)
            apart.append((begin, time.monotonic()))
            period, listed, received = receive(session.name, period_s)
            beside.append(period)
            heard.append(received)
            unlisted |= {name for name, kind in TOPICS.items() if listed.get(name) != [kind]}
            sys.stderr.write(f"{cycle + 1} of {cycles}\n")
        offset_s = time.time() - time.monotonic()
        streams = {
            name: judged([each.get(name, NOTHING) for each in heard], session.ticks(side)[0], beside, offset_s)
            for name, side in STREAMS.items()
        }
        lateness = {
            side: {
                "without the bridge": percentiles(inside(session, side, apart)),
                "with bridge and receiver": percentiles(inside(session, side, beside)),
            }
            for side in ("master", "slave")
        }
    finally:
        session.close()
    return {
        "topics_not_listed": sorted(unlisted),
        "ticks_lost_by_the_bridge": [overwritten(each) for each in heard],
        "streams": streams,
        "tick_lateness_us": lateness,
        "seconds": sum(end - begin for begin, end in beside),
        "load_average": os.getloadavg(),
        "processors": os.cpu_count(),
    }


def overwritten(heard: Mapping[str, Any]) -> int | None:
    """Ticks that the bridge could not read in time, by its last diagnostics; None without any."""
    statuses = heard.get("/diagnostics", {"newest": {"status": []}})["newest"]["status"]
    own = [pair for status in statuses if status["name"] == "weberlink: bridge" for pair in status["values"]]
    return next((int(pair["value"]) for pair in own if pair["key"] == "ticks lost"), None)


def judged(
    heard: Sequence[Mapping[str, Any]], ticks_at: Array, periods: list[Period], offset_s: float
) -> dict[str, Any]:
    """What became of the messages of one stream in all periods."""
    each = [arrivals(stream, ticks_at, period, offset_s) for stream, period in zip(heard, periods, strict=True)]
    return {
        "ticks": sum(one.ticks for one in each),
        "lost": sum(one.lost for one in each),
        "lost_by_period": [one.lost for one in each],
        "twice": sum(one.twice for one in each),
        "longest_gap_ms": round(max(one.longest_gap_ms for one in each), 1),
        "latency_us": percentiles(np.concatenate([one.latency_us for one in each])),
    }


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--period", type=float, default=10.0)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    document = run(options.seconds, options.period)
    text = json.dumps(document, indent=2)
    if options.json is not None:
        options.json.write_text(text + "\n", encoding="utf-8")
    sys.stdout.write(text + "\n")
    listed = not document["topics_not_listed"]
    return 0 if listed and all(stream["latency_us"] for stream in document["streams"].values()) else 1


if __name__ == "__main__":
    sys.exit(main())
