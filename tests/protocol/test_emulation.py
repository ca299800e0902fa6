from collections import Counter
from itertools import groupby
from random import Random

import pytest
from hypothesis import given, strategies as st

from tests.examples import examples
from weberlink.protocol.emulation import HEADER_BYTES, QUEUE_S, REORDER_HOLD, EmulatedLink, Emulation


def link(seed: int = 1, epoch: float = 0.0, **faults: object) -> EmulatedLink[int]:
    return EmulatedLink(Emulation(**faults), Random(seed).random, epoch)  # type: ignore[arg-type]


def test_delay_and_jitter_keep_bounds_and_order() -> None:
    made = link(delay_s=0.1, jitter_s=0.05)
    assert made.next_due() is None
    waits = []
    for number in range(2000):
        now = number * 0.1  # far enough apart that none waits for the one before
        made.send(b"x", number, now)
        due = made.next_due()
        assert due is not None
        waits.append(due - now)
        assert made.receive(due - 1e-6) == []
        assert made.receive(due) == [(b"x", number)]
    assert 0.1 <= min(waits) < 0.101
    assert 0.149 < max(waits) <= 0.15
    assert sum(waits) / len(waits) == pytest.approx(0.125, abs=0.002)


@pytest.mark.parametrize(
    ("loss", "burst"), [(0.0, 1.0), (0.01, 1.0), (0.3, 1.0), (1.0, 1.0), (0.1, 5.0), (0.3, 20.0), (0.5, 5.0)]
)
def test_losses_have_their_rate_and_their_mean_length(loss: float, burst: float) -> None:
    made, count = link(loss=loss, burst=burst), 60_000
    lost = []
    for number in range(count):
        made.send(b"x", number, 0.0)
        lost.append(not made.receive(0.0))
    runs = [sum(1 for _ in run) for is_lost, run in groupby(lost) if is_lost]
    assert sum(runs) / count == pytest.approx(loss, rel=0.15)
    if 0.0 < loss < 1.0:
        # Independent losses follow each other too: a run of them has 1 / (1 - loss) numbers.
        assert sum(runs) / len(runs) == pytest.approx(burst if burst > 1.0 else 1.0 / (1.0 - loss), rel=0.15)


def test_reordered_datagrams_are_overtaken() -> None:
    made = link(reorder=0.2)
    for number in range(1000):
        made.send(b"x", number, number * 0.001)
    order = [tag for _, tag in made.receive(10.0)]
    assert sorted(order) == list(range(1000))
    moved = [place - number for place, number in enumerate(order) if place > number]
    assert len(moved) == pytest.approx(200, abs=40)
    assert max(moved) <= round(REORDER_HOLD / 0.001)


def test_rate_spaces_datagrams_and_drops_long_queues() -> None:
    made = link(rate_bit_s=80_000.0)
    for number in range(100):
        made.send(bytes(100 - HEADER_BYTES), number, 0.0)  # 10 ms each
    times = []
    while (due := made.next_due()) is not None:
        times.append(due)
        made.receive(due)
    assert times == pytest.approx([0.01 * (number + 1) for number in range(len(times))])
    assert len(times) == pytest.approx(QUEUE_S / 0.01, abs=2)


def test_duplicates_come_twice_and_corruption_flips_one_bit() -> None:
    made = link(duplicate=0.5, corrupt=0.5)
    for number in range(1000):
        made.send(bytes(8), number, 0.0)
    arrived = made.receive(0.0)
    assert len({tag for _, tag in arrived}) == 1000 and max(Counter(tag for _, tag in arrived).values()) == 2
    assert len(arrived) == pytest.approx(1500, abs=60)
    damaged = {tag for data, tag in arrived if data != bytes(8)}
    assert len(damaged) == pytest.approx(500, abs=60)
    assert all(sum(byte.bit_count() for byte in data) == 1 for data, tag in arrived if tag in damaged)
    assert len({data for data, _ in arrived}) == 65


@pytest.mark.parametrize("blackout", [(1.0, 0.5), (1.0, 0.05, 0.2)])
def test_nothing_gets_through_a_blackout_once_or_periodic(blackout: tuple[float, ...]) -> None:
    made, every = link(blackouts=(blackout,), epoch=10.0), round(100 * blackout[2]) if len(blackout) > 2 else 10**6
    for number in range(200):
        made.send(b"x", number, 10.0 + number * 0.01 + 0.005)
    arrived = [tag for _, tag in made.receive(100.0)]
    gone = [number for number in range(200) if number >= 100 and (number - 100) % every < round(100 * blackout[1])]
    assert sorted(arrived + gone) == list(range(200))


@examples(60)
@given(st.lists(st.tuples(st.floats(0.0, 0.2), st.floats(0.0, 0.05)), min_size=1, max_size=20))
def test_changes_lose_and_reorder_nothing_and_leave_no_loss_behind(delays: list[tuple[float, float]]) -> None:
    made, arrived = link(), []
    for number, (delay, jitter) in enumerate(delays):
        now = 0.01 * number
        made.change(Emulation(delay_s=delay, jitter_s=jitter))
        made.send(b"", number, now)
        made.change(Emulation(loss=1.0, burst=1000.0))
        made.send(b"", -1, now)
        arrived += [tag for _, tag in made.receive(now)]
    arrived += [tag for _, tag in made.receive(1e9)]
    assert arrived == list(range(len(delays)))
