"""Two hosts and a wire between them: network namespaces, the same file on both, a key, and no loopback."""

import signal
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.program import Program, document, faults_of
from tests.system.namespaces import ROBOT
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.cli import app
from weberlink.system.configuration import load

pytestmark = pytest.mark.realtime


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
