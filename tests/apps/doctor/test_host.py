"""How the machine is read: files, and the questions that no file answers."""

import os
import sys
import time
from pathlib import Path

import pytest

from tests.apps.doctor.machine import machine
from weberlink.apps.doctor import Host
from weberlink.apps.doctor import host as hosts
from weberlink.apps.doctor.host import Unreadable


def test_a_file_is_read_or_says_why_not(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/here": " 17\n", "proc/text": "much"})
    assert (host.read("/proc/here"), host.number("proc/here")) == ("17", 17)
    for path, words in (("/proc/none", "no such file"), ("/proc", "Is a directory"), ("/proc/text", "no number")):
        with pytest.raises(Unreadable, match=words):
            host.number(path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_what_only_root_may_read_says_so(tmp_path: Path) -> None:
    host = machine(tmp_path, {"proc/secret": "x"})
    (tmp_path / "proc/secret").chmod(0)
    with pytest.raises(Unreadable, match="without root"):
        host.read("/proc/secret")


def test_paths_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    host = machine(tmp_path, {f"sys/cpu{number}/x": "" for number in (10, 2, 1)})
    assert host.find("/sys/cpu[0-9]*/x") == ["/sys/cpu1/x", "/sys/cpu2/x", "/sys/cpu10/x"]


def test_a_container_is_known_by_its_file(tmp_path: Path) -> None:
    assert not machine(tmp_path).in_container
    assert machine(tmp_path, {"run/.containerenv": ""}).in_container


def test_a_tool_that_is_not_there_or_does_not_end_is_unreadable(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Host().run(sys.executable, "-c", "print('seen'); raise SystemExit(3)") == (3, "seen\n")
    with pytest.raises(Unreadable, match="cannot be run"):
        Host().run("no-such-tool-of-ours")
    monkeypatch.setattr(hosts, "TOOL_LIMIT_S", 0.2)
    with pytest.raises(Unreadable, match="timed out"):
        Host().run(sys.executable, "-c", "import time; time.sleep(60)")


def test_a_name_service_that_hangs_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hosts, "LOOK_UP_LIMIT_S", 0.05)
    monkeypatch.setattr(hosts.socket, "getaddrinfo", lambda *_, **__: time.sleep(0.5))
    with pytest.raises(Unreadable, match="does not answer within"):
        Host().resolve("robot")


def test_the_real_answers_are_of_the_kind_that_checks_expect() -> None:
    host = Host()
    assert host.affinity()
    assert host.resolution_ns() >= 1.0
    assert isinstance(host.clock_is_synchronised(), bool)
    total, free = host.space(Path("/"))
    assert 0 <= free <= total
    assert host.resolve("127.0.0.1") == ["127.0.0.1"]
    assert host.route("127.0.0.1") == "127.0.0.1"
    assert Path(host.program.split()[0]).is_absolute()
