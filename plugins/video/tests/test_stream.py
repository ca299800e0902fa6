"""Pictures on an emulated link, in virtual time: they arrive whole, give way on a slow link, and nothing grows."""

import heapq
import random
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.telemetry.pictures import Picture
from weberlink_video.hub import Hub
from weberlink_video.options import MOST_CAMERAS
from weberlink_video.stream import DEADLINE_S, FORM_BYTES, HEAD, KEPT, MOST_FRAGMENTS, Receiver, Sender

STEP_S = 0.002
DATAGRAM_OVERHEAD = 64
"""Bytes of a datagram beside the fragment, IP included."""


class Outcome(NamedTuple):
    ages: list[float]
    shown: int
    sent_bit_s: float
    worst_queue_s: float
    late_queue_s: float
    """In the second half."""


def run(
    *,
    rate_bit_s: float,
    delay_s: float,
    loss: float,
    picture_bytes: int = 20_000,
    rate_hz: float = 30.0,
    length_s: float = 20.0,
    stall_s: float = 0.0,
    jitter_s: float = 0.0,
) -> Outcome:
    """Pictures of one camera over a link with a queue of any length, and reports back.

    On busy hosts each end stands still for up to `stall_s` after each look.
    """
    draw = random.Random(7).random
    sender, receiver = Sender(2e7), Receiver()
    forward: list[tuple[float, int, bytes]] = []
    backward: list[tuple[float, int, bytes]] = []
    ages, queues, sent, count, free_at, due = [], [], 0, 0, 0.0, 0.0
    sends_at = receives_at = looked_at = 0.0
    for step in range(round(length_s / STEP_S)):
        now = step * STEP_S
        if now >= due:
            due += 1.0 / rate_hz
            sender.put(0, count.to_bytes(4, "big") * (picture_bytes // 4), now, round(now * 1e6))
            count += 1
        looks = now >= sends_at
        while looks and backward and backward[0][0] <= now:
            sender.hear(heapq.heappop(backward)[2], now)
        for fragment in sender.take(now) if looks else ():
            sends_at = now + stall_s * draw()
            sent += 8 * (len(fragment) + DATAGRAM_OVERHEAD)
            free_at = max(free_at, now) + 8 * (len(fragment) + DATAGRAM_OVERHEAD) / rate_bit_s
            queues.append((now, free_at - now))
            if draw() >= loss:
                heapq.heappush(forward, (free_at + delay_s + jitter_s * draw(), step, fragment))
        if now < receives_at:
            continue
        receives_at, stood_s, looked_at = now + stall_s * draw(), now - looked_at - STEP_S, now
        while forward and forward[0][0] <= now:
            at, left, data = heapq.heappop(forward)
            read_at = now if stall_s else at
            if (whole := receiver.take(data, read_at - left * STEP_S, now, stood_s)) is not None:
                message, at_us = whole
                assert len({message[i : i + 4] for i in range(0, len(message), 4)}) == 1, "of one picture alone"
                ages.append(now - at_us * 1e-6)
        if (report := receiver.report(now, 2.0 * delay_s)) is not None and draw() >= loss:
            heapq.heappush(backward, (now + delay_s, step, report))
    late = [queue for now, queue in queues if now > length_s / 2.0]
    return Outcome(sorted(ages), len(ages), sent / length_s, max(queue for _, queue in queues), max(late))


@pytest.mark.parametrize("jitter_s", [0.0, 0.01])
def test_every_picture_arrives_soon_on_a_link_that_carries_them(jitter_s: float) -> None:
    outcome = run(rate_bit_s=1e8, delay_s=0.001, loss=0.0, jitter_s=jitter_s)
    assert outcome.shown >= 580
    assert outcome.ages[len(outcome.ages) * 99 // 100] < 0.08
    assert outcome.ages[len(outcome.ages) // 2] < 0.015 + jitter_s


@pytest.mark.parametrize(("delay_s", "loss", "least"), [(0.0, 0.0, 570), (0.025, 0.02, 400)])
def test_busy_hosts_are_no_queue_of_the_link(delay_s: float, loss: float, least: int) -> None:
    outcome = run(rate_bit_s=1e8, delay_s=delay_s, loss=loss, stall_s=0.03)
    assert outcome.shown >= least
    assert outcome.ages[len(outcome.ages) // 2] < delay_s + 0.03
    assert outcome.ages[len(outcome.ages) * 99 // 100] < 2.0 * delay_s + 0.15


def test_lost_fragments_are_sent_again() -> None:
    outcome = run(rate_bit_s=1e8, delay_s=0.025, loss=0.02)
    assert outcome.shown >= 420, "a newer picture that comes first replaces one that waits for a fragment"
    assert outcome.ages[len(outcome.ages) // 2] < 0.025 + 0.06
    assert outcome.ages[len(outcome.ages) * 99 // 100] < 0.025 + 0.12


@pytest.mark.parametrize("rate_bit_s", [1e6, 2e6, 5e6])
def test_pictures_give_way_on_a_slow_link(rate_bit_s: float) -> None:
    for stall_s, longest in ((0.0, 0.035), (0.03, 0.1)):
        outcome = run(rate_bit_s=rate_bit_s, delay_s=0.01, loss=0.0, picture_bytes=30_000, stall_s=stall_s)
        assert outcome.late_queue_s < longest, "what shares the link waits no longer behind pictures"
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
