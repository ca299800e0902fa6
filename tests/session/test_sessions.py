"""Laws of a session, for every kind: over a bad link, interrupted, released, tripped, stopped, refused."""

from collections.abc import Callable
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest

from tests.session.kinds import (
    HAND,
    INTERRUPTIONS,
    KINDS,
    RAMP,
    SILENCE,
    STEP,
    TICK,
    Channel,
    Interruption,
    Kind,
    Run,
    Values,
    changed,
    each_kind,
    interrupted,
    run,
    says,
)
from tests.session.systems import ARMS, configuration, system
from weberlink.codec.choice import CHOICES
from weberlink.protocol.emulation import EmulatedLink, Emulation
from weberlink.protocol.events import Address
from weberlink.protocol.liveness import HORIZON_SHARE
from weberlink.protocol.states import State
from weberlink.session.simulation import Simulation
from weberlink.slave.guard import TRIP_PAUSE
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import FINITE, FORCE, RELEASED, TORQUE

BAD = (
    "link.emulate={delay_ms: 3, jitter_ms: 4, loss: 0.3, burst: BURST, reorder: 0.05, duplicate: 0.05, corrupt: 0.05,"
    " seed: SEED}"
)
ENGAGED = State.ENGAGED.value
HEARTBEAT_BYTES = 20
FORCE_STEP = 0.5e-3 * sqrt(3.0) * (1 + 1e-6)
TORQUE_STEP = 0.5e-4 * sqrt(3.0) * (1 + 1e-6) + 1e-6  # both are the rounding on the wire, and this that of a record


def bad(seed: int = 1, burst: int = 5) -> str:
    return BAD.replace("SEED", str(seed)).replace("BURST", str(burst))


# --- without faults, and over a bad link


@each_kind
def test_same_seed_same_run_bit_for_bit(kind: Kind) -> None:
    runs = [run(kind, 0.7, bad(seed)) for seed in (5, 5, 6)]
    first, same, other = (each.master.tobytes() + each.slave.tobytes() for each in runs)
    assert first == same != other


LOOKAHEAD = ("codec.force.lookahead_ms=20", "codec.position.lookahead_ms=5", "control.scheme=none")
CODED: list[tuple[str, tuple[str, ...]]] = [
    *(("hand", (f"codec.force.predictor={name}",)) for name in ("zoh", "linear", "plane", "sphere", "hybrid")),
    ("hand", ("axes=z", "codec.force.predictor=hybrid")),
    ("hand", ("axes=z", "codec.force.predictor=linear")),
    *(("hand", (*LOOKAHEAD, f"codec.force.predictor={name}")) for name in CHOICES),
    *(("turning", (f"codec.rotation.torque.predictor={name}",)) for name in ("linear", *CHOICES)),
    ("arm", ()),
]


def coded_within(run: Run, name: str, *, ahead: bool) -> None:
    """What the peer holds of force and torque is within the deadband; to rounding in a tick with an update."""
    slave = run.slave
    whole = (slave["state"] == ENGAGED) & (slave["ramping"] == 0)
    assert whole.sum() > 300
    counted = slave[whole]
    if name == "arm":
        built = run.simulation.slave.outgoing
        error, torques = np.abs(counted["decoded"] - counted["raw"])[:, :6], np.abs(counted["raw"])[:, :6]
        codec = configuration(*KINDS["arm"].overrides, file=ARMS).system.codec
        assert codec.joints is not None and codec.gripper is not None and len(built) == 2
        floors = np.array([codec.joints.torque.floor_nm] * 5 + [codec.gripper.torque.floor_nm], float)
        webers = np.array([codec.joints.torque.weber] * 5 + [codec.gripper.torque.weber])
        assert torques.max() > 0.1
        assert (error <= np.maximum(webers * torques, floors) * (1 + 1e-6) + 1e-6).all()
        return
    error = np.linalg.norm((counted["decoded"] - counted["coded"])[:, FORCE], axis=1)
    bound = counted["bound"] * (1 + 1e-9)
    assert (error <= (np.maximum(bound, FORCE_STEP) if ahead else np.where(counted["sent"], FORCE_STEP, bound))).all()
    assert counted["sent"].sum() > 0 and np.linalg.norm(counted["coded"][:, FORCE], axis=1).max() > 0.5
    if name == "turning":
        error = np.linalg.norm((counted["decoded"] - counted["raw"])[:, TORQUE], axis=1)
        assert (error <= np.where(counted["second_sent"], 0.0, counted["second_bound"]) + TORQUE_STEP).all()
        assert counted["second_sent"].sum() > 0 and np.linalg.norm(counted["raw"][:, TORQUE], axis=1).max() > 0.02


@pytest.mark.parametrize(("name", "overrides"), [row for row in CODED if row[0] in KINDS])
def test_without_faults_both_ends_hold_the_same_and_within_the_deadband(name: str, overrides: tuple[str, ...]) -> None:
    compared = [0, 0]

    def same(simulation: Simulation) -> None:
        master, slave = simulation.master, simulation.slave
        for sent, held in zip(slave.outgoing, master.incoming, strict=True):
            if sent.update is None:  # otherwise it arrives before the next tick
                assert repr(held.decoder.state) == repr(sent.encoder.mirror.state)
                compared[0] += held.decoder.newest is not None
        if slave.endpoint.state is State.ENGAGED:
            for sent, held in zip(master.outgoing, slave.incoming, strict=True):
                assert repr(held.decoder.state) == repr(sent.encoder.mirror.state)
                compared[1] += held.decoder.newest is not None

    coded_within(run(KINDS[name], 2.0, *overrides, watch=same), name, ahead=LOOKAHEAD[0] in overrides)
    assert min(compared) > 500


@pytest.mark.parametrize(("waited", "fails"), [(0.9, False), (1.0, False), (1.001, True)])
def test_who_waited_for_no_longer_than_the_patience_has_not_failed(waited: float, fails: bool) -> None:
    acts = {waited: lambda simulation: simulation.master.stop(waited, "completed")}
    master = run(HAND, 2.0, "link.emulate.loss=1", acts=acts).simulation.master
    assert master.stopped and (master.failure is not None) == fails
    assert master.outcome == (master.failure or "completed")


# --- interruptions


OWN = "cut both ways", "master stopped", "slave stopped"
INTERRUPTED = [
    *(("hand", name, "none") for name in INTERRUPTIONS),
    *(("hand", name, "bounded") for name in ("cut both ways", "slave stopped")),
    *((of, name, "none") for of in KINDS if of != "hand" for name in OWN),
]
"""What the link and the session decide alone is the same for every kind."""


@pytest.mark.parametrize(("of", "name", "scheme"), INTERRUPTED)
def test_an_interruption_ends_force_and_motion_and_both_return_softly(of: str, name: str, scheme: str) -> None:
    kind, how = KINDS[of], INTERRUPTIONS[name]
    ran = interrupted(kind, how, f"control.scheme={scheme}")
    begin, end = ran.at(kind.begin), ran.at(kind.begin + how.lasts)
    master, slave = ran.master, ran.slave
    faults = ran.simulation.master.faults, ran.simulation.slave.faults
    assert tuple(map(set, faults)) == how.faults
    assert all(counts.get(fault, 1) == 1 for counts in faults for fault in ("silence", "stalled"))
    for column in FINITE:
        assert np.isfinite(master[column]).all() and np.isfinite(slave[column]).all()
    limit_passed = slice(begin + ran.at(SILENCE) + 12, end)
    for channel in kind.channels:
        felt = channel.size(channel.output(master))
        assert felt[begin - 1] > channel.pressed
        assert felt.max() <= channel.limit * (1 + 1e-6)
        if how.stops == "master":  # a device that stands still keeps what it has, until its own limit
            assert felt[end] == 0.0 and master["fault"][end] == Fault.STALLED
        elif how.lasts > SILENCE:
            assert (felt[limit_passed] == 0.0).all()
        if how.lasts > SILENCE:
            assert len(np.unique(channel.output(slave)[limit_passed], axis=0)) == 1, "it holds"
        if scheme == "none" and how.fades:
            back = end + int(np.argmax((master["state"][end:] == ENGAGED) & (master["fault"][end:] != how.fades)))
            gated(channel, ran, back, opening())
        follows_softly(channel, slave, end, alone=len(kind.channels) == 1)
    if how.stops == "slave":
        assert slave["fault"][end] == Fault.STALLED
        assert kind.channels[0].steps(slave)[end - 1] <= 1e-3, "it holds where it is"
    for side in (master, slave):
        assert (side["state"][-1], side["fault"][-1], side["ramping"][-1]) == (ENGAGED, Fault.NONE, 0)
    assert kind.channels[0].size(kind.channels[0].output(master))[-200:].max() > 0.4 * kind.channels[0].pressed


def gated(channel: Channel, ran: Run, first: int, shares: Values) -> None:
    """From a tick on, no more is felt than these shares of what is decoded."""
    ticks = slice(first, first + len(shares))
    felt, decoded = (channel.size(of(ran.master)[ticks]) for of in (channel.output, channel.decoded))
    most = np.maximum.accumulate(decoded)  # the slew limit may be behind
    assert (felt <= shares[: len(felt)] * most * (1 + 1e-5) + 1e-9).all()


def opening() -> Values:
    return np.arange(1, round(RAMP / TICK)) * STEP


def closing() -> Values:
    return opening()[::-1]


def follows_softly(channel: Channel, slave: Values, end: int, *, alone: bool) -> None:
    """Until the robot is at the hand it moves slowly; a robot that also turns may be there in one channel alone."""
    steps = channel.steps(slave)
    ramping = np.flatnonzero(slave["ramping"][end:] == 1)
    arrived = end + (ramping[-1] - round(RAMP / TICK) if len(ramping) else 0)
    on_the_way = steps[end - 1 : max(end, arrived - 1)]
    assert not alone or (on_the_way <= channel.approach * TICK * (1 + 1e-4)).all()
    assert steps[end - 1 :].max() <= channel.approach * TICK + channel.correction


@pytest.mark.parametrize(("seconds", "stalls"), [(0.018, False), (0.020, True), (5.0, True)])
def test_a_pause_is_a_stall_from_its_limit_on(seconds: float, stalls: bool) -> None:
    """The limit is 20 ms from tick to tick, a tick more than the pause."""
    ran = interrupted(HAND, Interruption(seconds, (set(), set()), stops="master"), after=0.3)
    assert ("stalled" in ran.simulation.master.faults) == stalls


def test_what_is_decoded_after_the_horizon_does_not_change_any_more() -> None:
    """The link dies while the hand moves fast and the force climbs."""
    ran = run(HAND, 1.04, "link.emulate.blackouts_s=[[0.95, 0.5]]", "codec.force.predictor=linear")
    horizon = ran.at(0.95 + HORIZON_SHARE * SILENCE) + 2
    for values in (ran.slave["position"], ran.master["decoded"]):
        assert len(np.unique(values[ran.at(0.96) : horizon - 10], axis=0)) > 10
        assert len(np.unique(values[horizon:], axis=0)) == 1


class Sagging(HAND.robot):  # type: ignore[misc]
    """A robot that sinks by 3 cm while its host stands still, as one whose motors have let go."""

    def latest(self, now: float) -> Any:
        reading = super().latest(now)
        x, y, z = reading.position
        sinks = HAND.begin + 0.2 < now < HAND.begin + 0.301
        return reading._replace(position=(x, y, z - 0.03)) if sinks else reading


def test_stall_of_the_slave_restarts_from_the_measured_position() -> None:
    ran = interrupted(HAND, INTERRUPTIONS["slave stopped"], robot=Sagging)
    end = ran.at(HAND.begin + 0.3)
    heights = ran.slave["output"][:, 2]
    assert heights[end - 1] - heights[end] == pytest.approx(0.03)
    assert HAND.channels[0].steps(ran.slave)[end : end + 50].max() <= 0.25 * TICK * (1 + 1e-9)


class UpdatesLost(EmulatedLink[Address]):
    def send(self, data: bytes, tag: Address, now: float) -> None:
        if len(data) <= HEARTBEAT_BYTES or not 1.45 <= now < 1.67:
            super().send(data, tag, now)


def test_a_pause_of_the_peers_updates_takes_no_energy_from_a_hand_that_holds_on() -> None:
    """As after a burst of losses: the gate closes, and what the hand has put in pays for what comes next."""

    def lose(simulation: Simulation) -> None:
        simulation._backward = UpdatesLost(Emulation(), lambda: 0.0)

    often = ("codec.force.predictor=zoh", "codec.force.weber=0.001")
    ran = run(HAND, 1.9, "slave.scene=[{shape: plane, stiffness_n_m: 500}]", *often, acts={1.4: lose})
    felt, energy = HAND.channels[0].size(ran.master["output"]), ran.master["energy"]
    assert ran.simulation.master.faults == ran.simulation.slave.faults == {"undelivered": 1}
    assert (felt[1450] > 1.0, felt[1660], felt[-1] > 2.0) == (True, 0.0, True)
    assert np.diff(felt[1660:]).max() <= 10.0 * TICK / RAMP + 0.3
    back = 1660 + int(np.argmax(felt[1660:] > 0.0))
    assert energy[1660] > 0.02
    assert energy[back] == pytest.approx(energy[1660], rel=0.1)


# --- the operator's button

HELD = [(0.0, 0.0), (0.15, 0.4), (0.6, 0.8), (0.82, 9.0)]
"""When the operator holds the button, from `begin` on; before, always [s]."""


def with_button(kind: Kind, *overrides: str) -> Run:
    class WithButton(kind.device):  # type: ignore[misc, name-defined]
        """A device with two buttons, of which the second is held as in `HELD`."""

        def __init__(self, options: Any, tick_period: float) -> None:
            super().__init__(options, tick_period)
            self.spec = replace(self.spec, buttons=2)

        def latest(self, now: float) -> Any:
            since = now - kind.begin
            held = since < 0.0 or any(begin <= since < end for begin, end in HELD)
            return super().latest(now)._replace(buttons=held << 1)

    button = ("master.engage={button: 1}", "control.scheme=none")
    return run(kind, kind.begin + 1.0, *button, *overrides, device=WithButton)


@each_kind
def test_released_button_removes_force_and_holds_the_robot_and_both_changes_are_soft(kind: Kind) -> None:
    ran = with_button(kind)
    for begin, end in ((0.06, 0.15), (0.46, 0.6)):
        released = slice(ran.at(kind.begin + begin), ran.at(kind.begin + end))
        for channel in kind.channels:
            assert (channel.output(ran.master)[released] == 0.0).all()
            assert len(np.unique(channel.output(ran.slave)[released], axis=0)) == 1
        assert set(ran.master["ramping"][released]) == set(ran.slave["ramping"][released]) == {RELEASED}
        assert set(ran.master["sent"][released]) == {0}
        assert set(ran.master["buttons"][released]) == {0}
    for channel in kind.channels:
        for moment, shares in ((0.0, closing()), (0.15, opening()), (0.4, closing()), (0.6, opening())):
            begin, pressed = ran.at(kind.begin + moment), moment in (0.15, 0.6)
            begin += bool(ran.master["buttons"][begin]) is not pressed  # a time of `HELD` may round to the next tick
            assert bool(ran.master["buttons"][begin]) is pressed
            gated(channel, ran, begin, shares)
            moves = channel.steps(ran.slave)[begin - 1 : begin + 60]
            assert moves.max() <= channel.approach * TICK + channel.correction
        # Pressed again within the fade, it fades out first.
        felt = channel.size(channel.output(ran.master)[ran.at(kind.begin + 0.8) - 1 :][:150])
        assert felt.min() == 0.0
        assert (np.diff(felt) >= -(channel.limit * STEP + 0.15 * felt[:-1])).all()
    engaged = ran.master[100:], ran.slave[100:]
    assert {(*side["state"], *side["fault"]) == (ENGAGED,) * len(side) + (0,) * len(side) for side in engaged} == {True}
    first = kind.channels[0]
    assert first.size(first.output(ran.master))[-200:].max() > 0.3 * first.pressed


# --- what the robot's end does without its operator


@pytest.mark.parametrize("why", ["silence", "button"])
def test_retreat_backs_off_the_contact(why: str) -> None:
    retreat = ("slave.limits.on_silence=retract", "slave.limits.retract_m=0.02")
    if why == "silence":
        ran, end = interrupted(HAND, INTERRUPTIONS["cut both ways"], *retreat), HAND.begin + 0.59
    else:
        ran, end = with_button(HAND, *retreat), HAND.begin + 0.149
    before, after = ran.slave[ran.at(HAND.begin)], ran.slave[ran.at(end)]
    assert np.linalg.norm(before["raw"]) > 0.5 and not after["raw"].any()
    assert after["output"][2] - before["output"][2] > 0.01


def strong(kind: Kind) -> Any:
    """A robot whose contact is too strong from `begin` on, for a while."""
    change = says(torques=(0.0, -5.0, 0.0, 0.0, 0.0, 0.0)) if kind is KINDS.get("arm") else says(force=(0.0, 0.0, 20.0))
    return changed(kind.robot, change, kind.begin, kind.begin + 0.01)


@each_kind
def test_a_contact_above_the_limit_trips_the_robot(kind: Kind) -> None:
    limit = () if kind is KINDS.get("arm") else ("slave.limits.trip_n=15",)
    ran = run(kind, kind.begin + 0.3, *limit, robot=strong(kind))
    begin, channel = ran.at(kind.begin), kind.channels[0]
    assert ran.simulation.slave.faults == {"tripped": 1}
    assert set(ran.slave["fault"][begin:]) == {Fault.TRIPPED}
    assert channel.steps(ran.slave)[begin:].max() <= channel.approach * TICK * (1 + 1e-4)
    assert channel.size(channel.output(ran.slave)[-1] - channel.output(ran.slave)[begin - 1]) > 0.5e-2
    assert channel.size(channel.output(ran.master))[-1] < 0.1
    assert ran.master["state"][-1] == ENGAGED


def test_a_trip_lasts_until_the_hand_leaves_the_contact_and_outlives_the_session() -> None:
    """The master stands still for so long that the slave gives the session up; the hand is still deep then."""
    strict = ("slave.limits.trip_n=3", "codec.force.predictor=zoh")
    ran = run(HAND, 6.0, *strict)
    tripped = np.flatnonzero(ran.slave["fault"] == Fault.TRIPPED)
    felt, raw = (np.linalg.norm(values, axis=1) for values in (ran.master["output"], ran.slave["raw"]))
    assert raw[tripped[0]] > 3.0 >= raw.max() - 0.5
    assert not raw[tripped[0] + 100] and felt[tripped[0] + 100] < 0.1
    free = tripped[0] + int(np.argmax(ran.slave["fault"][tripped[0] :] == Fault.NONE))
    assert (free - tripped[0]) * TICK >= TRIP_PAUSE
    assert felt[free:].max() > 1.0, "it works again"
    deep = 1.5
    long = run(HAND, deep + 5.0, *strict, stop=("master", deep, 4.0))
    again = ran.at(deep + 4.0)
    again += int(np.argmax(long.slave["state"][again:] == ENGAGED))
    assert long.simulation.slave.endpoint.sessions == 2
    assert set(long.slave["fault"][again - 1000 : again + 100]) == {Fault.TRIPPED}


# --- the end


@each_kind
@pytest.mark.parametrize("why", ["interrupted", "taken over"])
def test_a_stop_fades_the_force_out_and_says_goodbye(kind: Kind, why: str) -> None:
    def end(simulation: Simulation) -> None:
        if why == "interrupted":
            simulation.master.stop(kind.begin, why)
        else:
            simulation.slave.endpoint.close(kind.begin, "taken over by operator@b")

    ran = run(kind, kind.begin + 0.3, "control.scheme=none", acts={kind.begin: end})
    begin, master = ran.at(kind.begin), ran.simulation.master
    assert master.stopped
    assert (master.failure is None) == (why == "interrupted")
    assert master.faults == ({} if why == "interrupted" else {"taken_over": 1})
    assert 0.8 * RAMP <= (len(ran.master) - begin) * TICK <= RAMP + 0.01
    for channel in kind.channels:
        felt = channel.size(channel.output(ran.master)[begin - 1 :])
        assert felt[0] > channel.pressed and felt[-1] == 0.0
        if why == "interrupted":
            gated(channel, ran, begin, closing())
        assert (np.diff(felt) >= -(channel.limit * STEP + 0.15 * felt[:-1])).all()
    if why == "interrupted":
        ran.simulation.step()
        assert ran.simulation.slave.endpoint.state is State.LISTENING


@each_kind
@pytest.mark.parametrize(("asked", "fades"), [("master", False), ("master", True), ("slave", False)])
def test_emergency_ends_force_and_motion_on_both_sides_at_once(kind: Kind, asked: str, fades: bool) -> None:
    """Also while a fade is under way."""
    acts: dict[float, Callable[[Simulation], object]] = {
        kind.begin: lambda simulation: getattr(simulation, asked).emergency(kind.begin)
    }
    if fades:
        acts[kind.begin - 0.01] = lambda simulation: simulation.master.stop(kind.begin - 0.01, "enough")
    ran = run(kind, kind.begin + 0.2, "link.emulate={delay_ms: 5}", acts=acts, after=0.2)
    side, begin = getattr(ran.simulation, asked), ran.at(kind.begin)
    assert (side.outcome, side.failure, side.stopped) == ("emergency stop", "emergency stop", True)
    for channel in kind.channels:
        felt = channel.size(channel.output(ran.master))
        assert felt[begin - 1] > 0.5 * channel.pressed
        assert (felt[begin + (0 if asked == "master" else 60) :] == 0.0).all()
        held = channel.output(ran.slave)[begin - 1 if asked == "slave" else begin + 20 :]
        assert (held == held[0]).all()
    assert ran.simulation.slave.endpoint.state is not State.ENGAGED
    if asked == "slave":
        assert ran.simulation.master.endpoint.state is not State.ENGAGED


# --- the two ends agree

DISAGREE = [
    ("hand", (), ("codec.force.weber=0.05",), "codec.force.weber"),
    ("hand", ("control.scheme=bounded",), ("control.scheme=none",), "control.scheme"),
    ("hand", (), ("control.allowance_j=0.1",), "control.allowance_j"),
    ("hand", (), ("codec.force.lookahead_ms=20",), "codec.force.lookahead_ms"),
    ("hand", (), ("codec.position.lookahead_ms=5",), "codec.position.lookahead_ms"),
    ("hand", (), ("codec.force.reference=sent",), "codec.force.reference"),
    ("turning", (), ("codec.rotation=null",), "codec.rotation"),
    ("turning", ("codec.rotation=null",), (), "codec.rotation"),
    ("arm", (), ("codec.joints.torque.weber=0.3",), "codec.joints.torque.weber"),
]


@pytest.mark.parametrize(("name", "ours", "its", "field"), [row for row in DISAGREE if row[0] in KINDS])
def test_ends_that_disagree_name_the_field_and_the_slave_lives_on(
    name: str, ours: tuple[str, ...], its: tuple[str, ...], field: str
) -> None:
    kind = KINDS[name]
    simulation = system(*kind.overrides, *ours, file=kind.file)
    simulation.slave = system(*kind.overrides, *its, file=kind.file).slave
    while not simulation.master.stopped:
        master, _ = simulation.advance(1)
    assert simulation.master.failure is not None and simulation.master.failure.startswith(f"refused: {field}")
    assert (simulation.master.faults, simulation.slave.faults) == ({"refused": 1}, {"refused": 1})
    assert (simulation.slave.failure, simulation.slave.endpoint.state) == (None, State.LISTENING)
    assert not master["output"].any()
