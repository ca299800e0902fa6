"""`weberlink master FILE` and `weberlink slave FILE`: two programs that find, lose and refuse each other."""

import os
import signal
import socket
import subprocess
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.program import ENGAGED, Program, Records, Telemetry, document, faults_of, free_port, weberlink
from tests.wait import until
from weberlink.cli import app
from weberlink.protocol.states import State
from weberlink.system.launcher import sweep
from weberlink.telemetry.fault import Fault

realtime = pytest.mark.realtime

TICK = 1e-3
SILENCE = 0.1
FORCE = 10.0
RAMP = 0.05
WEBER = 0.1
HALF_STEP = 0.5e-3 * 3**0.5
APPROACH = 0.1
SPEED = 2.0
QUIET = 500
"""Records without a drop after which none is expected."""
RIGHT, WRONG = "right.key", "wrong.key"

# The hand comes from the side, presses on a plane and stays there. The robot begins inside the plane, so that the first
# force of a session is no small one.
SYSTEM = f"""
link:
  listen: 127.0.0.1:PORT
  slave: 127.0.0.1:PORT
  security: psk
  key_file: {RIGHT}
  silence_ms: {1e3 * SILENCE}
codec: {{force: {{weber: {WEBER}}}}}
master:
  device:
    driver: operator
    home_m: [0.02, 0.02, 0.02]
    script:
      - {{motion: press, at_m: [0, 0, 0], height_m: 0.002, approach_s: 0.3, duration_s: 0.2, hold_s: 600}}
  limits: {{force_n: {FORCE}, ramp_ms: {1e3 * RAMP}}}
slave:
  robot: {{driver: point, home_m: [0, 0, -0.01]}}
  scene: [{{shape: plane, stiffness_n_m: 500}}]
  limits: {{on_silence: hold, approach_speed_m_s: {APPROACH}, speed_m_s: {SPEED}, ramp_ms: {1e3 * RAMP}}}
"""


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two keys."""
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


def stop(program: Program) -> tuple[int, str, str]:
    program.send(signal.SIGTERM)
    return program.finish()


def norms(vectors: Records) -> Records:
    lengths: Records = np.linalg.norm(vectors, axis=-1)
    return lengths


def in_contact(master: Telemetry) -> bool:
    """Whether the operator has felt a force for a while that is not being faded."""
    lately = master.records[-100:]
    felt = (lately["state"] == ENGAGED) & (lately["ramping"] == 0) & (norms(lately["output"]) > 1.0)
    return len(lately) == 100 and bool(felt.all())


def heard_last(records: Records) -> float:
    """A time by which the last of the datagrams that are counted in the records had arrived [s]."""
    last = records[1:][np.diff(records["datagrams_received"].astype(np.int64)) > 0][-1]
    return float(last["at"] + 1e-6 * (last["lateness_us"] + last["work_us"]))


def parted(records: Records, successor: Telemetry) -> tuple[Records, Records, Records]:
    """What the survivor recorded up to its last tick without the new session, the safe part of it, and the rest."""
    lived = records["at"] >= successor.started
    first = int(np.argmax(lived & (records["state"] == ENGAGED) & (records["fault"] == Fault.NONE)))
    alone, limit = records[:first], heard_last(records[~lived]) + SILENCE + TICK
    return alone, alone[alone["at"] >= limit], records[first - 1 :]


def tick_times(records: Records) -> Records:
    """When each tick began [s]."""
    times: Records = records["at"] + 1e-6 * records["lateness_us"].astype(np.float64)
    return times


@realtime
def test_two_programs_find_and_lose_each_other_and_a_stranger_disturbs_none(system: Path) -> None:
    """Nothing but processes and sockets can be killed: first the slave in contact, then the master, each replaced."""
    wrong = ("--set", f"link.key_file={system.parent / WRONG}")
    with (
        Program("slave", system, "--json", "-") as slave,
        Program("master", system, *wrong, "--json", "-") as stranger,
    ):
        listening, calling = slave.telemetry("slave"), stranger.telemetry("master")
        until(lambda: listening.last["datagrams_dropped"] >= 3, "calls without proof")
        assert set(listening.records["state"]) == {State.LISTENING.value}
        with Program("master", system, "--json", "-") as master:
            felt = master.engaged("master")
            called = listening.last["datagrams_dropped"]
            until(lambda: listening.last["datagrams_dropped"] >= called + 2, "more calls without proof")
            until(lambda: in_contact(felt), "contact")
            os.kill(listening.pid, signal.SIGKILL)
            killed_slave = slave.finish()
            until(lambda: felt.last["fault"] == Fault.SILENCE, "silence")
            with Program("slave", system, "--json", "-") as next_slave:
                moved = next_slave.engaged("slave")
                until(lambda: in_contact(felt) and not moved.last["ramping"], "contact with the new slave")
                os.kill(felt.pid, signal.SIGKILL)
                killed_master = master.finish()
                until(lambda: moved.last["fault"] == Fault.SILENCE, "silence of the master")
                with Program("master", system, "--take-over") as next_master:
                    arrived = next_master.engaged("master")
                    until(lambda: moved.last["state"] == ENGAGED and not moved.last["ramping"], "the robot to arrive")
                    ended = stop(next_slave)
        strange_records = calling.records
        strange = stop(stranger)
    alone, safe, back = parted(felt.records, moved)
    check_let_go(alone, safe, listening.records)
    check_fade_in(back, moved.records)
    _, safe, back = parted(moved.records, arrived)
    assert len(safe) > 0 and (safe["output"] == safe["output"][0]).all()
    check_approach(back)
    assert set(strange_records["state"]) == {State.CONNECTING.value} and not strange_records["output"].any()
    assert (killed_slave[0], document(killed_slave[1])["outcome"]) == (1, "failed: slave killed by signal 9")
    assert (killed_master[0], document(killed_master[1])["outcome"]) == (1, "failed: master killed by signal 9")
    assert ended[0] == 0 and "silence" in faults_of(document(ended[1]))["slave"]
    assert faults_of(document(strange[1])) == {"master": {}}
    assert document(strange[1])["drops"] == {"master": {}}, "nothing is answered before the key is proved"


def check_let_go(alone: Records, safe: Records, sent: Records) -> None:
    tick_before_last_sent = sent[:-1][np.diff(sent["datagrams_sent"].astype(np.int64)) > 0][-1]
    before = alone["at"] < tick_before_last_sent["at"]  # both are on one clock
    assert norms(alone["output"][before])[-1] > 1.0  # there was something to let go
    assert len(safe) > 0
    assert safe["at"][0] > tick_before_last_sent["at"] + SILENCE
    assert not safe["output"].any()


def check_fade_in(back: Records, reactions: Records) -> None:
    """Between ticks the force changes by what the ramp allows, and by what an update may correct.

    An update corrects a prediction that was off by no more than the deadband one tick of the slave before, plus what
    the contact and its fading in changed in that tick. Two ticks of the slave may fall between two of the master, whose
    grids are not aligned.
    """
    assert not back["output"][0].any()
    in_session = reactions[reactions["state"] == ENGAGED]
    assert norms(in_session["raw"])[0] > 3.0  # without the ramp this would be felt at once
    contact_change = norms(np.diff(in_session["raw"], axis=0)) + FORCE * np.diff(tick_times(in_session)) / RAMP
    correction = 2.0 * (in_session["bound"].max() + HALF_STEP + contact_change.max())
    allowed = FORCE * np.diff(tick_times(back)) / RAMP + correction
    jumps = norms(np.diff(back["output"], axis=0))
    assert (jumps <= allowed).all()


def check_approach(back: Records) -> None:
    told = back[back["updates_received"] > back["updates_received"][0]]
    known = told[(told["position"] != back["position"][0]).any(axis=1)][0]  # engaged maybe a tick after the update
    assert norms(known["position"] - known["output"]) > 0.01  # the new master is elsewhere
    known_from = back["at"] >= known["at"]
    arrived = np.logical_or.accumulate(known_from & (back["output"] == back["position"]).all(axis=1))
    assert arrived[-1]
    steps, elapsed = norms(np.diff(back["output"], axis=0)), np.diff(tick_times(back))
    assert (steps <= np.where(arrived[:-1], SPEED, APPROACH) * elapsed + 1e-9).all()


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


@pytest.mark.parametrize(("side", "mode"), [("master", None), ("slave", 0o644)])
def test_a_key_that_cannot_be_used_is_one_line(system: Path, tmp_path: Path, side: str, mode: int | None) -> None:
    key = tmp_path / "key"
    if mode is not None:
        key.write_text((system.parent / RIGHT).read_text())
        key.chmod(mode)
    status, output, errors = weberlink(side, system, "--set", f"link.key_file={key}")
    assert (status, output, len(errors.splitlines())) == (2, "", 1)
    assert str(key) in errors and "link.key_file" in errors


@pytest.mark.parametrize("side", ["master", "slave"])
def test_single_side_has_no_session_key(system: Path, side: str) -> None:
    status, output, errors = weberlink(side, system, "--set", "link.security=session")
    assert (status, output, len(errors.splitlines())) == (2, "", 1)
    assert "link.security" in errors


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
