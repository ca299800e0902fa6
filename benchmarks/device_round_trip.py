"""An emulated PHANTOM over a pty at 1 kHz: time of an exchange, age of a sample, time from a fault to zero force.

The limit is a bare echo over a pty between two processes with the same rights. The emulator is a process of its own,
`weberlink emulate polhem_serial`; the driver runs here, in a loop on absolute deadlines. Ends by itself.

    python -m benchmarks.device_round_trip --seconds 30 --faults 20
"""

import argparse
import json
import os
import subprocess
import sys
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import IO, Any

from benchmarks.percentiles import summary
from weberlink.geometry.vector import Vector
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.polhem.serial_device import PolhemSerialDevice
from weberlink.realtime.process import prepare
from weberlink.system.environment import environment, footer

TICK = 0.001
WATCHDOG_S = 0.1
"""Watchdog of the device itself [s]."""
PUSH: Vector = (0.0, 0.0, 1.0)
FAULTS = ("garble 100000", "late 0.05", "silent", "unplug")


class Emulated:
    """A running `weberlink emulate polhem_serial`.

    Args:
        folder: for its port and its FIFO.
    """

    def __init__(self, folder: Path) -> None:
        self.port = folder / "phantom"
        self._fifo = folder / "faults"
        self._process = subprocess.Popen(  # noqa: S603
            [
                *(sys.executable, "-m", "weberlink", "emulate", "polhem_serial"),
                *("--link", str(self.port), "--faults", str(self._fifo)),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout is not None
        self._answers: IO[str] = self._process.stdout
        self._answers.readline()  # its first line names the port, which is then open

    def say(self, line: str) -> None:
        with self._fifo.open("w") as fifo:
            fifo.write(line + "\n")

    def status(self) -> dict[str, Any]:
        self.say("status")
        while not (line := self._answers.readline()).startswith("{"):
            pass
        answer: dict[str, Any] = json.loads(line)
        return answer

    def end(self) -> None:
        self._process.terminate()
        self._process.wait()
        self._answers.close()


@contextmanager
def emulated() -> Iterator[Emulated]:
    with TemporaryDirectory() as folder:
        device = Emulated(Path(folder))
        try:
            yield device
        finally:
            device.end()


def driver(port: Path) -> PolhemSerialDevice:
    options = PolhemSerialDevice.Options(port=str(port), model="vintage_phantom")
    checked = PolhemSerialDevice.fingerprint(options)
    return PolhemSerialDevice(options.model_copy(update={"signs_checked": checked}), TICK)


def ticks(seconds: float) -> Iterator[float]:
    due = monotonic()
    end = due + seconds
    while due < end:
        due = max(due + TICK, monotonic())
        sleep(max(0.0, due - monotonic()))
        yield monotonic()


def exchanges(seconds: float) -> tuple[list[float], list[float], int, int]:
    """Round trips and ages of the samples at a tick [us], samples, ticks."""
    trips, ages, last, count = [], [], -1.0, 0
    with emulated() as there:
        device = driver(there.port)
        device.open(monotonic())
        try:
            for now in ticks(seconds):
                reading = device.latest(now)
                device.command(PUSH, now)
                count += 1
                ages.append((now - reading.at) * 1e6)
                if reading.at != last:
                    last = reading.at
                    trips.append(device.round_trip_s * 1e6)
        finally:
            device.close()
    return trips, ages, len(trips), count


def bare_echo(seconds: float) -> list[float]:
    """Round trips of 16 bytes over a pty that another process returns at once [us]."""
    near, far = os.openpty()
    tty.setraw(far)
    child = os.fork()
    if child == 0:
        while data := os.read(near, 64):
            os.write(near, data)
            if data.startswith(b"end"):
                os._exit(0)
    trips = []
    for _ in ticks(seconds):
        began = monotonic()
        os.write(far, bytes(16))
        select((far,), (), ())
        os.read(far, 64)
        trips.append((monotonic() - began) * 1e6)
    os.write(far, b"end")
    os.waitpid(child, 0)
    os.close(near)
    os.close(far)
    return trips


def time_to_zero(fault: str) -> float:
    """From the fault to the last moment with force on the hand [s], by the emulated device."""
    with emulated() as there:
        device = driver(there.port)
        device.open(monotonic())
        try:
            for now in ticks(0.3):
                device.latest(now)
                device.command(PUSH, now)
            there.say(fault)
            began = monotonic()
            try:
                for now in ticks(0.3):
                    device.latest(now)
                    device.command(PUSH, now)
            except DeviceFault:
                pass
        finally:
            device.close()
        ended = there.status()["last_force_at"]
        return max(0.0, float(ended) - began)


def main() -> int:
    """Run and print; returns 1 if the 99th percentile exceeds a tick, or a fault leaves force for too long."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--faults", type=int, default=5, help="repetitions of each fault")
    asked = parser.parse_args()
    rights = prepare(50, lock_memory=True, cpu=None)
    trips, ages, samples, count = exchanges(asked.seconds)
    write = sys.stdout.write
    write(f"{count} ticks, {samples} fresh samples ({100 * samples / count:.1f} %); {rights.priority.detail}\n")
    write("                       p50      p90      p99    p99.9      max us\n")
    rows = (("bare echo", bare_echo(asked.seconds)), ("exchange", trips), ("age of a sample", ages))
    for name, values in rows:
        write(f"{name:17}{''.join(f'{value:9.0f}' for value in summary(values).values())}\n")
    write(f"time to zero force, beside the device's own watchdog of {WATCHDOG_S * 1e3:.0f} ms:\n")
    slowest = 0.0
    for fault in FAULTS:
        times = [time_to_zero(fault) for _ in range(asked.faults)]
        slowest = max(slowest, *times)
        write(f"  {fault:14} median {median(times) * 1e3:5.1f} ms, most {max(times) * 1e3:5.1f} ms\n")
    write(f"{os.cpu_count()} processors; {footer(environment())}\n")
    return 0 if (summary(trips)["p99"] or 0.0) < TICK * 1e6 and slowest < WATCHDOG_S else 1


if __name__ == "__main__":
    sys.exit(main())
