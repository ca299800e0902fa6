"""The port of a hand or a leader arm: what is displayed, and what is sent, in every state of a session."""

from math import inf, nan
from types import SimpleNamespace
from typing import Any

import pytest

from tests.arms.ends import TICK, Hand, Transparent, link, sensors, spec
from tests.compiled import replaces_methods
from tests.master.handle import Handle
from weberlink.arms.contract import ArmFault
from weberlink.codec import Decoder, Encoder, force_channel, position_channel
from weberlink.control.contract import FREE_FORCE, AccountParameters, MasterControl, SchemeParameters, SentCommands
from weberlink.geometry.joints import Joints
from weberlink.geometry.vector import ZERO, Vector, norm, scale
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.gate import FADE, GRACE, PATIENCE, Bound, ContactLimiter, ContactWatch, HandContact, OutputGate
from weberlink.master.operator_port import Display, HandPosition, OperatorPort
from weberlink.telemetry.record import RELEASED

pytestmark = replaces_methods  # a stand-in for an endpoint, a compiled class
RAMP, SILENCE, FADE_SHARE = 0.02, 0.05, 0.6
MOST, SLEW = 10.0, 3000.0
MOST_TORQUE, TORQUE_SLEW = 0.5, 100.0
RTT, BUTTON = 0.05, 1
PLACE = (0.01, -0.02, 0.03)
SETTINGS = SchemeParameters(TICK, 1000.0, AccountParameters(0.02, 0.01, 1.0, 0.1))


class Scheme(MasterControl):
    """Sends the robot elsewhere than the hand is, and takes down what it is told."""

    credit = 7

    def __init__(self) -> None:
        super().__init__(SETTINGS)
        self.told: list[Any] = []

    def observe(self, *seen: Any) -> None:
        self.told.append(("observe", *seen))

    def command(self, position: Vector) -> Vector:
        return position[0], position[1], position[2] + 0.006

    def refute(self) -> None:
        self.told.append("refute")

    def resume(self, peer_credit: int) -> None:
        self.told.append(("resume", peer_credit))


class Desk:
    """A port, tick by tick."""

    def __init__(self, *, contact: bool = False, button: int | None = None) -> None:
        self.handle, self.scheme, self.now = Handle(MOST), Scheme(), 100.0
        self.endpoint = link(RTT)
        self.endpoint.credit.known = 5
        self.hand = HandPosition(Encoder(position_channel()), self.scheme, 0.1, 0.02)
        self.encoder, self.decoder = Encoder(force_channel(predictor="zoh")), Decoder(force_channel(predictor="zoh"))
        watch = HandContact(
            ContactLimiter(MOST, FREE_FORCE, 0.5), self.decoder, self.endpoint, self.hand,
            least=0.05, sent=SentCommands(TICK, 1.0), delay=0.0, playout=0,
        )  # fmt: skip
        self.turning: Any = Transparent()
        bounds = [
            Bound((MOST,), (SLEW,), RAMP, contact=watch if contact else None),
            Bound((MOST_TORQUE,), (TORQUE_SLEW,), RAMP),
        ]
        force = self.hand.felt = Display(self.scheme, [self.hand], self.handle.command)
        wrist = SimpleNamespace(value=ZERO, way=(0.1, 0.0, 0.0))
        torque = Display(self.turning, [wrist], self.handle.turn, first=1)
        gate = OutputGate(bounds, ramp=RAMP, silence=SILENCE, fade_share=FADE_SHARE)
        self.port = OperatorPort(
            self.handle, displays=[force, torque], endpoint=self.endpoint, gate=gate, button=button
        )

    @property
    def requests(self) -> int:
        """How often a complete update was asked for."""
        return int(self.endpoint.asked["full state"])

    def tick(
        self, force: Vector | None, *, engaged: bool = True, heard: bool = True, runs: bool = True, step: float = TICK
    ) -> tuple[Vector, Vector]:
        """The force and a torque of a twentieth of it are decoded; gives what is on the hand then. The other end `runs`
        if its encoder is heard."""
        self.now += TICK
        liveness = self.endpoint.liveness
        liveness.in_touch_at = self.now if heard else liveness.in_touch_at
        liveness.encoder_heard_at = self.now if runs else liveness.encoder_heard_at
        self.port.actuate([force, force and scale(force, 0.05)], self.now, step, step, engaged=engaged)
        return self.handle.forces[-1], self.handle.torques[-1]

    def go(self, force: Vector | None, ticks: int, **how: Any) -> list[float]:
        return [norm(self.tick(force, **how)[0]) for _ in range(ticks)]

    def state(self, force: Vector) -> None:
        """An update of the robot's end arrives."""
        self.encoder.restart()
        update = self.encoder.encode(round((self.now - 100.0) / TICK) + 1, force, ZERO)
        assert update is not None
        self.decoder.apply(update)


PUSH = (0.0, 0.0, 8.0)


def test_the_force_fades_in_over_the_ramp_and_out_over_the_last_part_of_the_silence() -> None:
    desk = Desk()
    ramp = round(RAMP / TICK)
    risen = desk.go((0.0, 3.0, 0.0), ramp + 2)
    assert risen == pytest.approx([3.0 * min(1.0, (tick + 1) / ramp) for tick in range(ramp + 2)])
    faded = desk.go((0.0, 3.0, 0.0), 60, heard=False)
    begins, ends = round(FADE_SHARE * SILENCE / TICK), round(SILENCE / TICK)
    expected = [3.0 * max(0.0, min(1.0, (ends - tick) / (ends - begins))) for tick in range(1, 61)]
    assert faded == pytest.approx(expected, abs=1e-9)
    assert desk.go((0.0, 3.0, 0.0), 2) == pytest.approx([3.0 / ramp, 6.0 / ramp]), "and in again"


def test_a_jump_counts_as_a_tick_at_the_slew_limit_and_halt_is_zero_at_once() -> None:
    desk = Desk()
    desk.go(PUSH, 40)
    assert desk.tick((0.0, 0.0, -8.0))[0] == pytest.approx((0.0, 0.0, 8.0 - SLEW * TICK))
    assert desk.port.slew_ticks == 1
    shown = len(desk.handle.forces)
    desk.port.halt(desk.now)
    assert (desk.handle.forces[shown:], desk.handle.torques[shown:]) == ([ZERO], [ZERO])


def test_what_the_device_cannot_display_is_computed_and_not_felt() -> None:
    gate, scheme = OutputGate([Bound((1.0,), (SLEW,), RAMP)], ramp=TICK, silence=1.0, fade_share=0.5), Scheme()
    torque = Display(scheme, [SimpleNamespace(value=ZERO)], None)
    gate.fade(engaged=True, age=0.0, step=TICK)
    for _ in range(round(RAMP / TICK)):
        torque.show([(0.0, 0.0, 9.0)], gate, 0.0, TICK)
    assert (torque.decoded, torque.output) == ((0.0, 0.0, 9.0), (0.0, 0.0, 1.0))
    torque.halt(0.0)


# --- a force without a contact


@pytest.mark.parametrize("push", [(8.0, 0.0, 0.0), (0.0, -8.0, 0.0), (2.0, 2.0, 6.0)])
def test_a_force_that_nothing_founds_ends_and_the_scheme_is_told_once(push: Vector) -> None:
    desk = Desk(contact=True)
    limit, fade, grace = (round(seconds / TICK) for seconds in (RTT + PATIENCE, FADE, GRACE))
    shown = desk.go(push, limit + fade + grace)
    assert max(shown) == pytest.approx(norm(push))
    assert max(shown[limit + 1 :]) <= FREE_FORCE
    assert max(shown[limit + fade + 1 :]) == 0.0
    assert desk.scheme.told == ["refute", ("resume", 5)]
    assert (desk.requests, desk.port.unfounded) == (1, True)
    desk.state(push)
    desk.go(push, 1)
    assert not desk.port.unfounded
    assert desk.go(push, 60)[-1] == pytest.approx(norm(push)), "a stated contact brings it back"
    assert (desk.requests, len(desk.scheme.told)) == (1, 2)


@pytest.mark.parametrize("push", [(8.0, 0.0, 0.0), (0.0, -8.0, 0.0)])
def test_a_robots_end_that_stands_still_makes_no_fault_until_it_could_have_been_answered(push: Vector) -> None:
    """The force ends as in time, but the scheme has heard nothing that it could let go for."""
    desk = Desk(contact=True)
    limit, fade, grace = (round(seconds / TICK) for seconds in (RTT + PATIENCE, FADE, GRACE))
    shown = desk.go(push, limit + fade + 5 * grace, runs=False)
    assert max(shown[limit + fade + 1 :]) == 0.0
    assert (desk.scheme.told, desk.port.unfounded) == (["refute"], False)
    desk.go(push, grace)
    assert not desk.port.unfounded
    desk.go(push, 1)
    assert desk.port.unfounded


@pytest.mark.parametrize("forgets", ["reset", "restart"])
def test_what_was_heard_of_contacts_is_forgotten_with_the_session(forgets: str) -> None:
    desk = Desk(contact=True)
    desk.go(PUSH, 400)
    assert desk.port.unfounded
    getattr(desk.port, forgets)()
    assert (desk.port.unfounded, desk.port.at_rest) == (False, True)
    shown = desk.go(PUSH, 60)
    assert shown[-1] == norm(PUSH)
    desk.go(PUSH, 400)
    assert (desk.requests, desk.scheme.told.count("refute")) == (2, 2), "and doubted again"


def test_what_needs_no_contact_lasts() -> None:
    desk = Desk(contact=True)
    assert set(desk.go((0.0, 0.0, FREE_FORCE), 1000)[30:]) == {FREE_FORCE}
    assert (desk.requests, desk.scheme.told) == (0, [])


# --- what goes to the link and into the record


def test_the_command_of_the_scheme_goes_to_the_link_in_every_state() -> None:
    desk = Desk()
    desk.hand.take(DeviceReading(0.0, PLACE))
    for how in ({}, {"engaged": False}, {"heard": False}):
        desk.tick(PUSH, **how)
        assert desk.hand.sample(0)[0] == ZERO, "which is no force, felt at a place"
        assert desk.hand.sampled == (PLACE[0], PLACE[1], PLACE[2] + 0.006)
    desk.port.restart()
    assert desk.hand.sampled == (PLACE[0], PLACE[1], PLACE[2] + 0.006)
    assert desk.port.account(0.002, 17.0, encodes=False) == 7
    assert desk.scheme.told == [("observe", PLACE, 0.002, 17.0, 5, RTT)]
    assert desk.turning.told[-1] == ((0.1, 0.0, 0.0), 0.002, 17.0, 5, RTT)
    assert list(desk.port.controls) == [desk.scheme, desk.turning]


@pytest.mark.parametrize(("buttons", "enabled"), [(0, False), (1 << BUTTON, True), (1 << BUTTON + 1, False), (7, True)])
def test_the_button_alone_enables(buttons: int, enabled: bool) -> None:
    with_button, without = Desk(button=BUTTON), Desk()
    assert (with_button.port.enabled, without.port.enabled) == (False, True)
    for desk in (with_button, without):
        desk.handle.reading = DeviceReading(1.0, PLACE, buttons=buttons)
        reading = desk.port.latest(1.0)
        assert not desk.port.accept(reading), "a device does not trip"
        assert desk.port.buttons == buttons
    assert (with_button.port.enabled, without.port.enabled) == (enabled, True)


def test_the_record_has_what_the_hand_felt() -> None:
    desk = Desk(button=0)
    desk.hand.take(DeviceReading(0.0, PLACE))
    desk.hand.sample(0)
    desk.go((0.0, 0.0, 20.0), 10)
    force, torque = desk.port.displays
    assert (force.decoded, force.output) == ((0.0, 0.0, 20.0), desk.handle.forces[-1])
    assert (torque.decoded, torque.output) == ((0.0, 0.0, 1.0), desk.handle.torques[-1])
    assert force.asked == desk.port.gate.bounds[0].asked != torque.asked == desk.port.gate.bounds[1].asked
    row: Any = SimpleNamespace()
    desk.port.buttons = 0x1FF
    desk.port.report(row, is_led=True)
    displayed = {"decoded": force.decoded + torque.decoded, "output": force.output + torque.output}
    assert row.__dict__ == displayed | {"slew_ticks": 0, "clipped": True, "ramping": RELEASED, "buttons": 0xFF}
    desk.port.enabled = True
    desk.port.report(row, is_led=True)
    assert row.ramping is True


# --- a leader arm, where it differs

ARM_MOST, ARM_SLEW = (1.0, 0.8, 0.5), (50.0, 50.0, 20.0)
ARM_RAMP, ARM_RTT, FREE_NM = 0.05, 0.1, 0.2
ANGLES = (0.1, -0.2, 0.3)


class Leading:
    """A port tick by tick; with a `delay` [s], torques end on each channel for which nothing is stated."""

    def __init__(self, *, gripper: bool = True, delay: float | None = None) -> None:
        self.hand = Hand(spec(gripper=gripper))
        self.hand.angles = ANGLES[: self.hand.spec.axes]
        self.control: Any = Transparent()
        self.link = link(ARM_RTT)
        self.sensors, bounds = sensors("angles", self.hand.spec), []
        for sensor in self.sensors:
            most, watch = sensor.part(ARM_MOST), None
            if delay is not None:
                watch = ContactWatch(ContactLimiter(max(most), FREE_NM, 1.0), self.link, (0.02,) * len(most), delay)
            bounds.append(Bound(most, sensor.part(ARM_SLEW), ARM_RAMP, width=1, contact=watch))
        display = Display(self.control, self.sensors, self.hand.command)
        gate = OutputGate(bounds, ramp=ARM_RAMP, silence=0.1, fade_share=0.8)
        self.port = OperatorPort(self.hand, displays=[display], endpoint=self.link, gate=gate, fault=ArmFault)
        self.now = 0.0

    def tick(self, *values: Joints | None) -> Joints:
        """A tick; returns the torques displayed in it."""
        self.now += TICK
        self.link.liveness.in_touch_at = self.link.liveness.encoder_heard_at = self.now
        for sensor in self.sensors:
            sensor.take(self.port.latest(self.now))
        self.port.account(TICK, 0.0, encodes=True)
        self.port.actuate(values, self.now, TICK, TICK, engaged=True)
        return self.port.displays[0].output

    def opened(self, *values: Joints | None) -> Joints:
        """The torques once the gate is open."""
        shown = [self.tick(*values) for _ in range(round(2 * ARM_RAMP / TICK))]
        assert self.port.gate.gain == 1.0
        return shown[-1]


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        (((0.2, -0.3), (0.1,)), (0.2, -0.3, 0.1)),
        (((5.0, 0.1), (0.2,)), (1.0, 0.1, 0.2)),  # each axis is limited alone
        (((1.0, -0.9), (-0.6,)), (1.0, -0.8, -0.5)),
        (((0.2, -0.3),), (0.2, -0.3)),  # an arm without a gripper has one channel
    ],
)
def test_torques_of_all_channels_reach_their_axes_within_their_limits(
    values: tuple[Joints, ...], shown: Joints
) -> None:
    leading = Leading(gripper=len(values) == 2)
    assert leading.opened(*values) == leading.hand.felt[-1] == shown
    assert leading.control.told[0][0] == leading.hand.angles, "of whose motion they do work"
    assert leading.control.told[-1] == ("displayed", shown)
    assert leading.port.gate.clipped == (sum(values, ()) != shown)


@pytest.mark.parametrize("nothing", [None, (nan, 0.0), (0.0, -inf)])
def test_a_channel_of_which_nothing_of_use_is_decoded_displays_none(nothing: Joints | None) -> None:
    leading = Leading()
    leading.opened((0.5, 0.1), (0.3,))
    assert leading.opened(nothing, (0.3,)) == leading.port.displays[0].decoded == (0.0, 0.0, 0.3)
    assert leading.opened((0.5, 0.1), None) == (0.5, 0.1, 0.0)


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_torque_without_a_contact_ends_on_the_channel_that_has_none(delay: float) -> None:
    """What the gripper holds founds no torque of the joints."""
    leading = Leading(delay=delay)
    leading.opened((0.0, 0.0), (0.0,))
    leading.control.answer = (0.6, 0.1, 0.4)
    answer = round((ARM_RTT + delay + PATIENCE) / TICK)
    shown = [leading.tick((0.02, -0.02), (0.3,)) for _ in range(1000)]  # the least that states one, and no more
    assert max(abs(torques[0]) for torques in shown[answer:]) <= FREE_NM * (1 + 1e-9)
    assert shown[answer - 1][:2] == pytest.approx((FREE_NM, FREE_NM / 6.0), rel=0.05), "both as much shorter"
    assert {torques[2] for torques in shown[100:]} == {0.4}
    assert shown[-1][:2] == (0.0, 0.0)
    assert leading.port.unfounded
    assert leading.control.resumed == 1
    assert leading.tick((0.0, 0.05), (0.3,))[0] < 0.1, "any axis states one"
    assert not leading.port.unfounded
