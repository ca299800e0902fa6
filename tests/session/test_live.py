"""`weberlink loopback` as its user runs it: processes, signals, sockets, a terminal, and what is left behind (nothing).

One session is changed and stopped; many laws look at what it left. The others end as no orderly one does.
"""

import os
import signal
from dataclasses import dataclass, field
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest

from tests.program import ENGAGED, PATIENT, Program, Records, document, faults_of, weberlink
from tests.session.systems import configuration
from tests.strangers import as_stranger, read_file
from tests.terminals import WIDTH, on_terminal
from tests.wait import PATIENCE, until
from weberlink.session import description
from weberlink.session.advice import advise, dry_run
from weberlink.session.control_socket import ask, path_beside
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.ring import default_path, process_started

pytestmark = pytest.mark.realtime

LIMIT, RAMP, SLOW_RAMP, WEBER = 10.0, 0.05, 1.5, 0.1  # of the default configuration and of `SETTINGS` [N], [s], [1]
DELAY_MS = 20
SETTINGS = (
    "link.security=session", f"link.emulate={{delay_ms: {DELAY_MS}, seed: 1}}", "link.silence_ms=2000",
    "codec.force.lookahead_ms=10", "control.scheme=none", "master.limits.ramp_ms=1500",
    "master.device.script=[{motion: press, at_m: [0.03, 0.03, 0], depth_m: 0.01, hold_s: 600}]",
)  # fmt: skip
"""A key of its own, a delay that the advice tells of, a contact that lasts, and a force that fades for longer than a
stop usually takes."""


def sets(*overrides: str) -> list[str]:
    return [word for each in overrides for word in ("--set", each)]


def sizes(records: Records) -> Any:
    return np.linalg.norm(records["output"], axis=1)


def assert_nothing_left(program: Program, daemons: list[int]) -> None:
    until(lambda: not any(process_started(pid) for pid in daemons), f"the end of the daemons {daemons}")
    assert program.rings() == []


# --- one session, and what it left


@dataclass
class Session:
    folder: Path
    key: dict[str, Any] = field(default_factory=dict)
    described: dict[str, Any] = field(default_factory=dict)
    answers: list[dict[str, Any]] = field(default_factory=list)
    stopped_at: int = 0
    ended: tuple[int, str, str] = (-1, "", "")
    records: dict[str, Records] = field(default_factory=dict)

    @property
    def report(self) -> dict[str, Any]:
        return document((self.folder / "report.json").read_text(encoding="utf-8"))


def look_at_the_key(program: Program, seen: dict[str, Any]) -> None:
    key = default_path("any").parent / f"weberlink-{program.pid}.key"
    until(lambda: key.exists() and key.stat().st_size, "the key")
    program.send(signal.SIGSTOP)  # it removes the key as soon as both sides have read it
    seen["mode"] = key.stat().st_mode & 0o777
    seen["stranger"] = as_stranger(read_file, key) if os.geteuid() == 0 else "refused"
    digits = key.read_text().split()[1].encode()
    program.send(signal.SIGCONT)
    program.engaged("master")
    until(lambda: not key.exists(), "the key to be removed")
    seen["told"] = [digits in Path(f"/proc/{pid}/cmdline").read_bytes() for pid in program.daemons()]
    limits = [Path(f"/proc/{pid}/limits").read_text().splitlines() for pid in program.daemons()]
    seen["cores"] = [next(line for line in each if "core" in line).split()[4:6] for each in limits]


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    seen = Session(tmp_path_factory.mktemp("session"))
    with Program("loopback", "--json", seen.folder / "report.json", *sets(*SETTINGS)) as program:
        look_at_the_key(program, seen.key)
        ends = {side: program.engaged(side) for side in ("master", "slave")}
        master, slave = ends.values()
        ring = default_path(f"{program.pid}-slave")
        seen.described = (description.read(ring) or {}) | {"mode": path_beside(ring).stat().st_mode & 0o777}

        def accepted() -> dict[str, Any] | None:
            """The answer to a change, which is refused if a stall makes it too late."""
            told = ask(ring, {"weber": 0.25}, PATIENCE)
            return told if told["accepted"] else None

        seen.answers.append(ask(ring, {}, PATIENCE))
        seen.answers.append(until(accepted, "the change") or {})
        until(lambda: slave.last["settings"] == master.last["settings"] == 1, "the change on both sides")
        seen.answers.append(ask(ring, {"weber": 2.0}, PATIENCE))
        until(lambda: sizes(master.records)[-200:].min() > 1.0 and not master.last["ramping"], "contact")
        seen.stopped_at = int(master.last["tick"])
        seen.answers.append(ask(default_path(f"{program.pid}-master"), {"stop": "the visitor left"}, PATIENCE))
        seen.ended = program.finish(10.0)
        assert_nothing_left(program, [each.pid for each in ends.values()])
        assert not list(ring.parent.glob(f"weberlink-{program.pid}*"))
        seen.records = {side: each.records for side, each in ends.items()}
    return seen


def test_session_ends_in_order_with_its_advice_on_standard_error(session: Session) -> None:
    """Said once, though there are two daemons."""
    status, output, errors = session.ended
    assert status == 0
    assert errors.splitlines() == [f"weberlink: note: {line}" for line in advise(dry_run(configuration(*SETTINGS)))]
    assert errors
    assert "the visitor left" in output
    assert session.report["outcome"] == "the visitor left"
    assert faults_of(session.report) == {"master": {}, "slave": {}}
    assert all(len(line) <= WIDTH for line in output.splitlines())


def test_key_of_the_session_is_nobody_elses(session: Session) -> None:
    assert (session.key["mode"], session.key["stranger"]) == (0o600, "refused")
    assert len(session.key["told"]) >= 2 and not any(session.key["told"])
    assert all(limit in (["1", "1"], ["0", "0"]) for limit in session.key["cores"])
    assert session.described["system"]["link"]["security"] == "session"
    assert "key_file" not in session.described["system"]["link"]


def test_daemon_answers_on_its_control_socket_and_both_ends_change_at_the_tick(session: Session) -> None:
    asked, accepted, refused, stopped = session.answers
    assert (session.described["side"], session.described["changes"]) == ("slave", ["predictor", "weber"])
    assert session.described["mode"] == 0o600
    assert asked["settings"] == {"weber": 0.1, "predictor": "hybrid"}
    assert (accepted["accepted"], refused["accepted"], refused["generation"]) == (True, False, 1)
    assert stopped["accepted"]
    slave = session.records["slave"]
    assert slave["tick"][slave["settings"] == 1][0] >= accepted["tick"]
    assert set(slave["weber"][slave["settings"] == 1]) == {0.25}


def test_a_force_that_fades_slowly_is_not_cut_by_the_stop(session: Session) -> None:
    master = session.records["master"]
    forces, decoded = sizes(master), np.linalg.norm(master["decoded"], axis=1)
    last, stalled = np.flatnonzero(forces > 0.0)[-1], master["tick"][master["fault"] == Fault.STALLED]
    assert master["tick"][last] - session.stopped_at > 1000 or (stalled > session.stopped_at).any(), (
        "still felt a second after the stop, if the machine has not stood still, which ends the force"
    )
    now = master["at"] + 1e-6 * master["lateness_us"].astype(np.float64)
    left = forces[last] / decoded[last]
    assert left < 0.02 + (now[last + 1] - now[last]) / SLOW_RAMP or master["fault"][last + 1] == Fault.STALLED, (
        "a tick or two before the end of the fade, if the machine has not stood still"
    )
    assert forces[-1] == 0.0


# --- on a terminal; ends that are out of order


def test_on_a_terminal_a_status_line_goes_before_the_report_and_both_fit() -> None:
    status, lines = on_terminal("loopback", "--duration", 3, *PATIENT)
    assert status == 0 and max(map(len, lines)) <= WIDTH
    report = next(index for index, line in enumerate(lines) if line.startswith("weberlink loopback"))
    assert any("engaged" in line and "rtt" in line for line in lines[:report])
    assert not any("engaged" in line for line in lines[report:])


def test_daemons_whose_launcher_is_killed_stop_by_themselves_and_in_order() -> None:
    """However many threads it had: the kernel tells the daemons of the death of each."""
    with Program("loopback", *PATIENT) as program:
        sides = [program.engaged(side) for side in ("master", "slave")]
        until(lambda: sizes(sides[0].records)[-1] > 1.0, "contact")
        program.send(signal.SIGKILL)
        _, _, errors = program.finish()  # whose end comes when the daemons have let go of it
        assert_nothing_left(program, [side.pid for side in sides])  # a ring is removed in an orderly stop only
        records = sides[0].records[-200:]
    force = sizes(records)
    assert force.max() > 1.0 and force[-1] == 0.0
    elapsed = np.diff(records["at"] + 1e-6 * records["lateness_us"].astype(np.float64))
    assert (-np.diff(force) <= LIMIT * elapsed / RAMP + LIMIT * WEBER).all()  # faded, but for an update on the way
    assert errors == ""


def test_stopped_daemons_go_on_softly_and_hear_their_peer() -> None:
    """SIGSTOP as nothing in virtual time does it: datagrams wait in the kernel, and both clocks went on."""
    with Program("loopback", "--json", "-", "--set", "link.silence_ms=1000") as program:
        master, slave = (program.engaged(side) for side in ("master", "slave"))
        os.kill(slave.pid, signal.SIGSTOP)
        until(lambda: master.last["fault"] == Fault.SILENCE, "silence")
        os.kill(slave.pid, signal.SIGCONT)
        until(lambda: master.last["fault"] == Fault.NONE and master.last["state"] == ENGAGED, "the slave")
        until(lambda: sizes(master.records)[-100:].min() > 2.0, "a contact")
        os.kill(master.pid, signal.SIGSTOP)
        until(lambda: slave.last["fault"] == Fault.SILENCE, "silence of the master")
        sleep(0.5)  # its last datagram may be older than the stop
        os.kill(master.pid, signal.SIGCONT)
        until(lambda: np.diff(master.records["at"]).max() > 0.5, "the end of the stall")
        ended = float(master.last["at"])
        until(lambda: master.last["at"] > ended + 0.2 and master.last["state"] == ENGAGED, "the session to go on")
        records = master.records
        program.send(signal.SIGTERM)
        status, output, errors = program.finish()
    faults = document(output)["faults"]
    assert (status, errors) == (0, "")
    assert faults["master"]["silence"] == 1 and faults["slave"]["stalled"] >= 1
    assert faults["slave"]["silence"] == 1, "that of the master, and none for the time in which it was stopped itself"
    after = int(np.argmax(np.diff(records["at"]))) + 1
    # A record carries the deadline of its tick; the signal may have stopped the process within the tick before.
    (first,) = (tick for tick in (after, after - 1) if records["fault"][tick] == Fault.STALLED)
    felt = sizes(records)
    assert felt[first - 1] > 1.0
    assert felt[first] == 0.0
    assert np.diff(felt[first : first + 50]).max() <= 2.0 * LIMIT * 1e-3 / RAMP + 0.5  # a late tick counts as two


def test_a_stop_from_another_process_ends_force_and_motion_at_once_also_where_the_directory_was_emptied() -> None:
    with Program("loopback", *sets("control.scheme=none"), *PATIENT) as program:
        master, slave = program.engaged("master"), program.engaged("slave")
        until(lambda: sizes(master.records)[-1] > 1.0, "contact")
        for path in default_path("any").parent.glob(f"weberlink-{program.pid}-*"):
            path.unlink()
        told = weberlink("stop", program.pid)
        status, _, errors = program.finish()
        assert (told, status, errors) == ((0, f"stopped: {program.pid}\n", ""), 1, "")
        assert not master.records["output"][-1].any()
        held = slave.records["output"]
        assert (held[-1] == held[-2]).all()
