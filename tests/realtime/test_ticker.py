"""Tick numbers, deadlines and missed ticks, in both event loops."""

import asyncio
import fcntl
import time
from pathlib import Path

import pytest
import uvloop

from weberlink.realtime.ticker import LARGEST_ADVANCE_SHARE, POLL_REST_SHARE, Ticker

PERIOD = 0.001


@pytest.fixture(params=[asyncio.new_event_loop, uvloop.new_event_loop], ids=["asyncio", "uvloop"])
def loop_run(request):
    def run(main):
        with asyncio.Runner(loop_factory=request.param) as runner:
            return runner.run(main())

    return run


@pytest.fixture(params=[False, True], ids=["sleeps", "polls"])
def polls(request):
    return request.param


def open_files():
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def collect(loop_run, count, *, start_at=None, period=PERIOD, during=lambda index: None, polls=False):
    """Run a ticker for `count` calls; returns the calls and the ticker."""
    calls, kept = [], []

    async def main():
        done = asyncio.Event()

        def on_tick(index, deadline, now):
            calls.append((index, deadline, now))
            during(index)
            if len(calls) == count:
                ticker.stop()
                done.set()

        ticker = Ticker(period, on_tick, start_at=start_at, polls=polls)
        kept.append(ticker)
        ticker.start()
        await done.wait()

    loop_run(main)
    return calls, kept[0]


def test_deadlines_are_multiples_of_the_period_from_the_start_and_each_is_a_call_or_missed(loop_run, polls):
    start_ns = time.monotonic_ns() + 5_000_000
    calls, ticker = collect(loop_run, 30, start_at=start_ns / 1e9, period=1 / 3000, polls=polls)
    assert ticker.period_s == 333_333 / 1e9
    for index, deadline, now in calls:
        assert deadline == pytest.approx((start_ns + index * 333_333) / 1e9, abs=1e-9)
        assert now >= deadline
    indices = [index for index, _, _ in calls]
    assert indices == sorted(set(indices))
    assert indices[-1] - indices[0] + 1 == len(calls) + ticker.missed


def test_a_tick_that_blocks_costs_its_deadlines_and_no_burst_follows(loop_run, polls):
    seen = []

    def block_once(index):
        seen.append(index)
        if len(seen) == 3:
            time.sleep(5.5 * PERIOD)

    calls, ticker = collect(loop_run, 10, during=block_once, polls=polls)
    indices = [index for index, _, _ in calls]
    assert indices[3] - indices[2] >= 5
    assert calls[3][2] - calls[2][2] >= 5.5 * PERIOD
    assert ticker.missed >= 4


def test_the_timer_is_set_ahead_once_wake_ups_are_known_and_no_tick_is_early(loop_run):
    calls, ticker = collect(loop_run, 200, period=0.0005)
    assert 0 < ticker._advance_ns <= LARGEST_ADVANCE_SHARE * 0.0005e9
    assert all(now >= deadline for _, deadline, now in calls)


def test_a_polling_ticker_serves_what_comes_between_its_ticks_and_rests(loop_run):
    """Callbacks of the loop come between ticks, and some of each period goes to other programs."""

    async def main():
        calls = []
        ticker = Ticker(0.02, lambda *call: calls.append(call), polls=True)
        loop = asyncio.get_running_loop()
        ticker.start()
        began, ran, served = time.monotonic(), time.process_time(), set()
        while len(calls) < 6:
            asked = loop.create_future()
            loop.call_later(0.001, asked.set_result, None)
            await asked
            served.add(len(calls))
        share = (time.process_time() - ran) / (time.monotonic() - began)
        ticker.stop()
        assert len(served) >= 4, "callbacks came between nearly all ticks"
        assert share <= 1.0 - 0.5 * POLL_REST_SHARE

    loop_run(main)


def test_a_start_in_the_past_begins_at_the_newest_deadline(loop_run, polls):
    calls, ticker = collect(loop_run, 2, start_at=time.monotonic() - 100 * PERIOD, polls=polls)
    assert calls[0][0] >= 100
    assert ticker.missed == calls[1][0] - calls[0][0] - 1, "deadlines before the first tick do not count"


@pytest.mark.parametrize("fails", [False, True])
def test_a_stop_or_an_error_inside_a_tick_is_final_and_leaves_no_descriptor(loop_run, polls, fails):
    async def main():
        calls, errors, before = [], [], open_files()

        def on_tick(*call):
            calls.append(call)
            if fails:
                raise ZeroDivisionError
            ticker.stop()

        ticker = Ticker(
            PERIOD, on_tick, on_error=lambda error: errors.append((type(error), ticker.running)), polls=polls
        )
        ticker.start()
        assert ticker.running
        assert fcntl.fcntl(ticker._fd, fcntl.F_GETFD) & fcntl.FD_CLOEXEC, "no child inherits the timer"
        while not calls:
            await asyncio.sleep(PERIOD)
        await asyncio.sleep(10 * PERIOD)
        assert (len(calls), errors, ticker.running) == (1, [(ZeroDivisionError, False)] * fails, False)
        assert open_files() == before

    loop_run(main)


@pytest.mark.parametrize("period", [0.0, -1.0, 1e-9, float("nan"), float("inf")])
def test_a_period_that_cannot_be_kept_is_refused(period):
    with pytest.raises(ValueError, match="period_s"):
        Ticker(period, lambda *_: None)
