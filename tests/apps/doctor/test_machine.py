"""Reading the machine: files and system calls."""

import os
import sys
import time
from pathlib import Path

import pytest

from tests.apps.doctor.machines import machine
from weberlink.apps.doctor import Machine
from weberlink.apps.doctor import machine as real
from weberlink.apps.doctor.machine import Unreadable


def test_unreadable_file_gives_the_reason(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/here": " 17\n", "proc/text": "much"})
    assert (host.read("/proc/here"), host.number("proc/here")) == ("17", 17)
    for path, words in (("/proc/none", "no such file"), ("/proc", "Is a directory"), ("/proc/text", "no number")):
        with pytest.raises(Unreadable, match=words):
            host.number(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_file_of_root_is_unreadable_with_reason(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/secret": "x"})
    (tmp_path / "proc/secret").chmod(0)
    with pytest.raises(Unreadable, match="without root"):
        host.read("/proc/secret")


def test_paths_are_in_natural_order(tmp_path: Path) -> None:
    host = machine(tmp_path, {f"sys/cpu{number}/x": "" for number in (10, 2, 1)})
    assert host.find("/sys/cpu[0-9]*/x") == ["/sys/cpu1/x", "/sys/cpu2/x", "/sys/cpu10/x"]


def test_container_is_detected_by_its_file(tmp_path: Path) -> None:
    assert not machine(tmp_path).in_container
    assert machine(tmp_path, {"run/.containerenv": ""}).in_container


def test_missing_or_hanging_tool_is_unreadable(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Machine().run(sys.executable, "-c", "print('seen'); raise SystemExit(3)") == (3, "seen\n")
    with pytest.raises(Unreadable, match="cannot be run"):
        Machine().run("no-such-tool-of-ours")
    monkeypatch.setattr(real, "TOOL_LIMIT_S", 0.2)
    with pytest.raises(Unreadable, match="timed out"):
        Machine().run(sys.executable, "-c", "import time; time.sleep(60)")


def test_hanging_name_service_is_unreadable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real, "LOOK_UP_LIMIT_S", 0.05)
    monkeypatch.setattr(real.socket, "getaddrinfo", lambda *_, **__: time.sleep(0.2))
    with pytest.raises(Unreadable, match="does not answer within"):
        Machine().resolve("robot")


def test_defaults_read_this_machine() -> None:
    host = Machine()
    assert host.affinity()
    assert host.resolution_ns() >= 1.0
    assert isinstance(host.clock_is_synchronised(), bool)
    total, free = host.space(Path("/"))
    assert 0 <= free <= total
    assert host.resolve("127.0.0.1") == ["127.0.0.1"]
    assert host.route("127.0.0.1") == "127.0.0.1"
