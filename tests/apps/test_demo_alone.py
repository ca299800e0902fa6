"""The demonstration imports, opens and installs nothing of other systems and makers."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import requires
from pathlib import Path

import pytest

from tests.apps.monitor.monitors import Monitor
from tests.program import ROOT
from tests.wait import until

OUTSIDE = ("anywhere", "franka", "foxglove", "inverse3", "ros2")
"""Extras for other systems and makers."""
PACKAGES = ("aioice", "foxglove", "pylibfranka", "rosbags", "segno", "twisted", "websockets", "wormhole", "zenoh")
LIBRARIES = ("libHD", "libdhd", "libfranka", "zenoh", "foxglove")
LISTENS = "0A"
"""State of a listening socket in /proc/net/tcp."""


def family(pid: int) -> list[int]:
    """A process and all its descendants."""
    found = [pid]
    for each in found:
        for task in Path(f"/proc/{each}/task").glob("*/children"):
            found += map(int, task.read_text().split())
    return found


def sockets(pids: list[int], table: str) -> list[list[str]]:
    """Rows of a table of /proc/net that belong to these processes."""
    inodes = set[str]()
    for pid in pids:
        for descriptor in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(FileNotFoundError):  # closed meanwhile
                inodes |= set(re.findall(r"socket:\[(\d+)\]", str(descriptor.readlink())))
    rows = [line.split() for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]]
    return [row for row in rows if row[9] in inodes]


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[int]]:
    """Processes of a demonstration whose two sides are connected."""
    with Monitor(tmp_path_factory.mktemp("demo"), "--scripted", "--duration", 60, command="try") as monitor:
        monitor.until_said(r"session (\d+): slave")
        yield until(lambda: pids if len(pids := family(monitor.pid)) >= 4 else None, "launcher and daemons")


@pytest.mark.realtime
def test_demonstration_maps_no_library_of_others(demonstration: list[int]) -> None:
    maps = "".join(Path(f"/proc/{pid}/maps").read_text() for pid in demonstration)
    assert "libpython" in maps or "python3" in maps
    assert [name for name in LIBRARIES if name in maps] == []


@pytest.mark.realtime
def test_demonstration_opens_its_page_and_its_link(demonstration: list[int]) -> None:
    def ports() -> set[str]:
        return {row[1].split(":")[1] for table in ("udp", "udp6") for row in sockets(demonstration, table)}

    until(lambda: len(ports()) >= 2, "a socket of each side")
    listening = [row for table in ("tcp", "tcp6") for row in sockets(demonstration, table) if row[3] == LISTENS]
    assert ([row[1].split(":")[0] for row in listening], len(ports())) == (["0100007F"], 2)


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


def test_demonstration_installs_nothing_of_others() -> None:
    wanted = [each for each in requires("weberlink") or () if any(f'"{extra}"' in each for extra in OUTSIDE)]
    names = {re.split(r"[^\w-]", each)[0] for each in wanted}
    assert {"aioice", "segno", "pylibfranka", "foxglove-sdk", "eclipse-zenoh", "rosbags"} <= names
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    installed = {line.split("==")[0] for line in lines if "==" in line}
    assert "aiohttp" in installed
    assert names & installed == set()
