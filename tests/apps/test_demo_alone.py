"""The demonstration imports nothing of other systems and makers."""

import subprocess
import sys

PACKAGES = ("aioice", "foxglove", "pylibfranka", "rosbags", "segno", "twisted", "websockets", "wormhole", "zenoh")


def test_demonstration_imports_nothing_of_others() -> None:
    """Of the program that serves the page; tests/system/test_imports.py looks at the daemons."""
    told = "import sys, weberlink.cli, weberlink.apps.monitor.program; print(*sys.modules)"
    there = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True).stdout.split()
    assert "aiohttp" in there
    assert [name for name in (*PACKAGES, "weberlink_anywhere") if name in there] == []
