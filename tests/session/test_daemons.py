"""`weberlink master FILE` and `weberlink slave FILE`: two programs that find, lose and refuse each other."""

import os
import signal
import socket
import subprocess
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.program import ENGAGED, Program, Telemetry, document, faults_of, free_port, weberlink
from tests.wait import until
from weberlink.cli import app
from weberlink.protocol.states import State
from weberlink.session.launcher import sweep
from weberlink.session.waiting import WaitingDaemon, received
from weberlink.telemetry.fault import Fault

RIGHT, WRONG = "right.key", "wrong.key"

# The robot begins inside the plane on which the hand presses, so that the first force of a session is no small one.
SYSTEM = f"""
link: {{listen: 127.0.0.1:PORT, slave: 127.0.0.1:PORT, security: psk, key_file: {RIGHT}}}
master:
  device:
    driver: operator
    home_m: [0.02, 0.02, 0.02]
    script:
      - {{motion: press, at_m: [0, 0, 0], height_m: 0.002, approach_s: 0.3, duration_s: 0.2, hold_s: 600}}
slave:
  robot: {{driver: point, home_m: [0, 0, -0.01]}}
  scene: [{{shape: plane, stiffness_n_m: 500}}]
"""


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    for name in (RIGHT, WRONG):
        assert CliRunner().invoke(app, ["keygen", str(folder / name)]).exit_code == 0
    return folder


@pytest.fixture
def system(keys: Path) -> Path:
    """The file of both sides, with a port that is free."""
    port = free_port()
    path = keys / f"system-{port}.yaml"
    path.write_text(SYSTEM.replace("PORT", str(port)))
    return path


def port_of(system: Path) -> int:
    return int(system.stem.partition("-")[2])


def in_contact(master: Telemetry) -> bool:
    """Whether the operator has felt a force for a while that is not being faded."""
    lately = master.records[-100:]
    forces = np.linalg.norm(lately["output"], axis=-1)
    felt = (lately["state"] == ENGAGED) & (lately["ramping"] == 0) & (forces > 1.0)
    return len(lately) == 100 and bool(felt.all())


@pytest.mark.realtime
def test_two_programs_find_and_lose_each_other_and_a_stranger_disturbs_none(system: Path) -> None:
    """Nothing but processes and sockets can be killed: first the slave in contact, then the master, each replaced."""
    wrong = ("--set", f"link.key_file={system.parent / WRONG}")
    with Program("slave", system, "--json", "-") as slave, Program("master", system, *wrong, "--json", "-") as stranger:
        listening, calling = slave.telemetry("slave"), stranger.telemetry("master")
        until(lambda: listening.last["datagrams_dropped"] >= 3, "calls without proof")
        assert set(listening.records["state"]) == {State.LISTENING.value}
        with Program("master", system, "--json", "-") as master:
            felt = master.engaged("master")
            called = listening.last["datagrams_dropped"]
            until(lambda: listening.last["datagrams_dropped"] >= called + 2, "more calls without proof")
            until(lambda: in_contact(felt), "contact")
            os.kill(listening.pid, signal.SIGKILL)
            until(lambda: felt.last["fault"] == Fault.SILENCE, "silence")
            until(lambda: not felt.last["output"].any(), "no force")
            killed_slave = slave.finish()
            with Program("slave", system, "--json", "-") as next_slave:
                moved = next_slave.engaged("slave")
                until(lambda: in_contact(felt) and not moved.last["ramping"], "contact with the new slave")
                killed_at = monotonic()
                os.kill(felt.pid, signal.SIGKILL)
                until(lambda: moved.last["fault"] == Fault.SILENCE, "silence of the master")
                killed_master = master.finish()
                held = moved.last["output"]
                with Program("master", system, "--take-over") as next_master:
                    next_master.engaged("master")
                    until(lambda: moved.last["state"] == ENGAGED and not moved.last["ramping"], "the robot to arrive")
                    next_slave.send(signal.SIGTERM)
                    ended = next_slave.finish()
        strange_records = calling.records
        stranger.send(signal.SIGTERM)
        strange = stranger.finish()
    records = moved.records
    silent = (records["fault"] == Fault.SILENCE) & (records["state"] == State.SILENT.value)
    first = int(np.argmax(silent & (records["at"] > killed_at)))
    alone = records["output"][first : first + int(np.argmin(silent[first:]))]
    assert (alone == held).all(), "the robot holds until it is led again"
    assert set(strange_records["state"]) == {State.CONNECTING.value} and not strange_records["output"].any()
    assert (killed_slave[0], document(killed_slave[1])["outcome"]) == (1, "failed: slave was killed by SIGKILL")
    assert (killed_master[0], document(killed_master[1])["outcome"]) == (1, "failed: master was killed by SIGKILL")
    assert ended[0] == 0, ended
    assert "silence" in faults_of(document(ended[1]))["slave"]
    assert faults_of(document(strange[1])) == {"master": {}}
    assert document(strange[1])["drops"] == {"master": {}}, "nothing is answered before the key is proved"


@pytest.mark.parametrize("where", ["127.0.0.1:PORT", "203.0.113.9:47000"], ids=["in use", "of no host here"])
def test_an_address_that_cannot_be_listened_on_is_one_line_and_the_report_says_so(
    system: Path, where: str, capfd: pytest.CaptureFixture[str]
) -> None:
    where = where.replace("PORT", str(port_of(system)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", port_of(system)))
        status, output, _ = weberlink("slave", system, "--set", f"link.listen={where}", "--json", "-")
    errors = capfd.readouterr().err  # of the daemon
    assert status == 1
    assert len(errors.splitlines()) == 1
    assert where in errors and where in document(output)["outcome"]


@pytest.mark.parametrize("mode", [None, 0o644])
def test_a_key_that_cannot_be_used_is_one_line(system: Path, tmp_path: Path, mode: int | None) -> None:
    key = tmp_path / "key"
    if mode is not None:
        key.write_text((system.parent / RIGHT).read_text())
        key.chmod(mode)
    status, output, errors = weberlink("slave", system, "--set", f"link.key_file={key}")
    assert (status, output, len(errors.splitlines())) == (2, "", 1)
    assert str(key) in errors and "link.key_file" in errors


def test_what_killed_processes_left_is_removed_when_it_is_old(tmp_path: Path) -> None:
    dead = subprocess.Popen(["true"])
    dead.wait()
    names = [f"weberlink-{pid}-{side}" for pid in (dead.pid, os.getpid()) for side in ("master.ring", "slave.ask")]
    names[:0] = [f"weberlink-{dead.pid}.key", f"weberlink-{dead.pid}.pointer"]
    fresh = tmp_path / f"weberlink-{dead.pid}-slave.json"
    other = tmp_path / "weberlink-mine.ring"
    for path in (*(tmp_path / name for name in names), fresh, other):
        path.touch()
        if path != fresh:
            os.utime(path, (0, 0))
    sweep([tmp_path])
    assert {path.name for path in tmp_path.iterdir()} == {*names[4:], fresh.name, other.name}


# --- daemons that wait for their order


def test_the_death_of_the_launcher_is_no_order() -> None:
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.close()
    assert received(its.detach()) is None


def test_a_daemon_without_an_order_is_not_left_behind() -> None:
    with WaitingDaemon("slave") as waiting:
        child = waiting.child
        assert child.running
    assert not child.running
