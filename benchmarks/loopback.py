"""`weberlink loopback` started as its user starts it, and observed through the rings of both sides.

It uses only what other versions of the program have too.
"""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from signal import SIGTERM
from time import monotonic, sleep
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError
from benchmarks.live_side import LiveSide, Resources, resources
from weberlink.config import SIDES
from weberlink.protocol.states import State
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path

START_LIMIT_S, SETTLE_S, LOOK_S, READ_EVERY_S = 60.0, 1.0, 0.005, 0.25


class Session:
    """`weberlink loopback` as its user starts it, observed through the rings of both sides.

    Args:
        file: the configuration.
        overrides: of the file, with a free port.
        environment: of the processes; None for that of this one.
    """

    def __init__(self, file: Path, overrides: Sequence[str], environment: Mapping[str, str] | None = None) -> None:
        options = [word for override in overrides for word in ("--set", override)]
        self._began = monotonic()
        self._program = subprocess.Popen(  # noqa: S603
            [sys.executable, "-m", "weberlink", "loopback", str(file), "--json", "-", *options],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        )  # fmt: skip
        self._rings: dict[str, RingReader] = {}

    def start_s(self) -> float:
        """Wait until both sides are engaged; time from the start to the first such tick of the later one [s]."""
        firsts: dict[str, float] = {}
        while len(firsts) < len(SIDES):
            if self._program.poll() is not None:
                assert self._program.stderr is not None
                said = self._program.stderr.read().strip().splitlines()[-1:]
                raise BenchError(f"weberlink loopback: {' '.join(said) or 'ended before its session'}")
            if monotonic() > self._began + START_LIMIT_S:
                raise BenchError(f"weberlink loopback: no session in {START_LIMIT_S:g} s")
            for side in SIDES:
                if side not in self._rings:
                    with suppress(FileNotFoundError):
                        self._rings[side] = RingReader(default_path(f"{self._program.pid}-{side}"))
                elif side not in firsts:
                    records = self._rings[side].read()
                    engaged = records[records["state"] == State.ENGAGED.value]
                    if len(engaged):
                        firsts[side] = float(engaged["at"][0] + engaged["lateness_us"][0] * 1e-6)
            sleep(LOOK_S)
        return max(firsts.values()) - self._began

    def observe(self, duration_s: float, rate_hz: float = MAIN_RATE_HZ) -> dict[str, LiveSide]:
        """Both sides over a time after a first second, in which caches and estimates settle."""
        sleep(SETTLE_S)
        for ring in self._rings.values():
            ring.read()
        records: dict[str, list[NDArray[np.void]]] = {side: [] for side in self._rings}
        used: dict[str, list[tuple[float, Resources]]] = {side: [] for side in self._rings}
        until = monotonic() + duration_s
        while True:
            for side, ring in self._rings.items():
                used[side].append((monotonic(), self._resources(side, ring.pid)))
                records[side].append(ring.read())
            left = until - monotonic()
            if left <= 0.0:
                break
            sleep(min(READ_EVERY_S, left))
        return {side: LiveSide(np.concatenate(records[side]), rate_hz, used[side]) for side in self._rings}

    def _resources(self, side: str, pid: int) -> Resources:
        try:
            return resources(pid)
        except OSError:
            raise BenchError(f"weberlink loopback: the {side} ended during the measurement") from None

    def end(self) -> dict[str, Any]:
        """End it in order; its report."""
        self._program.send_signal(SIGTERM)
        try:
            said, complaint = self._program.communicate(timeout=START_LIMIT_S)
        except subprocess.TimeoutExpired:
            raise BenchError("weberlink loopback: did not end after SIGTERM") from None
        if self._program.returncode:
            raise BenchError(f"weberlink loopback: {' '.join(complaint.strip().splitlines()[-1:])}")
        report: dict[str, Any] = json.loads(said)
        return report

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End it in any case; a killed launcher would leave its rings."""
        for ring in self._rings.values():
            ring.close()
        if self._program.poll() is None:
            self._program.send_signal(SIGTERM)
            with suppress(subprocess.TimeoutExpired):
                self._program.wait(START_LIMIT_S)
        self._program.kill()
        self._program.communicate()


def live_run(arrangement: Arrangement, rate_hz: float, duration_s: float) -> dict[str, LiveSide]:
    """Run both sides and observe them; returns them by name.

    Raises:
        BenchError: if a side ends by itself, or they do not connect.
        ConfigurationError: if the file or an override is wrong.
    """
    overrides = arrangement.overrides(rate_hz)
    arrangement.configuration(overrides)
    with Session(arrangement.file, overrides) as session:
        session.start_s()
        sides = session.observe(duration_s, rate_hz)
        report = session.end()
    return {
        name: replace(side, realtime=report["realtime"][name], faults=report["faults"][name])
        for name, side in sorted(sides.items())
    }
