"""Pictures on an emulated link, in virtual time: they arrive whole, give way on a slow link, and nothing grows."""

import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given, strategies as st

from weberlink.protocol.emulation import HEADER_BYTES, EmulatedLink, Emulation
from weberlink_figures.pictures import Picture
from weberlink_video.hub import Hub
from weberlink_video.options import MOST_CAMERAS
from weberlink_video.stream import DEADLINE_S, FORM_BYTES, HEAD, KEPT, MOST_FRAGMENTS, Receiver, Sender

STEP_S = 0.001
LOOK_S = 0.002
AROUND = 36  # bytes of a datagram beside the fragment, without the headers of IP and UDP
FORCE = bytes(80)


class Outcome(NamedTuple):
    ages: list[float]
    sent_bit_s: float
    force_s: float  # one way of an update of the session that shares the link, p99 after the first second

    def age(self, percent: int) -> float:
        return self.ages[len(self.ages) * percent // 100]


def run(emulation: Emulation, *, picture_bytes: int = 20_000, stall_s: float = 0.0) -> Outcome:
    """Pictures of one camera, 30 a second for 20 s, over a link with 100 updates of a force a second; reports back.

    On busy hosts each end stands still for up to `stall_s` after each look.
    """
    draw = random.Random(7).random
    sender, receiver = Sender(2e7), Receiver()
    forward = EmulatedLink[float](emulation, random.Random(8).random)
    backward = EmulatedLink[float](replace(emulation, rate_bit_s=None), random.Random(9).random)
    ages, force, sent = list[float](), list[float](), 0
    arrived: list[tuple[bytes, float]] = []
    sends_at = receives_at = looked_at = 0.0
    for step in range(20_000):
        now = step * STEP_S
        if draw() < 0.1:
            forward.send(FORCE, now, now)
        if step % 33 == 0:
            sender.put(0, step.to_bytes(4, "big") * (picture_bytes // 4), now, round(now * 1e6))
        if now >= sends_at:
            sends_at = now + LOOK_S
            for data, _ in backward.receive(now):
                sender.hear(data, now)
            for fragment in sender.take(now):
                sends_at = now + LOOK_S + stall_s * draw()
                sent += 8 * (len(fragment) + AROUND + HEADER_BYTES)
                forward.send(fragment + bytes(AROUND), now, now)
        came = forward.receive(now)
        force += (now - at for data, at in came if data == FORCE and now > 1.0)
        arrived += (each for each in came if each[0] != FORCE)
        if now < receives_at:
            continue
        receives_at, stood_s, looked_at = now + stall_s * draw(), now - looked_at - STEP_S, now
        ages += _ages(receiver, arrived, now, stood_s)
        arrived.clear()
        if (report := receiver.report(now, 2.0 * emulation.delay_s)) is not None:
            backward.send(report, now, now)
    return Outcome(sorted(ages), sent / 20.0, sorted(force)[len(force) * 99 // 100])


def _ages(receiver: Receiver, arrived: list[tuple[bytes, float]], now: float, stood_s: float) -> Iterator[float]:
    """Of the pictures that are whole with what has arrived."""
    for data, at in arrived:
        if (whole := receiver.take(data[:-AROUND], now - at, now, stood_s)) is not None:
            message, at_us = whole
            assert len({message[i : i + 4] for i in range(0, len(message), 4)}) == 1, "of one picture alone"
            yield now - at_us * 1e-6


@pytest.mark.parametrize("jitter_s", [0.0, 0.01, 0.03, 0.06])
def test_every_picture_arrives_soon_on_a_link_that_carries_them(jitter_s: float) -> None:
    outcome = run(Emulation(delay_s=0.001, jitter_s=jitter_s))
    assert len(outcome.ages) >= 580 - 3000 * jitter_s
    assert outcome.age(99) < 0.08 + 3.0 * jitter_s
    assert outcome.age(50) < 0.015 + jitter_s


@pytest.mark.parametrize(("delay_s", "loss", "least"), [(0.0, 0.0, 560), (0.025, 0.02, 400)])
def test_busy_hosts_are_no_queue_of_the_link(delay_s: float, loss: float, least: int) -> None:
    outcome = run(Emulation(delay_s=delay_s, loss=loss), stall_s=0.03)
    assert len(outcome.ages) >= least
    assert outcome.age(50) < delay_s + 0.03
    assert outcome.age(99) < 2.0 * delay_s + 0.15


def test_lost_fragments_are_sent_again() -> None:
    outcome = run(Emulation(delay_s=0.025, loss=0.02))
    assert len(outcome.ages) >= 420, "a newer picture that comes first replaces one that waits for a fragment"
    assert outcome.age(50) < 0.025 + 0.06
    assert outcome.age(99) < 0.025 + 0.12


@pytest.mark.parametrize("rate_bit_s", [1e6, 2e6, 5e6])
def test_pictures_give_way_on_a_slow_link(rate_bit_s: float) -> None:
    for stall_s in (0.0, 0.03):
        outcome = run(Emulation(delay_s=0.01, rate_bit_s=rate_bit_s), picture_bytes=30_000, stall_s=stall_s)
        assert outcome.force_s < 0.03 + 1e4 / rate_bit_s + stall_s / 2.0, (
            "what shares the link waits no longer behind pictures"
        )
        assert outcome.sent_bit_s > 0.4 * min(rate_bit_s, 7.2e6), "and the link is used"


def test_link_that_carries_nothing_leaves_nothing_behind() -> None:
    sender = Sender(1e7)
    for step in range(5000):
        now = step * STEP_S
        sender.put(step % 3, bytes(200_000), now, 0)
        list(sender.take(now))
    assert len(sender._sent) <= KEPT
    assert len(sender._queue) <= MOST_FRAGMENTS
    assert len(sender._next) <= 3


@given(
    st.lists(st.tuples(st.binary(max_size=40), st.integers(0, 5), st.integers(0, 2**32 - 1), st.integers(0, 65_535)))
)
def test_rubbish_is_dropped_and_kept_by_nobody(noise: list[tuple[bytes, int, int, int]]) -> None:
    receiver, sender = Receiver(), Sender(1e6)
    for number, (data, camera, message, count) in enumerate(noise):
        now = number * 0.1
        receiver.take(data, 0.0, now)
        receiver.take(HEAD.pack(camera, message, 0, count, 0) + data, 0.0, now)
        sender.hear(data, now)
        assert len(receiver._partial) <= KEPT
        assert len(receiver.report(now, 0.0) or b"") <= FORM_BYTES


def test_message_that_claims_gigabytes_is_dropped() -> None:
    receiver = Receiver()
    assert receiver.take(HEAD.pack(0, 1, 0, MOST_FRAGMENTS + 1, 0) + bytes(100), 0.0, 0.0) is None
    assert not receiver._partial


def test_picture_that_stays_incomplete_is_given_up() -> None:
    receiver = Receiver()
    receiver.take(HEAD.pack(0, 1, 1, 3, 0) + bytes(FORM_BYTES - HEAD.size), 0.0, 0.0)
    assert receiver.report(0.1, 0.0)
    receiver.report(DEADLINE_S + 0.2, 0.0)
    assert not receiver._partial


def test_cameras_that_the_other_end_names_without_end_are_dropped(tmp_path: Path) -> None:
    hub = Hub(tmp_path / "hub")
    for number in range(3 * MOST_CAMERAS):
        hub.put(Picture(0.0, str(number), b""))
    hub.put(Picture(1.0, "0", b""))
    assert list(hub.newest) == [str(number) for number in range(MOST_CAMERAS)]
    assert hub.newest["0"].at == 1.0
