"""A wall clock steps for who preloads it, at once and while it runs, and no other clock does."""

import os
import subprocess
import sys
from pathlib import Path
from time import time

import pytest

from tests.soak.wallclock import wall_clock

SHOW = """
import time
print(time.time(), time.clock_gettime(time.CLOCK_REALTIME), time.monotonic(), time.perf_counter())
"""


def test_step_is_seen_by_running_and_new_processes(tmp_path: Path) -> None:
    with wall_clock(tmp_path) as clock:
        if clock is None:
            pytest.skip("no C compiler")
        assert clock.witnessed() == pytest.approx(0.0, abs=30.0)
        for offset in (3600, -3600, 0):
            clock.step(offset)
            assert clock.witnessed() == pytest.approx(offset, abs=30.0)
            shown = subprocess.run(
                [sys.executable, "-c", SHOW],
                env={**os.environ, **clock.environment},
                capture_output=True,
                text=True,
                check=True,
            )
            wall, realtime, monotonic, counter = map(float, shown.stdout.split())
            assert wall - time() == pytest.approx(offset, abs=30.0)
            assert realtime - time() == pytest.approx(offset, abs=30.0)
            uptime = float(Path("/proc/uptime").read_text(encoding="ascii").split()[0])
            assert monotonic == pytest.approx(uptime, abs=60.0)
            assert counter == pytest.approx(uptime, abs=60.0)
        assert clock.asked > 0
    assert abs(time() - float(shown.stdout.split()[0])) < 60.0
