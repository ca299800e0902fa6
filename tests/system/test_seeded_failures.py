"""Failures made on purpose, and what the report says of each: the table in docs/operation/logs.md, row by row."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest

from tests.apps.test_hardware import Emulated
from tests.program import ROOT, Program, document, free_port
from tests.safety.observed_link import ObservedLink, observed
from tests.system.systems import CONFIGS, configuration
from tests.system.test_stopped_process import FILE, PRESS
from tests.wait import until
from weberlink.master.devices.haply.device import HaplyDevice
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.keys import generate
from weberlink.protocol.states import State
from weberlink.system import control_socket
from weberlink.system.composition.channels import banks
from weberlink.system.scoring.session import SessionScore
from weberlink.system.simulate import simulate
from weberlink.system.verdict import LOST_S, verdict
from weberlink.telemetry.reader import RingReader
from weberlink.telemetry.ring import default_path, process_started

TIMES = r"(?:once|\d+ times)"
PAGE = (ROOT / "docs" / "operation" / "logs.md").read_text(encoding="utf-8")
LOOPBACK = CONFIGS / "loopback.yaml"
CALM = ("--set", "rate_hz=250", "--set", "link.silence_ms=500", "--json", "-")
"""Light enough that several sessions run side by side."""


@dataclass(frozen=True)
class Row:
    """What a run reported, or what the page says of it: the verdict in one line, and the exit status."""

    line: str
    status: int
    errors: str = ""


def table() -> dict[str, Row]:
    """The rows of the page by what was done."""
    rows = re.findall(r"^\| (.+?) \| `((?:good|degraded|failed)[^`]*)` \| (\d) \|$", PAGE, re.M)
    return {done: Row(line, int(status)) for done, line, status in rows}


ROWS = table()
Reports = dict[str, Row]


def report(ended: tuple[int, str, str]) -> Row:
    """What a program said at its end."""
    status, output, errors = ended
    told = document(output)["verdict"]
    return Row(f"{told['word']} because {'; '.join(each['text'] for each in told['causes'])}", status, errors)


# --- live: every function makes one session or more


def state(program: Program, side: str) -> int:
    """Of the newest record; unlike `Telemetry`, it may be asked for after any time."""
    with RingReader(default_path(f"{program.pid}-{side}")) as ring:
        return int(ring.read()["state"][-1])


def waited(program: Program, side: str, seconds: float) -> None:
    """Until a side has recorded for so long; not counted from its start, after which a busy host may hold it up."""
    calling = program.telemetry(side)
    until(lambda: np.ptp(calling.records["at"]) > seconds if len(calling.records) else False, f"the {side} to wait")


def stop(program: Program) -> Row:
    program.send(signal.SIGTERM)
    return report(program.finish())


class Pair:
    """A free address and a key of a master and a slave that are commands of their own."""

    def __init__(self, folder: Path, name: str) -> None:
        self.key = folder / f"{name}.key"
        generate(self.key)
        address = f"127.0.0.1:{free_port()}"
        settings = (f"link.listen={address}", f"link.slave={address}", "link.security=psk")
        self._arguments = (LOOPBACK, *CALM, *(each for setting in settings for each in ("--set", setting)))

    def program(self, side: str, *overrides: str, key: Path | None = None, options: tuple[object, ...] = ()) -> Program:
        sets = [each for override in (f"link.key_file={key or self.key}", *overrides) for each in ("--set", override)]
        return Program(side, *self._arguments, *sets, *options)


def master_then_slave_lost(folder: Path) -> Reports:
    pair = Pair(folder, "slave-lost")
    with pair.program("slave") as slave, pair.program("master") as master:
        felt, moved = master.engaged("master"), slave.engaged("slave")
        for pid in (slave.pid, moved.pid):  # its daemon would stop in order if the command died
            os.kill(pid, signal.SIGKILL)
        until(lambda: felt.last["state"] == State.SILENT.value, "silence")
        sleep(LOST_S + 0.2)
        return {"`kill -9` of the slave on the other host; the master": stop(master)}


def other_masters(folder: Path) -> Reports:
    """One slave: a master with other settings is refused, a second one takes over and is killed."""
    pair = Pair(folder, "masters")
    with (
        pair.program("slave") as slave,
        pair.program("master") as first,
        pair.program("master", "codec.force.weber=0.2", "link.names.master=ann") as other,
    ):
        first.engaged("master")
        refused = report(other.finish())
        with pair.program("master", "link.names.master=bob", options=("--take-over",)) as second:
            killed = second.engaged("master")
            replaced = report(first.finish())
            for pid in (second.pid, killed.pid):
                os.kill(pid, signal.SIGKILL)
            until(lambda: state(slave, "slave") == State.SILENT.value, "silence")
            sleep(LOST_S + 0.2)
        return {
            "another configuration at the other end; the master": refused,
            "another master takes over; the first one": replaced,
            "`kill -9` of the master on the other host; the slave": stop(slave),
        }


def another_key(folder: Path) -> Reports:
    pair = Pair(folder, "right")
    wrong = folder / "wrong.key"
    generate(wrong)
    with pair.program("slave") as slave, pair.program("master", key=wrong) as master:
        called = slave.telemetry("slave")
        until(lambda: called.last["datagrams_dropped"] >= 3, "calls without proof")
        waited(master, "master", 3.8)
        return {"another key; the master": stop(master), "another key; the slave": stop(slave)}


def no_slave(folder: Path) -> Reports:
    with Pair(folder, "alone").program("master") as master:
        waited(master, "master", 1.5)
        return {"no slave at the address; the master": stop(master)}


def slave_leaves(folder: Path) -> Reports:
    pair = Pair(folder, "leaves")
    with pair.program("slave") as slave, pair.program("master") as master:
        felt = master.engaged("master")
        slave.engaged("slave")
        stop(slave)
        until(lambda: felt.last["state"] == State.CONNECTING.value, "the master to call again")
        sleep(1.3)
        return {"Ctrl-C at the slave, the master goes on; the master": stop(master)}


def loopback(act: Callable[[Program], None], *options: object) -> Row:
    with Program("loopback", *CALM, *options) as program:
        for side in ("master", "slave"):
            program.engaged(side)
        act(program)
        return report(program.finish())


def kill_daemon(_: Path) -> Reports:
    """The other daemon ends in order: without force, and nothing is left."""
    with Program("loopback", *CALM) as program:
        master, slave = (program.engaged(side) for side in ("master", "slave"))
        os.kill(slave.pid, signal.SIGKILL)
        row = report(program.finish())
        assert all(": note: " in line for line in row.errors.splitlines() if line.startswith("weberlink")), row.errors
        until(lambda: not any(process_started(each.pid) for each in (master, slave)), "the end of both daemons")
        assert program.rings() == []
        assert not master.last["output"].any()
    return {"`kill -9` of one daemon of `loopback`": row}


def stop_daemon(_: Path) -> Reports:
    def act(program: Program) -> None:
        master = program.engaged("master").pid
        os.kill(master, signal.SIGSTOP)
        sleep(1.2)
        os.kill(master, signal.SIGCONT)
        sleep(1.0)
        program.send(signal.SIGTERM)

    row = loopback(act)
    return {"`SIGSTOP` to a daemon for a second": row, "a fifth of the ticks missed": row}


def emergency(folder: Path) -> Reports:
    """After the recorder was killed."""

    def act(program: Program) -> None:
        os.kill(program.recorder(), signal.SIGKILL)
        sleep(0.5)
        control_socket.ask(default_path(f"{program.pid}-master"), {"emergency": True})

    row = loopback(act, "--record", folder / "killed.mcap")
    return {"`kill -9` of the recorder": row, "an emergency stop": row}


def unplugged(folder: Path) -> Reports:
    with Emulated("haply_2diy", folder, PRESS, "handle.tremor_m=0") as haply:
        file = folder / "haply.yaml"
        checked = HaplyDevice.fingerprint(HaplyDevice.Options())
        file.write_text(FILE.format(port=haply.port, checked=checked), encoding="utf-8")
        with Program("loopback", file, "--json", "-") as program:
            program.engaged("master")
            haply.say("unplug")
            return {"the device unplugged": report(program.finish())}


LIVE = (
    master_then_slave_lost, other_masters, another_key, no_slave, slave_leaves, kill_daemon, stop_daemon,
    emergency, unplugged,
)  # fmt: skip


# --- in virtual time


def of(summary: dict[str, Any]) -> Row:
    return Row(verdict(summary).line, summary["status"])


def virtual(*overrides: str, file: str = "loopback.yaml", duration: float = 4.0) -> Row:
    return of(simulate(configuration(*overrides, file=file), duration)[0])


def cut(for_s: float, *, to_slave: bool = True) -> Row:
    """The link carries nothing in one direction from 2 s on; a run of 6 s, which the master ends in order."""
    loaded = configuration()
    score = SessionScore(loaded.system.rate_hz, *banks(loaded.system))
    links = ObservedLink(Emulation(blackouts=((2.0, for_s),))), ObservedLink()
    observed(loaded, *(links if to_slave else links[::-1])).run(6.0, [score])
    summary = score.summary() | {"outcome": "completed"}
    return of(summary | {"status": verdict(summary).status})


def full_disk(folder: Path) -> Row:
    """A file may grow to 200 kB, which stops the recorder as a full disk does."""
    command = [sys.executable, "-m", "weberlink", "simulate", LOOPBACK, "--duration", "4", "--json", "-"]
    limited = ["prlimit", "--fsize=200000", *command, "--record", folder / "full.mcap"]
    done = subprocess.run(limited, cwd=ROOT, capture_output=True, text=True, check=False)
    return report((done.returncode, done.stdout, done.stderr))


VIRTUAL: dict[str, Callable[[Path], Row]] = {
    "no room for the recording": full_disk,
    "30 % of the datagrams lost": lambda _: virtual("link.emulate={loss: 0.3, seed: 3}"),
    "60 ms of delay": lambda _: virtual("link.emulate={delay_ms: 30, seed: 3}", "control.scheme=none"),
    "a contact stronger than `slave.limits.trip_n`": lambda _: virtual("slave.limits.trip_n=3"),
    "a scene stiffer than `master.limits.force_n`": lambda _: virtual("master.limits.force_n=0.5"),
    "the link cut in one direction for 2 s": lambda _: cut(2.0),
    "the link cut in one direction until the end": lambda _: cut(inf),
    "nothing": lambda _: virtual(),
}


def same(said: Row, written: Row) -> None:
    """The word, every cause of the page, and the status; numbers may differ, and the host may add causes and stalls."""

    def shape(line: str) -> str:
        line = re.sub(rf"the (?:master|slave) {TIMES}(?: and the slave {TIMES})?,", "a process,", line)
        return re.sub(r"(?:127\.0\.0\.1:)?\d+(?:\.\d+)?", "#", line)

    word, _, causes = written.line.partition(" because ")
    assert said.line.split()[0] == word, said
    for cause in filter(None, causes.split("; ")):
        assert shape(cause) in shape(said.line), said
    assert said.status == written.status, said


def test_the_page_has_the_failures() -> None:
    assert len(ROWS) >= 15
    assert VIRTUAL.keys() <= ROWS.keys()


@pytest.mark.parametrize("done", VIRTUAL)
def test_report_in_virtual_time_is_as_written(done: str, tmp_path: Path) -> None:
    same(VIRTUAL[done](tmp_path), ROWS[done])


@pytest.mark.parametrize("to_slave", [True, False])
def test_link_cut_in_one_direction_to_the_end_is_a_lost_peer(to_slave: bool) -> None:
    said = cut(60.0, to_slave=to_slave)
    assert said.status == 1
    assert said.line.startswith("failed because the slave was lost")


LIVE_ROWS = sorted(set(ROWS) - set(VIRTUAL))


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Reports:
    folder = tmp_path_factory.mktemp("failures")

    def made(make: Callable[[Path], Reports]) -> Reports:
        try:
            return make(folder)
        except (Exception, pytest.fail.Exception) as error:  # of one session; the others are told all the same
            return {make.__name__: Row(repr(error), -1)}

    with ThreadPoolExecutor(3) as pool:
        return {done: row for reports in pool.map(made, LIVE) for done, row in reports.items()}


@pytest.mark.hunt
@pytest.mark.realtime(alone=True)
def test_every_live_row_of_the_page_is_made(live: Reports) -> None:
    assert [row.line for row in live.values() if row.status == -1] == []
    assert sorted(live.items()) == sorted((done, live.get(done)) for done in LIVE_ROWS)


@pytest.mark.hunt
@pytest.mark.realtime(alone=True)
@pytest.mark.parametrize("done", LIVE_ROWS)
def test_live_report_is_as_written(done: str, live: Reports) -> None:
    same(live[done], ROWS[done])


@pytest.mark.hunt
@pytest.mark.realtime(alone=True)
@pytest.mark.parametrize("side", ["master", "slave"])
def test_another_key_is_told_at_once_on_both_sides(side: str, live: Reports) -> None:
    told = re.findall(
        r"^weberlink: .*are the keys the same on both hosts\?$", live[f"another key; the {side}"].errors, re.M
    )
    assert len(told) == 1
