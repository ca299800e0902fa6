"""What of the force on the hand is founded: the received model, where the robot was as the newest news of it left."""

from math import inf
from types import SimpleNamespace
from typing import Any

import pytest

from tests.arms.ends import TICK, link
from tests.compiled import replaces_methods
from weberlink.codec import Decoder, Encoder, force_channel
from weberlink.control.contract import UNREACHED_S, SentCommands
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.master.gate import GRACE, LOOK_S, PATIENCE, ContactLimiter, HandContact

pytestmark = replaces_methods  # a stand-in for an endpoint, a compiled class
STIFFNESS, RTT, DEPTH = 500.0, 0.1, 0.01
INSIDE, OUTSIDE = (0.0, 0.0, -DEPTH), (0.0, 0.0, 0.005)
PRESSED = (0.0, 0.0, STIFFNESS * DEPTH)
RTT_TICKS = round(RTT / TICK)
PATIENT = round((RTT + PATIENCE) / TICK)


class Watched:
    """A watch whose decoder has received the plane z = 0, or one sample."""

    def __init__(self, predictor: str = "plane", *depths: float, jitter: float = 0.0, delay: float = 0.0) -> None:
        channel = force_channel(predictor=predictor)
        self.encoder, self.decoder = Encoder(channel), Decoder(channel)
        self.tick = 0
        for depth in depths or (0.5 * DEPTH, DEPTH):
            self.receive(depth)
        self.asked: list[float] = []
        self.link = link(RTT, jitter)
        self.link.request_answer = lambda: self.asked.append(self.now)
        self.liveness = self.link.liveness
        self.hand: Any = SimpleNamespace(sampled=ZERO, felt=SimpleNamespace(asked=0.0))
        self.watch = HandContact(
            ContactLimiter(10.0, 1.0, 1.0), self.decoder, self.link, self.hand,
            least=0.05, sent=SentCommands(TICK, 1.0), delay=delay, playout=0,
        )  # fmt: skip

    @property
    def now(self) -> float:
        return self.tick * TICK

    def receive(self, depth: float) -> None:
        """A complete update: of a robot so deep in the plane, whatever was predicted."""
        self.tick += 1
        if self.encoder.mirror.newest is not None and self.tick > 2:
            self.encoder.restart()
        update = self.encoder.encode(self.tick, (0.0, 0.0, STIFFNESS * depth), (0.0, 0.0, -depth))
        if update is not None:
            self.decoder.apply(update)

    def command(self, command: Vector, force: Vector) -> None:
        self.tick += 1
        self.hand.sampled, self.hand.felt.asked = command, norm(force)
        self.watch.begin(float(self.tick), self.now)

    def go(self, command: Vector, force: Vector, ticks: int, *, heard: bool = True) -> list[float]:
        """Command this, and ask for this force; returns what is displayed in each tick [N]."""
        shown = []
        for _ in range(ticks):
            self.command(command, force)
            self.liveness.encoder_heard_at = self.now if heard else self.liveness.encoder_heard_at
            shown.append(min(norm(force), self.watch.bound(norm(force), force, TICK)))
        return shown


def test_a_robot_that_was_in_the_model_long_ago_states_nothing_now() -> None:
    """The newest sample is a contact, and no update follows while the model is right: there is none out there."""
    watched = Watched()
    watched.go(INSIDE, PRESSED, 500)
    shown = watched.go(OUTSIDE, PRESSED, 1000)
    assert shown[: RTT_TICKS - 1] == [norm(PRESSED)] * (RTT_TICKS - 1)
    assert max(shown[RTT_TICKS + PATIENT + 20 :]) <= 1.0
    assert shown[-1] == 0.0
    assert watched.watch.limiter.unfounded


@pytest.mark.parametrize("jitter", [0.0, 0.02, 0.05])
def test_a_correction_of_the_model_is_waited_for_by_the_jitter_longer(jitter: float) -> None:
    """So much later the place counts that the robot left, and so much later the force ends."""
    lasts = []
    for late in (0.0, jitter):
        watched = Watched(jitter=late)
        watched.go(INSIDE, PRESSED, 500)
        shown = watched.go(OUTSIDE, PRESSED, 1000)
        lasts.append(next(tick for tick, force in enumerate(shown) if force < norm(PRESSED)))
    assert lasts[1] - lasts[0] == round(jitter / TICK)


def test_a_hand_ahead_of_the_robot_in_the_model_is_waited_for() -> None:
    watched = Watched()
    watched.go(OUTSIDE, ZERO, 500)
    assert set(watched.go(INSIDE, PRESSED, 3000)) == {norm(PRESSED)}


def test_an_update_with_a_force_states_a_contact_wherever_the_robot_was_commanded_to() -> None:
    watched = Watched()
    watched.go(OUTSIDE, ZERO, 500)
    for depth in (0.4, 0.6, 0.8):
        assert set(watched.go(OUTSIDE, PRESSED, PATIENT - 40)) == {norm(PRESSED)}
        watched.receive(depth * DEPTH)
        watched.go(OUTSIDE, PRESSED, 1)
        watched.receive(0.0)
    assert watched.go(OUTSIDE, PRESSED, 2 * PATIENT)[-1] < 1.0


def test_commands_that_jump_past_the_model_state_nothing() -> None:
    watched = Watched()
    watched.go(OUTSIDE, ZERO, 500)
    shown = [force for _ in range(20) for force in watched.go(OUTSIDE, PRESSED, 47) + watched.go(INSIDE, PRESSED, 3)]
    assert max(shown[PATIENT:]) <= 1.0


def told_limiter(watched: Watched) -> list[tuple[float, int]]:
    """What its limiter is told from now on: when a contact was stated [s], and for how many ticks one is claimed."""

    class Told(ContactLimiter):
        def bound(self, *values: float | None, stated: float, claimed: float = 0.0) -> float:  # type: ignore[override]
            told.append((stated, round(claimed / TICK)))
            return super().bound(*values, stated=stated, claimed=claimed)  # type: ignore[arg-type]

    told: list[tuple[float, int]] = []
    watched.watch.limiter = Told(10.0, 1.0, 1.0)
    return told


@pytest.mark.parametrize("before", [INSIDE, OUTSIDE])
def test_a_claim_of_the_model_grows_into_a_contact_once_an_answer_could_have_come(before: Vector) -> None:
    """For a hand that stays in the model: nothing, then a claim that grows, then a contact."""
    watched = Watched()
    for _ in range(500):  # nothing is asked for
        watched.command(before, PRESSED if before == INSIDE else ZERO)
        watched.liveness.encoder_heard_at = watched.now
    told = told_limiter(watched)
    watched.go(INSIDE, PRESSED, 400)
    first = next(tick for tick, (_, claimed) in enumerate(told) if claimed)
    met = next(tick for tick, (stated, _) in enumerate(told) if stated < inf)
    assert first == round((LOOK_S if before == INSIDE else RTT + LOOK_S) / TICK)
    assert [claimed for _, claimed in told[first:met]] == list(range(1, met - first + 1))
    assert met - first == round((UNREACHED_S + LOOK_S) / TICK) - 1
    assert set(told[met:]) == {(UNREACHED_S, 0)}
    watched.watch.reset()
    watched.watch.bound(norm(PRESSED), PRESSED, TICK)
    assert told[-1] == (inf, 0)


@pytest.mark.parametrize(("loss", "asked"), [(0.0, [15]), (0.05, [15, 20]), (0.3, [15, 20, 25])])
def test_silence_that_may_be_a_loss_states_no_contact_and_is_asked_about(loss: float, asked: list[int]) -> None:
    """The robot's end is heard no more: it may have corrected the model. On a lossy link it is asked again."""
    watched = Watched()
    watched.link.statistics.outgoing_loss = loss
    watched.go(OUTSIDE, ZERO, 500)
    began = watched.now
    shown = watched.go(INSIDE, PRESSED, 500, heard=False)
    assert [round((at - began) / TICK) for at in watched.asked] == asked
    assert max(shown[PATIENT:]) <= 1.0


@pytest.mark.parametrize(("late", "is_felt"), [(0, False), (RTT_TICKS, True)])
def test_a_contact_counts_once_something_is_heard_that_left_after_the_robot_was_there(late: int, is_felt: bool) -> None:
    watched = Watched()
    watched.go(OUTSIDE, ZERO, 500)
    watched.go(INSIDE, PRESSED, late, heard=False)
    watched.go(INSIDE, PRESSED, 1)
    assert (watched.go(INSIDE, PRESSED, 1000, heard=False)[-1] == norm(PRESSED)) is is_felt


def test_of_a_contact_that_a_sample_has_stated_all_is_heard() -> None:
    watched = Watched()
    watched.go(OUTSIDE, ZERO, 500)
    watched.go(INSIDE, PRESSED, 20)
    watched.receive(0.5 * DEPTH)
    assert set(watched.go(INSIDE, PRESSED, 1000, heard=False)) == {norm(PRESSED)}


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_a_force_without_a_model_ends_in_time_and_is_at_fault(delay: float) -> None:
    watched, patient = Watched("zoh", 0.0, delay=delay), PATIENT + round(delay / TICK)
    shown = watched.go(INSIDE, PRESSED, patient + round(GRACE / TICK))
    assert min(shown[: patient - 50]) == norm(PRESSED)
    assert max(shown[patient:]) <= 1.0
    assert watched.watch.limiter.unfounded
    watched.watch.reset()
    assert watched.go(INSIDE, PRESSED, 1) == [norm(PRESSED)]
