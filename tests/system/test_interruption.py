"""Interrupted sessions in virtual time: when they continue, force fades in and the robot does not jump."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise

import pytest

from tests.system.stops import StoppedSide
from tests.system.systems import Step, configuration, decoded, output, raw, steps, system
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.operator import OperatorDevice, OperatorOptions
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.protocol.states import State
from weberlink.slave.robots.contract import RobotReading
from weberlink.slave.robots.point import PointRobot
from weberlink.system.configuration import ConfigurationError
from weberlink.system.report import status_line
from weberlink.system.simulate import build_simulation
from weberlink.system.simulation import Simulation
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED, Record

TICK = 1e-3
BEGIN = 1.5
"""When a side is interrupted [s]: the hand slides along the surface with 3.7 N by then."""
RAMP = 10.0 * TICK / 0.05
"""By how much a fade of 50 ms may change the largest force in a tick [N]."""
SLEW = 3000.0 * TICK
"""By how much the slew limit of the default device lets a force change in a tick [N]."""


def commanded(record: Record) -> Vector:
    """By the operator, as decoded at the robot."""
    return record.position_x, record.position_y, record.position_z


def stopped(side: str, seconds: float, *overrides: str, **parts: type) -> tuple[Simulation, list[Step]]:
    """A run in contact in which a side's process stands still from `BEGIN` on, over a link of 5 ms each way."""
    built = system(*overrides, **parts)
    sides = {"master": built.master, "slave": built.slave}
    sides[side] = StoppedSide(sides[side], BEGIN, BEGIN + seconds)  # type: ignore[assignment]
    links = (
        EmulatedLink[Address](Emulation(delay_s=0.005), lambda: 0.0),
        EmulatedLink[Address](Emulation(delay_s=0.005), lambda: 0.0),
    )
    simulation = Simulation(master=sides["master"], slave=sides["slave"], links=links, tick_period=TICK)
    return built, list(steps(simulation, BEGIN + seconds + 1.0))


@pytest.mark.parametrize(("scheme", "seconds"), [("none", 0.03), ("bounded", 0.07), ("bounded", 0.5), ("none", 5.0)])
def test_stall_of_master_restarts_force_at_zero_and_robot_slowly(scheme: str, seconds: float) -> None:
    built, run = stopped("master", seconds, f"control.scheme={scheme}")
    end = round((BEGIN + seconds) / TICK)
    assert norm(output(run[end - 1].master)) > 3.0
    assert output(run[end].master) == ZERO
    assert run[end].master.fault == Fault.STALLED
    assert built.master.faults["stalled"] == 1
    for a, b in pairwise(run[end - 1 : end + 50]):
        felt = norm(output(b.master))
        if scheme == "none":  # a fade of what is decoded
            assert felt <= (b.index - end) * TICK / 0.05 * norm(decoded(b.master)) * (1 + 1e-9)
        elif b.index < end + 40:  # then the hand has paid for all of a new model
            assert felt <= norm(output(a.master)) + RAMP + 0.3  # and what the hand's own motion adds
    for a, b in pairwise(run[end - 1 : end + 100]):  # approach, and the operator's own motion once it is there
        own = distance(commanded(a.slave), commanded(b.slave)) if scheme == "bounded" else 0.5e-3
        assert distance(output(a.slave), output(b.slave)) <= 0.25 * TICK * (1 + 1e-9) + own
    assert max(norm(output(step.master)) for step in run) <= 10.0
    assert run[-1].master.state == run[-1].slave.state == State.ENGAGED.value
    assert max(norm(output(step.master)) for step in run[end + 100 :]) > 1.0  # it works again


def test_a_pause_of_the_peers_news_fades_the_force_and_takes_no_energy_from_a_hand_that_holds_on() -> None:
    """As after a burst of losses: the gate bounds the force, and what the hand has put in pays for what comes next."""
    simulation = system("slave.scene=[{shape: plane, stiffness_n_m: 500}]")
    list(steps(simulation, BEGIN))
    endpoint = simulation.master.endpoint
    paused = False
    hears, endpoint.is_peer_encoding = endpoint.is_peer_encoding, lambda now: not paused and hears(now)  # type: ignore[method-assign]
    before = next(steps(simulation, TICK)).master
    paused = True
    during = [step.master for step in steps(simulation, 0.1)]
    paused = False
    after = [step.master for step in steps(simulation, 0.3)]
    assert norm(output(before)) > 1.0
    assert output(during[-1]) == ZERO
    for a, b in pairwise([during[-1], *after]):
        assert norm(output(b)) <= norm(output(a)) + RAMP + 0.3
    assert during[-1].energy > 0.01
    assert after[1].energy == pytest.approx(during[-1].energy, rel=0.1)
    assert norm(output(after[-1])) > 2.0


@pytest.mark.parametrize("seconds", [0.03, 0.5])
def test_stall_of_slave_restarts_robot_slowly_and_fades_force_in(seconds: float) -> None:
    built, run = stopped("slave", seconds)
    end = round((BEGIN + seconds) / TICK)
    assert run[end].slave.fault == Fault.STALLED
    assert built.slave.faults["stalled"] == 1
    moves = [distance(output(a.slave), output(b.slave)) for a, b in pairwise(run[end - 1 :])]
    assert moves[0] == 0.0
    assert max(moves[:50]) <= 0.25 * TICK + 0.5e-3
    first = next(step for step in run[end:] if step.slave.sent)
    assert norm(decoded(first.slave)) <= RAMP
    steps_of_force = [norm(output(b.master)) - norm(output(a.master)) for a, b in pairwise(run[end:])]
    assert max(steps_of_force) <= SLEW + RAMP
    assert run[-1].slave.state == State.ENGAGED.value


class Sagging(PointRobot):
    """A robot that sinks by 3 cm while its host stands still, as one whose motors have let go."""

    sunk = 0.0

    def latest(self, now: float) -> RobotReading:
        reading = super().latest(now)
        if BEGIN + 0.4 < now < BEGIN + 0.501:
            x, y, z = reading.position
            return reading._replace(position=(x, y, z - 0.03))
        return reading


def test_stall_of_slave_restarts_from_the_measured_position() -> None:
    _, run = stopped("slave", 0.5, robot=Sagging)
    end = round((BEGIN + 0.5) / TICK)
    sunk = output(run[end - 1].slave)[2] - output(run[end].slave)[2]
    assert sunk == pytest.approx(0.03)
    moves = [distance(output(a.slave), output(b.slave)) for a, b in pairwise(run[end : end + 50])]
    assert max(moves) <= 0.25 * TICK * (1 + 1e-9)


def test_late_tick_within_the_limit_is_no_stall() -> None:
    built, run = stopped("master", 0.015)
    assert built.master.faults == {}
    moves = [distance(output(a.slave), output(b.slave)) for a, b in pairwise(run)]
    assert max(moves) <= 2.0 * TICK


PRESSED = [(0.0, 1.3), (1.5, 2.0), (2.5, 9.0)]
"""When the operator holds the button [s]."""


class WithButton(OperatorDevice):
    """A device with two buttons, of which the second is held as in `PRESSED`."""

    def __init__(self, options: OperatorOptions, tick_period: float) -> None:
        super().__init__(options, tick_period)
        self.spec = replace(self.spec, buttons=2)

    def latest(self, now: float) -> DeviceReading:
        held = any(begin <= now < end for begin, end in PRESSED)
        return super().latest(now)._replace(buttons=held << 1)


@cache
def with_button(*overrides: str) -> list[Step]:
    return list(steps(system("master.engage={button: 1}", *overrides, device=WithButton), 3.2))


def test_released_button_holds_robot_and_removes_force() -> None:
    run = with_button()
    released = [step for step in run if 1.3 + 0.06 < step.master.at < 1.5 or 2.0 + 0.06 < step.master.at < 2.5]
    assert {output(step.master) for step in released} == {ZERO}
    assert {step.master.sent for step in released} == {0}
    assert {step.master.ramping for step in released} == {RELEASED}
    for begin, end in ((1.36, 1.5), (2.06, 2.5)):
        assert len({output(step.slave) for step in run if begin < step.slave.at < end}) == 1
    held = [step for step in run if 1.0 < step.master.at < 1.3 or step.master.at > 3.0]
    assert max(norm(output(step.master)) for step in held) > 1.0
    assert all(step.master.state == step.slave.state == State.ENGAGED.value for step in run[100:])
    assert all(step.master.fault == step.slave.fault == Fault.NONE for step in run[100:])


def test_button_changes_fade_force_and_limit_motion() -> None:
    run = with_button()
    moments = [round(at / TICK) for interval in PRESSED[:-1] for at in interval[1:]] + [1500, 2500]
    for moment in moments:
        around = run[moment - 1 : moment + 60]
        first = pairwise(around[:30])  # then the hand has paid for what a new model states
        assert max(distance(output(a.master), output(b.master)) for a, b in first) <= RAMP + 0.3
        moves = [distance(output(a.slave), output(b.slave)) for a, b in pairwise(around)]
        assert max(moves) <= 0.25 * TICK + 0.5e-3


def test_released_button_retracts_where_configured() -> None:
    run = with_button("slave.limits.on_silence=retract", "slave.limits.retract_m=0.02")
    before, after = (run[round(at / TICK)].slave for at in (1.299, 1.499))
    assert norm(raw(before)) > 0.5
    assert output(after)[2] - output(before)[2] > 0.01
    assert raw(after) == ZERO


def test_status_line_shows_the_released_button() -> None:
    run = with_button()
    summary = {
        "duration_s": 2.2,
        "force": {"packets_per_s": None, "reduction": None, "error_rms": None},
        "link": {"rtt_us": {"p50": None}},
    }
    for index, word in ((1200, "engaged"), (2200, "button released")):
        records = {"master": run[index].master._asdict(), "slave": run[index].slave._asdict()}
        assert word in status_line(records, summary)


@pytest.mark.parametrize(
    ("overrides", "device", "expected"),
    [
        (["master.engage={button: 0}"], None, "master.engage.button: operator has no button, not 0"),
        (["master.engage={button: 2}"], WithButton, "master.engage.button: operator has the buttons 0 to 1, not 2"),
        (
            ["master.engage={button: 1}", "master.mapping={clutch: {button: 1}, walls: {}}"],
            WithButton,
            "master.engage.button: 1 is the button of master.mapping.clutch",
        ),
    ],
)
def test_unusable_dead_man_button_is_refused(overrides: list[str], device: type, expected: str) -> None:
    with pytest.raises(ConfigurationError, match=expected):
        build_simulation(configuration(*overrides, device=device))


def forced(force_at: Callable[[float], Vector]) -> type[PointRobot]:
    """A robot whose sensor says this, whatever it touches."""

    class Forced(PointRobot):
        def latest(self, now: float) -> RobotReading:
            return super().latest(now)._replace(force=force_at(now))

    return Forced


def test_jumping_force_of_a_peer_is_slew_limited() -> None:
    thrown = forced(lambda now: (0.0, 0.0, 10.0 if int(now / 0.02) % 2 else -10.0))
    largest = {}
    for limit in ("null", "1.0e+9", "500"):
        run = list(steps(system(f"master.limits.slew_n_s={limit}", "control.scheme=none", robot=thrown), 1.0))
        largest[limit] = max(distance(output(a.master), output(b.master)) for a, b in pairwise(run))
        limited = run[-1].master.slew_ticks
        assert (limited == 0) == (limit == "1.0e+9")
    assert largest["1.0e+9"] > 19.0
    assert largest["null"] == pytest.approx(SLEW, rel=0.1)
    assert largest["500"] == pytest.approx(0.5 + RAMP, abs=RAMP)


def test_jumping_torque_of_a_peer_is_slew_limited() -> None:
    class Thrown(PointRobot):
        def latest(self, now: float) -> RobotReading:
            reading = super().latest(now)
            return reading._replace(torque=(0.0, 0.3 if int(now / 0.02) % 2 else -0.3, 0.0))

    def largest(limit: str) -> float:
        run = list(steps(system(f"master.limits.slew_nm_s={limit}", file="rotation.yaml", robot=Thrown), 1.0))
        return max(abs(b.master.rotation_output_y - a.master.rotation_output_y) for a, b in pairwise(run))

    assert largest("1.0e+9") > 0.5
    assert largest("20") <= 0.02 + 0.5 * TICK / 0.05
    assert largest("null") <= 0.125 + 0.5 * TICK / 0.05


def test_demonstration_never_meets_the_slew_limit() -> None:
    run = list(steps(system(), 6.0))
    assert run[-1].master.slew_ticks == 0


def test_strong_contact_trips_until_the_hand_leaves_it() -> None:
    simulation = system("slave.limits.trip_n=3", "codec.force.predictor=zoh")
    run = list(steps(simulation, 9.0))
    tripped = [step for step in run if step.slave.fault == Fault.TRIPPED]
    first = tripped[0]
    assert norm(raw(run[first.index].slave)) > 3.0
    assert max(norm(raw(step.slave)) for step in run) <= 3.0 + 0.5  # it backs off at once
    assert simulation.slave.faults["tripped"] >= 1
    away = run[first.index + 100]
    assert raw(away.slave) == ZERO
    assert norm(output(away.master)) < 0.1
    falls = [distance(output(a.master), output(b.master)) for a, b in pairwise(run)]
    assert max(falls) <= SLEW + RAMP
    moves = [distance(output(a.slave), output(b.slave)) for a, b in pairwise(run[first.index :])]
    assert max(moves[:400]) <= 0.25 * TICK * (1 + 1e-9)
    end = next(step for step in run[first.index :] if step.slave.fault == Fault.NONE)
    assert end.slave.at - first.slave.at >= 0.5
    assert max(norm(output(step.master)) for step in run[end.index :]) > 1.0  # it works again


def test_a_trip_outlives_the_session() -> None:
    """The master stands still for so long that the slave gives the session up; the hand is still deep then."""
    built, run = stopped("master", 4.0, "slave.limits.trip_n=3", "codec.force.predictor=zoh")
    again = next(step for step in run if step.slave.at > BEGIN + 4.0 and step.slave.state == State.ENGAGED.value)
    assert built.slave.endpoint.sessions == 2
    assert {step.slave.fault for step in run[again.index - 1000 : again.index + 100]} == {Fault.TRIPPED}


def test_simulated_robot_without_trip_limit_never_trips() -> None:
    """At its largest force."""
    simulation = system(
        "slave.scene=[{shape: plane, stiffness_n_m: 1000000.0}]",
        "slave.robot.stiffness_n_m=1000000.0",
        "slave.limits.contact_n=30",
    )
    run = list(steps(simulation, 3.0))
    assert simulation.slave.faults == {}
    assert max(norm(raw(step.slave)) for step in run) == pytest.approx(30.0)


def test_taken_over_master_fades_out_and_ends() -> None:
    simulation = system()
    run = list(steps(simulation, BEGIN))
    assert norm(output(run[-1].master)) > 1.0
    simulation.slave.endpoint.close(BEGIN, "taken over by operator@b")
    after = list(steps(simulation, 1.0))
    assert simulation.master.stopped
    assert simulation.master.failure == "taken over by operator@b"
    assert simulation.master.faults == {"taken_over": 1}
    assert output(after[-1].master) == ZERO
    falls = [distance(output(a.master), output(b.master)) for a, b in pairwise([run[-1], *after])]
    assert max(falls) <= RAMP + 0.1
    assert len(after) <= 60
