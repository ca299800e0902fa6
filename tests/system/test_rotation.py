"""Laws of a whole system of six degrees of freedom in virtual time: the rotation beside all that holds without it."""

from dataclasses import replace
from itertools import pairwise
from math import isnan, nan, sin, sqrt
from typing import Any

import pytest

from tests.system.systems import Step, configuration, output, steps, system
from weberlink.geometry.rotation import LONGEST, Quaternion, angle_between, quaternion
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.devices.operator import OperatorDevice
from weberlink.protocol.states import State
from weberlink.slave.robots.contract import RobotReading
from weberlink.slave.robots.point import PointRobot
from weberlink.system.advice import advise
from weberlink.system.composition.channels import streams
from weberlink.system.composition.link import agreement
from weberlink.system.composition.trial import try_out
from weberlink.system.configuration import ConfigurationError
from weberlink.system.side import Side
from weberlink.system.simulate import build_simulation, simulate
from weberlink.system.simulation import Simulation
from weberlink.telemetry.record import COLUMNS, Record

FILE = "rotation.yaml"
TICK = 1e-3
SILENCE = 0.1
HALF_STEP = 0.5e-4 * sqrt(3.0) * (1 + 1e-6) + 1e-6
"""Of a torque on the wire [N m], and the single precision of a record."""
LOSSY = ("link.emulate.delay_ms=3", "link.emulate.jitter_ms=4", "link.emulate.loss=0.3", "link.emulate.reorder=0.05")


def six(*overrides: str, **parts: Any) -> Simulation:
    return system(*overrides, file=FILE, **parts)


class RotationCoders:
    """The coders of the rotation of one side."""

    def __init__(self, side: Side) -> None:
        self.encoder, self.decoder = side.outgoing[1].encoder, side.incoming[1].decoder


def torque_felt(record: Record) -> Vector:
    """Displayed on the hand (master), or commanded as a rotation vector (slave)."""
    return record.rotation_output_x, record.rotation_output_y, record.rotation_output_z


def rotation_raw(record: Record) -> Vector:
    return record.rotation_raw_x, record.rotation_raw_y, record.rotation_raw_z


def rotation_decoded(record: Record) -> Vector:
    return record.rotation_decoded_x, record.rotation_decoded_y, record.rotation_decoded_z


@pytest.mark.parametrize("predictor", ["linear", "hybrid", "adaptive"])
def test_without_faults_both_ends_hold_the_same_and_within_the_deadband(predictor: str) -> None:
    simulation = six(f"codec.rotation.torque.predictor={predictor}")
    master, slave = RotationCoders(simulation.master), RotationCoders(simulation.slave)
    torques = 0.0
    for step in steps(simulation, 5.0):
        if step.slave.ramping or step.slave.state != State.ENGAGED.value:
            continue
        error = distance(rotation_decoded(step.slave), rotation_raw(step.slave))
        assert error <= (HALF_STEP if step.slave.rotation_sent else step.slave.rotation_bound + HALF_STEP)
        torques = max(torques, norm(rotation_raw(step.slave)))
        if step.slave.rotation_sent:
            newest = slave.encoder.mirror.newest
            assert newest is not None
            if not isnan(newest.position[0]):
                assert distance(newest.position, torque_felt(step.slave)) <= HALF_STEP
        if not step.slave.rotation_sent:  # otherwise it arrives before the next tick
            assert repr(master.decoder.state) == repr(slave.encoder.mirror.state)
        assert repr(slave.decoder.state) == repr(master.encoder.mirror.state)
        turned = angle_between(quaternion(torque_felt(step.slave)), quaternion(rotation_raw(step.master)))
        assert turned <= step.master.rotation_bound + HALF_STEP
    assert torques > 0.02
    assert step.slave.rotation_updates_sent > 10
    assert step.master.rotation_updates_sent > 10


def test_the_torque_is_felt_within_the_deadband_but_for_the_tick_that_an_update_takes() -> None:
    """The hand feels what the robot felt in the tick before; the model is evaluated where the hand is now."""
    summary, _ = simulate(configuration(file=FILE), 6.0)
    torque = summary["torque"]
    assert torque["packets"] > 20
    assert torque["error_rms"] < 0.01
    # A tick for each update, and a few where the two orientations differ by their own deadband.
    assert torque["violation_fraction"] * torque["samples"] <= 1.5 * torque["packets"]
    assert torque["coding"]["violation_fraction"] == 0.0
    assert summary["orientation"]["violation_fraction"] == 0.0


def test_the_report_speaks_of_the_rotation_only_where_there_is_one() -> None:
    summary, _ = simulate(configuration(), 0.5)
    assert not {"torque", "orientation"} & set(summary)
    summary, _ = simulate(configuration(file=FILE), 0.5)
    assert {"samples", "packets", "packets_per_s", "reduction", "error_rms", "violation_fraction"} <= set(
        summary["torque"]
    ) & set(summary["orientation"])
    assert set(summary["torque"]["selected"]) <= {"zoh", "linear"}


@pytest.mark.parametrize("seed", [1, 2])
def test_over_a_bad_link_each_stream_is_restored_by_the_first_update_of_its_own(seed: int) -> None:
    simulation = six(*LOSSY, f"link.emulate.seed={seed}")
    master, slave = RotationCoders(simulation.master), RotationCoders(simulation.slave)
    sent: dict[str, dict[int, object]] = {"torque": {}, "orientation": {}}
    compared = {"torque": 0, "orientation": 0}
    for step in steps(simulation, 3.0):
        for name, encoder, decoder in (
            ("torque", slave.encoder, master.decoder),
            ("orientation", master.encoder, slave.decoder),
        ):
            if encoder.mirror.newest is not None:
                sent[name][encoder.mirror.newest.tick] = encoder.mirror.state
            if decoder.newest is not None and step.master.state == step.slave.state == State.ENGAGED.value:
                assert repr(decoder.state) == repr(sent[name][decoder.newest.tick])
                compared[name] += 1
    assert min(compared.values()) > 1000
    assert simulation.master.endpoint.statistics.lost > 10


def blackout(start: float, seconds: float, *overrides: str) -> list[Step]:
    return list(steps(six(f"link.emulate.blackouts_s=[[{start}, {seconds}]]", *overrides), start + seconds + 2.0))


def test_in_silence_torque_fades_to_zero_and_the_tool_holds_and_both_return_without_a_jump() -> None:
    start, seconds = 1.4, 1.0
    run = blackout(start, seconds)
    assert max(norm(torque_felt(step.master)) for step in run if step.master.at < start) > 0.02
    safe = [step for step in run if start + SILENCE + TICK < step.master.at < start + seconds]
    assert {torque_felt(step.master) for step in safe} == {ZERO}
    assert len({torque_felt(step.slave) for step in safe}) == 1
    after = [step for step in run if step.master.at >= start + seconds - TICK]
    turned = [
        angle_between(quaternion(torque_felt(a.slave)), quaternion(torque_felt(b.slave))) for a, b in pairwise(after)
    ]
    assert max(turned) <= 1.5 * TICK + 0.01  # the angular speed of the approach, and what an update corrects
    jumps = [distance(torque_felt(a.master), torque_felt(b.master)) for a, b in pairwise(after)]
    peak = max(norm(torque_felt(step.master)) for step in after)
    assert max(jumps) <= 0.5 * TICK / 0.05 + 0.13 * peak + 0.01
    assert run[-1].slave.ramping == 0
    assert peak > 0.02


def test_nothing_is_shown_until_the_tool_is_turned_as_the_hand_is() -> None:
    """Force and torque of a tool that is still turned otherwise are not those of what the operator does."""
    run = blackout(1.4, 0.5, "slave.limits.approach_turn_rad_s=0.2")
    ramping = [step for step in run if step.slave.at >= 1.95 and step.slave.ramping]
    apart = [
        step
        for step in ramping
        if angle_between(quaternion(torque_felt(step.slave)), quaternion(rotation_raw(step.master))) > 0.02
    ]
    assert len(apart) > 100
    shown = [norm(rotation_decoded(step.slave)) + norm(torque_felt(step.master)) for step in apart]
    assert max(shown) <= 0.02  # what the deadband leaves of a torque that has been faded out


def test_the_torque_limit_holds_whatever_the_robot_measures() -> None:
    limit = 0.01
    run = list(steps(six(f"master.limits.torque_nm={limit}"), 5.0))
    felt = [norm(torque_felt(step.master)) for step in run]
    assert max(norm(rotation_decoded(step.master)) for step in run) > 2 * limit
    assert max(felt) == pytest.approx(limit, rel=1e-6)
    assert any(step.master.clipped for step in run)


def test_the_tool_never_turns_faster_than_its_limit() -> None:
    run = list(steps(six("slave.limits.turn_rad_s=0.3", "slave.limits.approach_turn_rad_s=0.3"), 3.0))
    turned = [
        angle_between(quaternion(torque_felt(a.slave)), quaternion(torque_felt(b.slave))) for a, b in pairwise(run)
    ]
    assert max(turned) <= 0.3 * TICK + 1e-6
    assert max(turned) > 0.2 * TICK
    assert any(step.slave.clipped for step in run)


class Turning(OperatorDevice):
    """A hand that turns on and on about one axis, through half a turn and back to where it was, and trembles."""

    def latest(self, now: float) -> DeviceReading:
        angle = 3.0 * now + 0.02 * sin(100.0 * now)
        return super().latest(now)._replace(orientation=quaternion((0.6 * angle, 0.8 * angle, 0.0)))


@pytest.mark.parametrize(("delay", "loss", "late"), [(0, 0.0, 0), (5, 0.3, 40)])
def test_a_hand_that_turns_through_half_a_turn_is_followed(delay: int, loss: float, late: int) -> None:
    """The vector jumps; the rotation does not, and neither does what the tool is told, whatever the link does."""
    link = (f"link.emulate.delay_ms={delay}", f"link.emulate.loss={loss}", "link.emulate.seed=1")
    fast = ("slave.limits.approach_turn_rad_s=10", "slave.limits.turn_rad_s=1000")
    run = list(steps(six(*link, *fast, device=Turning), 4.0))
    vectors = [rotation_raw(step.master) for step in run]
    jumps = sum(distance(a, b) > 0.1 for a, b in pairwise(vectors))
    assert jumps == 2
    assert max(map(norm, vectors)) <= LONGEST
    for step in run:
        if not step.slave.ramping:
            turned = angle_between(quaternion(torque_felt(step.slave)), quaternion(rotation_raw(step.master)))
            assert turned <= 5.0 * TICK * late + 0.006  # at most 5 rad/s, and the deadband


class Level(OperatorDevice):
    def latest(self, now: float) -> DeviceReading:
        reading = super().latest(now)
        return reading._replace(orientation=None if now >= 0.5 else reading.orientation)


class NotANumber(OperatorDevice):
    def latest(self, now: float) -> DeviceReading:
        reading = super().latest(now)
        return reading._replace(orientation=(nan, 0.0, 0.0, 0.0)) if now >= 0.5 else reading


@pytest.mark.parametrize(
    ("device", "complaint"), [(Level, "reports the orientation None"), (NotANumber, "reports the orientation (nan")]
)
def test_a_device_that_gives_no_orientation_any_more_leaves_with_the_reason(
    device: type[OperatorDevice], complaint: str
) -> None:
    simulation = six(device=device)
    run = list(steps(simulation, 2.0))
    assert simulation.master.stopped
    assert complaint in (simulation.master.failure or "")
    assert torque_felt(run[-1].master) == output(run[-1].master) == ZERO


class Numb(PointRobot):
    TORQUE = (nan, 0.0, 0.0)

    def latest(self, now: float) -> RobotReading:
        reading = super().latest(now)
        return reading._replace(torque=self.TORQUE) if now >= 0.5 else reading


class Wild(Numb):
    TORQUE = (0.0, 1e300, 0.0)


@pytest.mark.parametrize(("robot", "complaint"), [(Numb, "the torque (nan"), (Wild, "the torque (0.0, 1e+300")])
def test_a_robot_whose_torque_cannot_be_leaves_with_the_reason(robot: type[Numb], complaint: str) -> None:
    simulation = six(robot=robot)
    run = list(steps(simulation, 1.0))
    assert complaint in (simulation.slave.failure or "")
    assert torque_felt(run[-1].master) == ZERO


class Told(OperatorDevice):
    """A device that notes what it is told to turn."""

    def turn(self, torque: Vector, now: float) -> None:
        self.told = torque
        super().turn(torque, now)


class Pointed(PointRobot):
    """A robot that notes where its tool is told to point."""

    def point(self, orientation: Quaternion, now: float) -> None:
        self.told = orientation
        super().point(orientation, now)


def test_a_failing_loop_releases_the_hand_and_holds_the_tool() -> None:
    simulation = six(device=Told, robot=Pointed)
    run = list(steps(simulation, 1.6))
    assert norm(torque_felt(run[-1].master)) > 0.005
    simulation.master.fail(1.6, RuntimeError("test"))
    simulation.slave.fail(1.6, RuntimeError("test"))
    assert simulation.master.port.device.told == ZERO  # type: ignore[attr-defined]
    assert angle_between(simulation.slave.port.robot.told, quaternion(torque_felt(run[-1].slave))) < 1e-6  # type: ignore[attr-defined]


def test_without_rotation_nothing_of_it_is_built_agreed_or_recorded() -> None:
    simulation = system()
    assert len(simulation.master.outgoing) == len(simulation.slave.outgoing) == 1
    for step in steps(simulation, 0.3):
        for record in (step.master, step.slave):
            assert not any(getattr(record, name) for name in COLUMNS if name.startswith("rotation"))
    plain = configuration().system
    assert not [key for key in agreement(plain) if "rotation" in key]
    assert [len(way) for way in streams(plain)] == [1, 1]


@pytest.mark.parametrize(("ours", "its"), [((), ("codec.rotation=null",)), (("codec.rotation=null",), ())])
def test_ends_of_which_one_turns_refuse_each_other_and_say_why(ours: tuple[str, ...], its: tuple[str, ...]) -> None:
    simulation = build_simulation(configuration(*ours, file=FILE))
    simulation.slave = build_simulation(configuration(*its, file=FILE)).slave
    list(steps(simulation, 1.0))
    failure = simulation.master.failure or ""
    assert failure.startswith("refused: codec.rotation.orientation.")
    assert ("slave has nothing" if its else "master has nothing") in failure
    assert simulation.slave.failure is None


@pytest.mark.parametrize(
    ("overrides", "complaint"),
    [
        (["master.device={driver: operator}"], "codec.rotation: master.device driver operator, as it is set here"),
        (["slave.robot={driver: point}"], "codec.rotation: slave.robot driver point, as it is set here"),
        (["codec.rotation.torque.step_nm=0.00001"], "codec.rotation.torque.step_nm: spans"),
        (["codec.rotation.orientation.step_rad=0.00001"], "codec.rotation.orientation.step_rad"),
        (["codec.rotation.torque.bank=[zoh, zoh]"], "codec.rotation.torque.bank: names each predictor once"),
        (["codec.rotation.tork={}"], "codec.rotation.tork: unknown key; did you mean torque?"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(overrides: list[str], complaint: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        try_out(configuration(*overrides, file=FILE))
    message = str(caught.value)
    assert complaint in message
    assert "\n" not in message
    assert "the file:" not in message


def test_a_device_without_torque_turns_the_tool_and_the_operator_is_told() -> None:
    class Silent(OperatorDevice):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.spec = replace(self.spec, torque_n_m=0.0)

        def turn(self, torque: Vector, now: float) -> None:
            raise AssertionError("a device that displays none is not told")

    loaded = configuration(file=FILE, device=Silent)
    assert any("has no torque feedback" in line for line in advise(try_out(loaded)))
    run = list(steps(build_simulation(loaded), 2.0))
    assert max(norm(torque_felt(step.slave)) for step in run) > 0.1
