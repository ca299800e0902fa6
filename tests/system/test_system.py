"""Laws of the whole system in virtual time: operator, codec, link with faults, scene."""

from itertools import pairwise
from math import inf, nan, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.system.systems import configuration, decoded, output, raw, steps, system
from weberlink.control.contract import LEAST_CONTACT
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.contract import DeviceFault, DeviceReading
from weberlink.master.devices.operator import OperatorDevice
from weberlink.protocol import DropReason
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.protocol.liveness import HORIZON_SHARE
from weberlink.protocol.states import State
from weberlink.protocol.wire import Kind, kind_of
from weberlink.slave.robots.contract import RobotFault, RobotReading
from weberlink.slave.robots.point import PointRobot
from weberlink.system.simulate import build_simulation
from weberlink.system.simulation import Simulation
from weberlink.telemetry.fault import Fault

TICK = 1e-3
SILENCE = 0.1
HALF_STEP = 0.5e-3 * sqrt(3.0) * (1 + 1e-9)
BAD_LINK = (
    "link.emulate.delay_ms=3",
    "link.emulate.jitter_ms=4",
    "link.emulate.loss=0.3",
    "link.emulate.burst=20",
    "link.emulate.reorder=0.05",
    "link.emulate.duplicate=0.05",
    "link.emulate.corrupt=0.05",
)


@pytest.mark.parametrize("file", ["loopback.yaml", "rotation.yaml"])
def test_same_seed_same_run_bit_for_bit(file: str) -> None:
    runs = [list(steps(system(*BAD_LINK, f"link.emulate.seed={seed}", file=file), 1.5)) for seed in (5, 5, 6)]
    assert repr(runs[0]) == repr(runs[1]) != repr(runs[2])


@pytest.mark.parametrize("predictor", ["zoh", "linear", "plane", "sphere", "hybrid"])
@pytest.mark.parametrize("axes", ["xyz", "z"])
def test_without_faults_both_ends_hold_the_same_and_within_the_deadband(predictor: str, axes: str) -> None:
    simulation = system(f"codec.force.predictor={predictor}", f"axes={axes}")
    sends = 0
    for step in steps(simulation, 3.0):
        if step.slave.ramping:
            continue  # a share of the force is coded, and the record holds all of it
        error = distance(decoded(step.slave), raw(step.slave))
        assert error <= (HALF_STEP if step.slave.sent else step.slave.bound)
        sends += step.slave.sent
        if not step.slave.sent:  # otherwise it arrives before the next tick
            assert repr(simulation.master.incoming[0].decoder.state) == repr(
                simulation.slave.outgoing[0].encoder.mirror.state
            )
        if step.slave.state == State.ENGAGED.value:
            assert repr(simulation.slave.incoming[0].decoder.state) == repr(
                simulation.master.outgoing[0].encoder.mirror.state
            )
    assert sends > 0


@given(
    predictor=st.sampled_from(["zoh", "linear", "plane", "sphere", "hybrid"]),
    seed=st.integers(0, 2**31),
    burst=st.sampled_from([1, 5, 20]),
)
@examples(4)
def test_after_any_fault_the_first_update_that_arrives_restores_the_state(
    predictor: str, seed: int, burst: int
) -> None:
    follow_states_over_a_bad_link(predictor, seed, burst)


def test_a_bad_link_does_carry_updates() -> None:
    """What keeps the property above from being empty: a burst of 20 may outlast a run that has not yet connected."""
    forces, positions = follow_states_over_a_bad_link("hybrid", seed=1, burst=20)
    assert forces > 20
    assert positions > 200


def follow_states_over_a_bad_link(predictor: str, seed: int, burst: int) -> tuple[int, int]:
    """Returns at how many ticks a force and a position state were compared."""
    simulation = system(
        *BAD_LINK, f"link.emulate.seed={seed}", f"link.emulate.burst={burst}", f"codec.force.predictor={predictor}"
    )
    forces, positions = Restorations(), Restorations()
    for step in steps(simulation, 3.0):
        forces.look(step.slave.sent, simulation.slave.outgoing[0].encoder, simulation.master.incoming[0].decoder)
        positions.look(step.master.sent, simulation.master.outgoing[0].encoder, simulation.slave.incoming[0].decoder)
        assert norm(output(step.master)) <= 10.0 * (1 + 1e-9)
    assert simulation.master.faults.get("update", 0) == simulation.slave.faults.get("update", 0) == 0
    return forces.checked, positions.checked


class Restorations:
    """What the sender held when it sent a sample is what the receiver holds once that sample is there."""

    def __init__(self) -> None:
        self.held: dict[int, object] = {}
        self.checked = 0

    def look(self, sent: int, encoder, decoder) -> None:  # type: ignore[no-untyped-def]
        mirror = encoder.mirror
        if sent:
            self.held[mirror.newest.tick] = mirror.state
        if decoder.newest is not None:
            assert repr(decoder.state) == repr(self.held[decoder.newest.tick])
            self.checked += 1


class LagSpike(EmulatedLink[Address]):
    """A link that holds everything for a while, and then delivers it in one burst."""

    BEGIN, END = 2.0, 2.6

    def __init__(self) -> None:
        super().__init__(Emulation(), lambda: 0.0)
        self.updates_sent_at: list[float] = []

    def send(self, data: bytes, tag: Address, now: float) -> None:
        if kind_of(data) == Kind.UPDATE:
            self.updates_sent_at.append(now)
        super().send(data, tag, now)

    def receive(self, now: float) -> list[tuple[bytes, Address]]:
        return [] if self.BEGIN <= now < self.END else super().receive(now)

    def next_due(self) -> float | None:
        due = super().next_due()
        return self.END if due is not None and self.BEGIN <= due < self.END else due


def test_after_a_lag_spike_no_command_older_than_the_limit_is_executed() -> None:
    built = system()
    forward = LagSpike()
    links = forward, EmulatedLink[Address](Emulation(), lambda: 0.0)
    simulation = Simulation(master=built.master, slave=built.slave, links=links, tick_period=TICK)
    statistics = simulation.slave.endpoint.statistics
    accepted = [statistics.updates_received[0] for _ in steps(simulation, 3.0)]
    burst = round(LagSpike.END / TICK)
    held = [at for at in forward.updates_sent_at if LagSpike.BEGIN <= at <= LagSpike.END]
    assert accepted[burst] == accepted[round(LagSpike.BEGIN / TICK)], (
        "the master was told within the limit, and stopped"
    )
    assert statistics.dropped[DropReason.STALE] >= len(held) > 0
    assert accepted[-1] > accepted[burst]
    assert simulation.slave.endpoint.state is State.ENGAGED


def blackout(start: float, seconds: float, *overrides: str) -> tuple[Simulation, list]:  # type: ignore[type-arg]
    simulation = system(f"link.emulate.blackouts_s=[[{start}, {seconds}]]", *overrides)
    return simulation, list(steps(simulation, start + seconds + 2.0))


@pytest.mark.parametrize("predictor", ["zoh", "linear", "hybrid"])
def test_in_silence_force_fades_to_zero_and_the_robot_holds_and_both_return_without_a_jump(predictor: str) -> None:
    start, seconds = 1.2, 1.0
    simulation, run = blackout(start, seconds, f"codec.force.predictor={predictor}", "control.scheme=none")
    contact = [norm(output(step.master)) for step in run if step.master.at < start]
    assert max(contact) > 1.0  # there was something to fade
    safe = [step for step in run if start + SILENCE + TICK < step.master.at < start + seconds]
    assert {output(step.master) for step in safe} == {ZERO}
    assert len({output(step.slave) for step in safe}) == 1
    assert all(step.slave.fault == Fault.SILENCE for step in safe)
    after = [step for step in run if step.master.at >= start + seconds - TICK]
    force_steps = [distance(output(b.master), output(a.master)) for a, b in pairwise(after)]
    motion_steps = [distance(output(b.slave), output(a.slave)) for a, b in pairwise(after)]
    # A ramp of 50 ms up to the limiter's 10 N, a speed of 0.25 m/s, and what an update corrects: the deadbands.
    peak = max(norm(output(step.master)) for step in after)
    assert max(force_steps) <= 10.0 * TICK / 0.05 + 0.10 * peak + 0.05
    assert max(motion_steps) <= 0.25 * TICK + 0.3e-3
    assert run[-1].master.state == run[-1].slave.state == State.ENGAGED.value
    assert run[-1].master.fault == Fault.NONE
    assert simulation.master.faults == {"silence": 1}


def test_extrapolation_during_silence_is_bounded_by_ramp_limiter_and_horizon() -> None:
    """The link dies while the linear predictor climbs steeply and the hand moves fast."""
    _, run = blackout(0.95, 0.5, "codec.force.predictor=linear", "master.limits.force_n=5")
    assert max(norm(output(step.master)) for step in run) <= 5.0 * (1 + 1e-9)
    lost = next(step for step in run if step.master.at >= 0.95)
    held = next(step for step in run if step.slave.at >= 0.95 + SILENCE + TICK)
    assert distance(output(held.slave), output(lost.slave)) <= 0.6 * SILENCE * 0.5
    horizon = 0.95 + HORIZON_SHARE * SILENCE + 2.0 * TICK
    assert len({output(step.slave) for step in run if 0.96 <= step.slave.at < horizon - 0.01}) > 10
    assert len({output(step.slave) for step in run if horizon <= step.slave.at < 0.95 + SILENCE}) == 1


def test_retreat_backs_off_the_contact() -> None:
    _, run = blackout(1.5, 1.0, "slave.limits.on_silence=retract", "slave.limits.retract_m=0.02")
    before = next(step for step in run if step.slave.at >= 1.5)
    assert norm(raw(before.slave)) > 0.5
    end = next(step for step in run if step.slave.at >= 2.45)
    assert output(end.slave)[2] - output(before.slave)[2] > 0.015
    assert raw(end.slave) == ZERO


class Broken(OperatorDevice):
    """A device that fails from half a second on, in a way that a subclass names."""

    def latest(self, now: float) -> DeviceReading:
        reading = super().latest(now)
        return self.broken(reading) if now >= 0.5 else reading

    def broken(self, reading: DeviceReading) -> DeviceReading:
        raise DeviceFault("was unplugged")


class NotANumber(Broken):
    def broken(self, reading: DeviceReading) -> DeviceReading:
        return reading._replace(position=(nan, 0.0, 0.0))


class Infinite(Broken):
    def broken(self, reading: DeviceReading) -> DeviceReading:
        return reading._replace(position=(0.0, inf, 0.0))


class Frozen(Broken):
    def broken(self, reading: DeviceReading) -> DeviceReading:
        return reading._replace(at=0.5)


class Timeless(Broken):
    def broken(self, reading: DeviceReading) -> DeviceReading:
        return reading._replace(at=nan)


@pytest.mark.parametrize(
    ("device", "complaint", "within"),
    [
        (Timeless, "reports the time nan", 22),
        (Broken, "was unplugged", 1),
        (NotANumber, "reports the position (nan", 22),
        (Infinite, "inf", 22),
        (Frozen, "gives no new sample", 22),
    ],
)
def test_a_device_that_fails_gives_zero_force_and_leaves_with_the_reason(
    device: type[Broken], complaint: str, within: int
) -> None:
    simulation = system("master.device.home_m=[0, 0, -0.01]", device=device)
    run = list(steps(simulation, 2.0))
    assert simulation.master.stopped
    assert simulation.master.failure is not None
    assert complaint in simulation.master.failure
    assert len(run) <= 500 + within + 1
    assert output(run[-1].master) == ZERO
    assert all(norm(output(step.master)) < inf for step in run)


class Glitch(OperatorDevice):
    """One sample that is no number now and then."""

    def latest(self, now: float) -> DeviceReading:
        reading = super().latest(now)
        return reading._replace(position=(nan, nan, nan)) if round(now / TICK) % 97 == 0 else reading


def test_a_single_bad_sample_is_passed_over() -> None:
    simulation = system(device=Glitch)
    run = list(steps(simulation, 2.0))
    assert simulation.master.failure is None
    assert all(norm(output(step.slave)) < inf for step in run)
    assert max(norm(raw(step.slave)) for step in run) > 0.5


class Numb(PointRobot):
    """A robot whose force sensor says NaN from half a second on."""

    def latest(self, now: float) -> RobotReading:
        reading = super().latest(now)
        return reading._replace(force=(nan, 0.0, 0.0)) if now >= 0.5 else reading


class Astray(PointRobot):
    """A robot whose encoders say NaN from half a second on."""

    def latest(self, now: float) -> RobotReading:
        reading = super().latest(now)
        return reading._replace(position=(0.0, nan, 0.0)) if now >= 0.5 else reading


class Overflown(PointRobot):
    """A robot whose encoders say infinity from half a second on."""

    def latest(self, now: float) -> RobotReading:
        reading = super().latest(now)
        return reading._replace(position=(0.0, 0.0, -inf)) if now >= 0.5 else reading


class Undated(PointRobot):
    """A robot whose readings have no time from half a second on."""

    def latest(self, now: float) -> RobotReading:
        reading = super().latest(now)
        return reading._replace(at=nan) if now >= 0.5 else reading


class Dead(PointRobot):
    def latest(self, now: float) -> RobotReading:
        if now >= 0.5:
            raise RobotFault("does not answer")
        return super().latest(now)


@pytest.mark.parametrize(
    ("robot", "complaint"),
    [
        (Numb, "reports the force (nan"),
        (Astray, "reports the position (0.0, nan"),
        (Overflown, "reports the position (0.0, 0.0, -inf"),
        (Undated, "reports the time nan"),
        (Dead, "does not answer"),
    ],
)
def test_a_robot_that_fails_leaves_with_the_reason_and_the_operator_is_let_go(
    robot: type[PointRobot], complaint: str
) -> None:
    simulation = system(robot=robot)
    run = list(steps(simulation, 1.0))
    assert simulation.slave.failure is not None
    assert complaint in simulation.slave.failure
    assert output(run[-1].master) == ZERO
    assert run[-1].master.state == State.CONNECTING.value
    assert all(norm(output(step.slave)) < inf for step in run)


class Blind(PointRobot):
    """A robot that does not know where it is when it is opened."""

    def latest(self, now: float) -> RobotReading:
        return super().latest(now)._replace(position=(nan, nan, nan))


def test_a_robot_that_does_not_know_where_it_is_cannot_be_opened() -> None:
    simulation = system(robot=Blind)
    with pytest.raises(RobotFault, match="reports the position"):
        simulation.step()


def test_stopping_fades_the_force_out_and_says_goodbye() -> None:
    simulation = system()
    forces: list[Vector] = []
    for step in steps(simulation, 5.0):
        if step.index == 1500:
            simulation.master.stop(step.master.at, "interrupted")
        forces.append(output(step.master))
    assert simulation.master.stopped
    assert len(forces) < 1500 + 60
    drops = [norm(a) - norm(b) for a, b in pairwise(forces[1500:])]
    assert max(drops) <= 10.0 * TICK / 0.05
    simulation.step()
    assert simulation.slave.endpoint.state is State.LISTENING


def test_ends_that_disagree_name_both_values_and_the_slave_lives_on() -> None:
    master, slave = configuration("codec.force.weber=0.1"), configuration("codec.force.weber=0.05")
    simulation = build_simulation(master)
    simulation.slave = build_simulation(slave).slave
    run = list(steps(simulation, 1.0))
    assert simulation.master.failure == "refused: codec.force.weber: master has 0.1, slave has 0.05"
    assert simulation.master.stopped
    assert output(run[-1].master) == ZERO
    assert simulation.slave.failure is None
    assert simulation.slave.faults == {"refused": 1}
    assert simulation.slave.endpoint.state is State.LISTENING


def test_a_run_without_a_session_has_failed_and_not_completed() -> None:
    simulation = system("link.emulate.loss=1")
    for step in steps(simulation, 3.0):
        if step.index == 2000:
            simulation.master.stop(step.master.at, "completed")
    assert simulation.master.failure == "the slave did not answer in 2.0 s"
    assert simulation.master.outcome == simulation.master.failure


def test_press_limit_makes_no_chatter_of_taps_on_a_damped_surface() -> None:
    taps = "{driver: operator, script: [{motion: tap, at_m: [0, 0, 0], frequency_hz: 3, depth_m: 0.03}]}"
    felt = []
    for limit in (10, 30):
        simulation = system(
            "control.scheme=none",
            f"master.device={taps}",
            "slave.scene=[{shape: plane, stiffness_n_m: 500, damping_n_s_m: 20}]",
            f"slave.limits.contact_n={limit}",
        )
        felt.append([norm(raw(step.slave)) for step in steps(simulation, 2.2)])
    contacts = [sum(a < LEAST_CONTACT <= b for a, b in pairwise(forces)) for forces in felt]
    assert simulation.slave.record().contact_ticks == 0, "it reaches the lower limit alone"
    assert contacts[0] <= 3 * contacts[1]
    assert sum(force > 10.5 for force in felt[0]) <= contacts[0], "an impact is above the limit for a tick"
