"""How a session is stopped through the control socket: in order, or as an emergency, by either side."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic
from typing import Any

import numpy as np
import pytest

from tests.program import ENGAGED, Program, Telemetry
from tests.system.systems import CONFIGS, output, steps, system
from tests.wait import PATIENCE, until
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.pointer_link import PointerSender, socket_path
from weberlink.protocol.states import State
from weberlink.system import description
from weberlink.system.configuration import MASTER, SLAVE, load
from weberlink.system.control_socket import ask
from weberlink.system.daemon import STOP_SLACK_S, stop_limit_s
from weberlink.system.launcher import STOP_LIMIT_S
from weberlink.telemetry.ring import default_path

TICK = 1e-3
SLOW_FADE = (
    "master.limits.ramp_ms=2500",
    "slave.scene=[{shape: plane, stiffness_n_m: 500}]",
)
PRESSED: Vector = (0.05, 0.05, -0.03)
"""Below the table, beside the dome [m]."""
HAND_N_M = 150.0


@pytest.mark.parametrize("asked", ["master", "slave"])
def test_emergency_ends_force_and_motion_on_both_sides(asked: str) -> None:
    simulation = system("slave.scene=[{shape: plane, stiffness_n_m: 500}]", "link.emulate={delay_ms: 5}")
    before = list(steps(simulation, 1.5))[-1]
    assert norm(output(before.master)) > 0.5
    getattr(simulation, asked).emergency(1.5)
    after = list(steps(simulation, 0.2))
    side = getattr(simulation, asked)
    assert (side.outcome, side.failure, side.stopped) == ("emergency stop", "emergency stop", True)
    if asked == "master":
        assert output(after[0].master) == ZERO
        assert after[0].master.state == State.CLOSED.value
        return
    positions = {output(step.slave) for step in after}
    assert positions == {output(before.slave)}, "it holds"
    assert simulation.master.endpoint.state is not State.ENGAGED, "it was told"
    assert output(after[60].master) == ZERO


def test_slave_is_told_of_an_emergency_and_holds() -> None:
    simulation = system("slave.scene=[{shape: plane, stiffness_n_m: 500}]", "link.emulate={delay_ms: 5}")
    list(steps(simulation, 1.5))
    simulation.master.emergency(1.5)
    records = [simulation.step()[1] for _ in range(200)]
    assert records[20].state != ENGAGED
    assert {output(record) for record in records[20:]} == {output(records[20])}


def test_emergency_does_not_wait_for_a_fade_under_way() -> None:
    simulation = system("slave.scene=[{shape: plane, stiffness_n_m: 500}]")
    list(steps(simulation, 1.5))
    simulation.master.stop(1.5, "enough")
    assert norm(output(next(steps(simulation, TICK)).master)) > 0.5
    simulation.master.emergency(1.5)
    assert output(next(steps(simulation, TICK)).master) == ZERO
    assert simulation.master.outcome == "emergency stop"


@contextmanager
def visitor(pid: int, target: Vector) -> Iterator[None]:
    """Holds the handle at a target, 60 times a second."""
    sender, ended = PointerSender(pid), Event()

    def drag() -> None:
        while not ended.wait(1 / 60):
            sender.send(target, True)

    thread = Thread(target=drag)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        sender.close()


@contextmanager
def tried(*overrides: str) -> Iterator[tuple[Program, Telemetry, Telemetry]]:
    """A live session of configs/try.yaml, with the telemetry of master and slave."""
    settings = [argument for text in ("control.scheme=none", *overrides) for argument in ("--set", text)]
    with Program("loopback", "configs/try.yaml", "--duration", "60", *settings) as program:
        master = program.engaged("master")
        yield program, master, program.engaged("slave")


def is_still(positions: Any) -> bool:
    """Whether the handle is below the table and has not moved for 0.2 s."""
    newest = positions[-200:]
    return len(newest) == 200 and newest[-1, 2] < 0.0 and bool((np.ptp(newest, axis=0) < 5e-5).all())


def asked_of(program: Program, side: str, request: dict[str, Any]) -> dict[str, Any]:
    return ask(default_path(f"{program.pid}-{side}"), request, PATIENCE)


def daemon_of(program: Program) -> int:
    """Process id of the master, as its description says."""
    described = description.read(default_path(f"{program.pid}-master"))
    assert described is not None
    pid: int = described["pid"]
    return pid


@pytest.mark.realtime(alone=True)
def test_visitor_leads_until_an_emergency() -> None:
    with tried() as (program, master, slave):
        pid = daemon_of(program)
        with visitor(pid, PRESSED):
            until(lambda: is_still(master.records["position"]), "the handle to come to rest")
            assert distance(tuple(master.last["position"]), (0.05, 0.05, -0.0027)) < 1e-3
            assert master.last["output"][2] == pytest.approx(HAND_N_M * 0.0273, rel=0.15)
            assert (master.last["buttons"], slave.last["state"]) == (1, ENGAGED)
            began = monotonic()
            assert asked_of(program, "master", {"emergency": True})["accepted"]
            answered = monotonic()
            status, _, errors = program.finish()
        assert (status, errors) == (1, "")
        records = master.records
        forces = np.linalg.norm(records["output"], axis=1)
        after = records["at"] > answered + TICK
        assert not forces[after].any()
        assert forces[records["at"] < began].max() > 1.0
        assert records["at"][forces > 0.0][-1] - began < 0.05
        held = slave.records
        held = held["output"][held["at"] > answered + 0.05]
        assert (held == held[:1]).all()
        assert not socket_path(pid).exists()


@pytest.mark.realtime
def test_emergency_of_the_slave_is_a_failed_run() -> None:
    with tried() as (program, _, _):
        assert asked_of(program, "slave", {"emergency": True})["accepted"]
        status, report, _ = program.finish()
        assert status == 1
        assert "emergency stop" in report


@pytest.mark.realtime
def test_orderly_stop_says_its_words() -> None:
    with tried() as (program, master, _):
        assert asked_of(program, "master", {"stop": "the visitor left"})["accepted"]
        status, report, errors = program.finish()
        assert (status, errors) == (0, "")
        assert "the visitor left" in report
        assert np.linalg.norm(master.last["output"]) == 0.0


@pytest.mark.parametrize("ramp_ms", [0.1, 50.0, 999.0, 2500.0, 5000.0])
def test_a_stop_may_last_as_long_as_its_fade_and_ends_before_the_launcher_kills(ramp_ms: float) -> None:
    limits = load(CONFIGS / "loopback.yaml", [f"master.limits.ramp_ms={ramp_ms}"]).system
    assert 1e-3 * ramp_ms < stop_limit_s(limits, MASTER) < STOP_LIMIT_S
    assert stop_limit_s(limits, SLAVE) == STOP_SLACK_S


@pytest.mark.realtime
def test_a_force_that_fades_slowly_is_not_cut_by_the_stop() -> None:
    settings = [argument for text in SLOW_FADE for argument in ("--set", text)]
    with Program("loopback", "configs/loopback.yaml", "--duration", "2.5", *settings) as program:
        master = program.engaged("master")
        status, report, errors = program.finish(10.0)
        assert (status, errors) == (0, ""), report
        records = master.records
    forces = np.linalg.norm(records["output"], axis=1)
    felt = records["tick"][forces > 0.1]
    assert felt[-1] - records["tick"][0] > 3500, "still felt more than a second after the stop at 2.5 s"
    assert forces[-1] == 0.0
    assert np.abs(np.diff(forces)).max() < 0.2, "no jump in a tick, though a late one makes up for a missed one"


@pytest.mark.realtime
def test_released_handle_of_a_visitor_who_vanishes() -> None:
    with tried("master.device.scripted=false") as (program, master, _):
        assert master.last["buttons"] == 0
        with visitor(daemon_of(program), PRESSED):
            until(lambda: master.last["output"][2] > 3.0, "the force")
        gone = monotonic()
        until(lambda: not master.last["output"].any(), "no force")
        records = master.records
        forces = np.linalg.norm(records["output"], axis=1)
        assert records["at"][forces > 0.0][-1] - gone < 0.1 + 0.05 + 0.02


@pytest.mark.realtime
@pytest.mark.hunt
def test_emulated_link_changes_while_it_runs() -> None:
    with tried() as (program, master, slave):
        with visitor(daemon_of(program), PRESSED):
            for side in ("master", "slave"):
                answer = asked_of(program, side, {"delay_ms": 40})
                assert (answer["accepted"], answer["link"]["delay_ms"]) == (True, 40.0)
            for telemetry in (master, slave):
                until(lambda each=telemetry: each.last["rtt_us"] > 80e3, "the round trip of 80 ms")  # type: ignore[misc]
            lost = slave.last["datagrams_lost"]
            assert lost == 0, "by the change"
            assert asked_of(program, "master", {"delay_ms": 0, "loss": 0.5})["link"]["loss"] == 0.5
            until(lambda: slave.last["datagrams_lost"] > 5, "losses")
            assert asked_of(program, "master", {"loss": 0})["accepted"]
            until(lambda: 40e3 < slave.last["rtt_us"] < 60e3, "the round trip of 40 ms")
            assert {master.last["state"], slave.last["state"]} == {ENGAGED}
        assert asked_of(program, "slave", {})["link"] == {"delay_ms": 40.0, "jitter_ms": 0.0, "loss": 0.0}
        asked_of(program, "master", {"stop": "enough"})
        assert program.finish()[0] == 0
