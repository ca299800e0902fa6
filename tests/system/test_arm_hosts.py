"""A Koch leader and an SO-101 follower, emulated on their buses, on two hosts over a bad link.

`WEBERLINK_SECONDS=60 WEBERLINK_FIGURES=arms.jsonl pytest --hunt 1 tests/system/test_arm_hosts.py` gives the figures of
docs/arms/README.md.
"""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.program import ENGAGED, Program, Telemetry, document
from tests.system.namespaces import ROBOT, ip
from tests.system.systems import CONFIGS
from tests.wait import until
from weberlink.cli import app

pytestmark = [pytest.mark.realtime(alone=True), pytest.mark.hunt]

SECONDS = float(os.environ.get("WEBERLINK_SECONDS", "10"))
"""Of the session whose figures are printed."""
FIGURES = os.environ.get("WEBERLINK_FIGURES")
"""File to which the figures are appended as JSON; None to keep none."""
BAD = "{delay_ms: 50, loss: 0.05, seed: 1}"
SILENCE_S = 0.4
LATEST_S = SILENCE_S + 0.2
"""After a loss of the peer, torque is gone and the follower holds: the limit, and what a busy machine adds."""
GOAL = 1e-6


class Pair(NamedTuple):
    """Two hosts, the file that both have, and how to run a program on each."""

    file: Path
    folder: Path
    operator: tuple[str, ...]
    robot: tuple[str, ...]


@pytest.fixture
def pair(hosts: tuple[str, str], tmp_path: Path) -> Iterator[Pair]:
    """The shipped file of the two arms, at the emulated buses and over the bad link."""
    robot, operator = (("ip", "netns", "exec", name) for name in hosts)
    key, leader, follower = (tmp_path / name for name in ("weberlink.key", "leader", "follower"))
    assert CliRunner().invoke(app, ["keygen", str(key)]).exit_code == 0
    walls = "walls=[{joint: elbow_flex, angle_rad: 0.15}, {joint: gripper, angle_rad: 0.5, below: true}]"
    text = (CONFIGS / "koch-so101.yaml").read_text(encoding="utf-8")
    placed = (
        text.replace("slave: 192.0.2.1:47000", f"slave: {ROBOT}:47000")
        .replace("key_file: weberlink.key", f"key_file: {key}")
        .replace("port: /dev/koch_leader", f"port: {leader}")
        .replace("port: /dev/so101_follower", f"port: {follower}")
    )
    file = tmp_path / "arms.yaml"
    file.write_text(placed, encoding="utf-8")
    with ExitStack() as running:
        for name, link, sets in (("koch_leader", leader, ()), ("so101_follower", follower, ("--set", walls))):
            running.enter_context(Program("device", "emulate", name, "--link", link, *sets))
            until(link.exists, f"the emulated {name}")
        yield Pair(file, tmp_path, operator, robot)


def sides(pair: Pair, running: ExitStack, *options: object, seconds: float = 600.0) -> tuple[Program, Program]:
    """Master and slave on their hosts, in session."""
    over = ("--set", f"link.emulate={BAD}", *options)
    slave = running.enter_context(
        Program("slave", pair.file, "--json", "-", "--record", pair.folder / "slave.mcap", *over, prefix=pair.robot)
    )
    waiting = slave.telemetry("slave")
    until(lambda: waiting.last["tick"] > 0, "the slave to listen")
    master = running.enter_context(
        Program(
            "master", pair.file, "--duration", seconds, "--json", "-", "--record", pair.folder / "master.mcap", *over,
            prefix=pair.operator,
        )
    )  # fmt: skip
    return master, slave


def led(telemetry: Telemetry) -> Telemetry:
    """Wait until force has faded in (master), or the follower has reached the leader (slave)."""
    until(lambda: telemetry.last["state"] == ENGAGED and telemetry.last["ramping"] == 0, "the arms to be together")
    return telemetry


def test_session_over_bad_link(pair: Pair) -> None:
    with ExitStack() as running:
        master, slave = sides(pair, running, seconds=SECONDS)
        felt = master.finish(SECONDS)
        slave.send(signal.SIGTERM)
        slave.finish()
    assert felt[0] == 0, felt[2]
    assert document(felt[1])["outcome"] == "completed"
    told = CliRunner().invoke(
        app, ["record", "info", str(pair.folder / "master.mcap"), str(pair.folder / "slave.mcap"), "--json", "-"]
    )
    summary: dict[str, Any] = document(told.stdout)
    tell({key: figures for key, figures in summary.items() if key not in ("files", "environment")})
    for name in ("joint_torque", "joint_angle", "gripper_torque", "gripper_angle"):
        assert summary[name]["reduction"] > 0.8
    assert summary["energy"]["link_generated_j"] < 1e-3
    assert summary["joint_torque"]["packets"] > 0


def tell(figures: object) -> None:
    """Keep a figure for whoever asked for them."""
    if FIGURES is not None:
        with Path(FIGURES).open("a", encoding="utf-8") as file:
            file.write(json.dumps(figures) + "\n")


@pytest.mark.parametrize("victim", ["master", "slave"])
def test_kill_of_either_end_stops_the_other(pair: Pair, victim: str) -> None:
    with ExitStack() as running:
        master, slave = sides(pair, running)
        ends = {"master": led(master.engaged("master")), "slave": led(slave.engaged("slave"))}
        sleep(3.0)
        os.kill(ends[victim].pid, signal.SIGKILL)
        at = monotonic()
        sleep(2.0)
        check_stopped(ends, "slave" if victim == "master" else "master", at, f"kill -9 of the {victim}")


@pytest.mark.parametrize("way", ["to the robot", "to the operator"])
def test_cut_of_one_way_stops_both_ends(pair: Pair, hosts: tuple[str, str], way: str) -> None:
    robot, operator = hosts
    with ExitStack() as running:
        master, slave = sides(pair, running)
        ends = {"master": led(master.engaged("master")), "slave": led(slave.engaged("slave"))}
        sleep(3.0)
        name, lost = (operator, "10.213.47.1/32") if way == "to the robot" else (robot, "10.213.47.2/32")
        ip("-n", name, "route", "add", "blackhole", lost)
        at = monotonic()
        sleep(2.0)
        for side in ends:
            check_stopped(ends, side, at, f"cut of the way {way}")


def check_stopped(ends: dict[str, Telemetry], side: str, at: float, what: str) -> None:
    """The leader displays no torque, and the follower's command stands still, from soon after `at` on."""
    records = ends[side].records
    output, times = np.asarray(records["joint_output"], dtype=float), records["at"] - at
    moving = np.abs(output).max(axis=1) > GOAL
    if side == "slave":
        moving = np.concatenate([[False], np.abs(np.diff(output, axis=0)).max(axis=1) > GOAL])
    last = float(times[moving].max()) if moving.any() else -np.inf
    before = np.abs(output[times < 0]).max() if side == "master" else None
    tell({"event": what, "side": side, "still_after_s": last, "torque_before_nm": before})
    assert moving[(times > -1.0) & (times < 0.0)].any(), "there was torque or motion to end"
    assert times[-1] > LATEST_S
    assert last < LATEST_S
