"""Poses of a third party's publisher on their way to a daemon: how many are lost, and how old they are.

    python -m trials.devices.ros2_poses [SECONDS [RATE_HZ]]

zenoh-ros2-sdk publishes in a process of its own, the listener hears it in another, and this one reads at 1 kHz as a
daemon does. The age of a pose is from before its message is made to the tick that reads it.
"""

import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, sleep

import numpy as np

from plugins.ros2.tests.rigs import endpoint, listening
from tests.program import ROOT
from weberlink.realtime.process import prepare
from weberlink.testing.time import TICK, until
from weberlink_ros2.process import ListenerProcess

SDK = "trials.devices.ros2_publisher"


def main(seconds: float = 60.0, rate_hz: float = 1000.0) -> None:
    router = endpoint()
    with TemporaryDirectory() as folder, listening(router, frame_id=None) as process:
        command = [sys.executable, "-m", SDK, folder, router.rpartition(":")[2], str(rate_hz)]
        sdk = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert sdk.stdout is not None
        assert sdk.stdin is not None
        sdk.stdout.readline()
        sdk.stdin.write("clock\n")
        sdk.stdin.flush()
        until(process.newest, "a pose", pause=1e-3)
        sys.stdout.write(f"reader: {prepare(50, lock_memory=False, cpu=None).priority.detail}\n")
        try:
            tell(*read(process, seconds), seconds)
        finally:
            sdk.communicate()


def read(process: ListenerProcess, seconds: float) -> tuple[list[float], list[tuple[float, float, float]]]:
    """Lateness of each tick [s]; of each pose its number, when it was made and when a tick read it [s]."""
    late, poses = list[float](), list[tuple[float, float, float]]()
    due = monotonic()
    ends = due + seconds
    while due < ends:
        due += TICK
        sleep(max(0.0, due - monotonic()))
        now = monotonic()
        late.append(now - due)
        while (target := process.newest(most=1)) is not None:  # each, where a daemon takes the newest
            poses.append((target.target[0], target.target[1], now))
    return late, poses


def tell(late: list[float], poses: list[tuple[float, float, float]], seconds: float) -> None:
    numbers, made, read_at = np.array(poses).T
    published, ages = numbers[-1] - numbers[0] + 1, (read_at - made) * 1e3
    sys.stdout.write(
        f"ticks late p99 {np.percentile(late, 99) * 1e6:.0f} us, max {max(late) * 1e3:.1f} ms\n"
        f"{published:.0f} poses published in {seconds:g} s, {published - len(numbers):.0f} lost or refused, "
        f"longest run {np.diff(numbers).max() - 1:.0f}\n"
        f"age p50 {np.percentile(ages, 50):.2f}, p99 {np.percentile(ages, 99):.2f}, max {ages.max():.1f} ms\n"
    )


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
