"""The demonstration imports and maps nothing of other systems and makers."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.apps.monitor.monitors import Monitor
from tests.wait import until

PACKAGES = ("aioice", "foxglove", "pylibfranka", "rosbags", "segno", "twisted", "websockets", "wormhole", "zenoh")
LIBRARIES = ("libHD", "libdhd", "libfranka", "zenoh", "foxglove")


def family(pid: int) -> list[int]:
    """A process and all its descendants."""
    found = [pid]
    for each in found:
        for task in Path(f"/proc/{each}/task").glob("*/children"):
            found += map(int, task.read_text().split())
    return found


@pytest.mark.realtime
def test_demonstration_maps_no_library_of_others(tmp_path: Path) -> None:
    with Monitor(tmp_path, "--scripted", "--duration", 60, command="try") as monitor:
        monitor.until_said(r"session (\d+): slave")
        pids = until(lambda: pids if len(pids := family(monitor.pid)) >= 4 else None, "launcher and daemons")
        maps = "".join(Path(f"/proc/{pid}/maps").read_text() for pid in pids or ())
    assert "libpython" in maps or "python3" in maps
    assert [name for name in LIBRARIES if name in maps] == []


def test_demonstration_imports_nothing_of_others() -> None:
    """Of the program that serves the page; tests/system/test_imports.py looks at the daemons."""
    told = "import sys, weberlink.cli, weberlink.apps.monitor.program; print(*sys.modules)"
    there = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True).stdout.split()
    assert "aiohttp" in there
    others = (
        *PACKAGES,
        *(f"weberlink.{name}" for name in ("anywhere", "ros2", "apps.bridge.ros2", "apps.bridge.foxglove")),
    )
    assert [name for name in others if name in there] == []
