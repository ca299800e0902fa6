"""Two hosts and a wire between them: network namespaces, the same file on both, a key, and no loopback."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.system.processes import Program, document, faults_of, until
from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.system.configuration import load

pytestmark = pytest.mark.realtime

ROBOT, OPERATOR = "10.213.47.1", "10.213.47.2"


def ip(*arguments: str) -> None:
    """Run `ip`; skip, with its own words, where it is not permitted."""
    ended = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        refusal = ended.stderr.strip()
        if "not permitted" in refusal or "denied" in refusal:
            pytest.skip(f"ip {' '.join(arguments)}: {refusal}")
        pytest.fail(f"ip {' '.join(arguments)}: {refusal}")


@pytest.fixture
def hosts() -> Iterator[tuple[str, str]]:
    """Names of two namespaces, the robot's and the operator's, joined by a pair of interfaces."""
    if shutil.which("ip") is None:
        pytest.skip("there is no `ip` to make network namespaces with")
    names = f"wl{os.getpid()}r", f"wl{os.getpid()}o"
    with ExitStack() as made:
        for name in names:
            ip("netns", "add", name)
            made.callback(ip, "netns", "del", name)  # and with it what it holds
        robot, operator = names
        ip("-n", robot, "link", "add", "wire", "type", "veth", "peer", "name", "wire", "netns", operator)
        for name, address in ((robot, ROBOT), (operator, OPERATOR)):
            ip("-n", name, "address", "add", f"{address}/30", "dev", "wire")
            ip("-n", name, "link", "set", "wire", "up")
        yield names


def test_two_hosts_with_the_same_file_exchange_position_and_force(hosts: tuple[str, str], tmp_path: Path) -> None:
    key, file = tmp_path / "weberlink.key", tmp_path / "lan.yaml"
    assert CliRunner().invoke(app, ["keygen", str(key)]).exit_code == 0
    shipped = (CONFIGS / "lan.yaml").read_text(encoding="utf-8")
    placed = shipped.replace("slave: 192.0.2.1:47000", f"slave: {ROBOT}:47000").replace(
        "key_file: weberlink.key", f"key_file: {key}"
    )
    assert ROBOT in placed
    assert str(key) in placed
    patient = placed.replace("silence_ms: 100 ", "silence_ms: 1000 ")  # a busy machine is no fault of the link
    assert patient != placed
    file.write_text(patient, encoding="utf-8")
    assert load(file).system.link.security == "psk"
    robot, operator = (("ip", "netns", "exec", name) for name in hosts)
    with Program("slave", file, "--json", "-", prefix=robot) as slave:
        waiting = slave.telemetry("slave")
        until(lambda: waiting.last["tick"] > 0, "the slave to listen")
        with Program("master", file, "--duration", 2, "--json", "-", prefix=operator) as master:
            master.engaged("master")
            felt = master.finish()
        slave.send(signal.SIGTERM)
        moved = slave.finish()
    assert [(status, errors) for status, _, errors in (felt, moved)] == [(0, "")] * 2
    operators, robots = document(felt[1]), document(moved[1])
    assert (operators["outcome"], robots["outcome"]) == ("completed", "terminated")
    assert (faults_of(operators), faults_of(robots)) == ({"master": {}}, {"slave": {}})
    assert operators["position"]["packets"] > 0
    assert robots["force"]["packets"] > 0
    for summary in (operators, robots):
        assert summary["link"]["received"] > 8  # two seconds of at least a heartbeat every 200 ms
    told = waiting.records
    assert told["updates_received"].max() > 0
    assert told["position"].any()
    assert told["raw"].any()
