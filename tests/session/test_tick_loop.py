"""The event loop of a daemon, with a side and a transport that keep a journal of calls, and with real signals."""

import asyncio
import gc
import os
import signal

import pytest

from weberlink.session.tick_loop import TickLoop

PERIOD = 0.001
pytestmark = pytest.mark.usefixtures("refrozen")


class Side:
    """Keeps a journal; comes to rest `settle` ticks after a stop, or at tick call number `leave`."""

    def __init__(self, *, settle=3, leave=None, at_tick=None):
        self.journal = []
        self.indices, self.stops, self.failures = [], [], []
        self.stopped, self.outcome = False, None
        self.settle, self.leave, self.at_tick = settle, leave, at_tick or {}

    def tick(self, index, deadline, now):
        self.journal.append("tick")
        self.indices.append(index)
        action = self.at_tick.get(len(self.indices))
        if action is not None:
            action()
        if self.stops:
            self.settle -= 1
            self.stopped = self.settle <= 0
        if len(self.indices) == self.leave:
            self.stopped, self.outcome = True, "peer said goodbye"

    def stop(self, now, reason):
        self.journal.append("stop")
        self.stops.append(reason)

    def fail(self, now, error):
        self.journal.append("fail")
        self.failures.append(error)


class Transport:
    def __init__(self, journal, opening=None):
        self.journal = journal
        self.opening = opening

    async def open(self, loop):
        self.journal.append("open")
        if self.opening is not None:
            await self.opening(loop)

    def service(self, now):
        self.journal.append("service")

    def flush(self, now, tick_at=None):
        self.journal.append("flush")
        self.tick_at = tick_at

    def close(self):
        self.journal.append("close")


def go(side, *, opening=None, transport=None, **options):
    return TickLoop(side, transport or Transport(side.journal, opening), PERIOD, **options).run()


def send(number):
    return lambda: os.kill(os.getpid(), number)


NEVER = 10**9


def test_order_of_calls_in_a_tick():
    side = Side(leave=2)
    go(side, after_tick=lambda *_: side.journal.append("after"))
    assert side.journal == ["open", *["service", "tick", "flush", "after"] * 2, "close"]


def test_the_transport_knows_when_the_next_tick_is_due():
    side, deadlines = Side(leave=3), []
    transport = Transport(side.journal)
    go(
        side,
        transport=transport,
        after_tick=lambda _missed, deadline, *_: deadlines.append((deadline, transport.tick_at)),
    )
    assert [due - deadline for deadline, due in deadlines] == pytest.approx([PERIOD] * 3, rel=1e-6)


def test_after_the_duration_the_side_is_stopped_and_settles():
    side = Side(settle=4)
    result = go(side, duration_s=0.02)
    assert side.stops == ["completed"]
    assert side.failures == []
    assert (result.outcome, result.orderly) == ("completed", True)
    before = [index for index in side.indices if index < side.indices[0] + 20]
    assert len(side.indices) - len(before) == 4
    assert side.journal.index("stop") == len(before) * 3 + 1


@pytest.mark.parametrize(
    ("settle", "signals", "options", "reason", "failures"),
    [
        (3, {4: signal.SIGINT}, {}, "interrupted", []),
        (3, {4: signal.SIGTERM}, {"busy_poll": True}, "terminated", []),
        (10, {3: signal.SIGHUP, 5: signal.SIGHUP, 6: signal.SIGHUP}, {}, "hung up", []),
        (NEVER, {3: signal.SIGINT, 6: signal.SIGINT}, {"stop_limit_s": 60.0}, "interrupted", [InterruptedError]),
        (NEVER, {}, {"duration_s": 0.005, "stop_limit_s": 0.02}, "completed", [TimeoutError]),
    ],
)
def test_a_signal_begins_an_orderly_stop_that_ends_by_itself_a_second_one_or_its_limit(
    settle, signals, options, reason, failures
):
    side = Side(settle=settle, at_tick={tick: send(number) for tick, number in signals.items()})
    result = go(side, **options)
    assert side.stops == [reason]
    assert [type(error) for error in side.failures] == failures
    assert (result.outcome, result.orderly) == (reason, not failures)


class FaultError(Exception):
    pass


def raise_fault(*_):
    raise FaultError


@pytest.mark.parametrize("place", ["service", "tick", "flush", "stop"])
def test_an_own_fault_stops_at_once_with_zero_force_and_propagates(place):
    side = Side()
    transport = Transport(side.journal)
    # An instance attribute hides the method of the fake.
    setattr(side if place in ("tick", "stop") else transport, place, raise_fault)
    with pytest.raises(FaultError):
        go(side, transport=transport, duration_s=0.003)
    assert [type(error) for error in side.failures] == [FaultError]
    assert side.journal[-2:] == ["flush", "close"] or place == "flush", "datagrams of a failing side are sent"
    assert not {"service", "tick"} & set(side.journal[side.journal.index("fail") :])


async def fail_later(loop):
    loop.call_soon(raise_fault)


@pytest.mark.parametrize("opening", [raise_fault, fail_later])
@pytest.mark.parametrize("fails_again", [False, True])
def test_a_fault_of_the_opening_or_of_a_callback_is_an_own_fault_that_no_further_one_hides(opening, fails_again):
    side = Side()
    if fails_again:
        side.fail = lambda now, error: 1 / 0
    with pytest.raises(FaultError):
        go(side, opening=opening)
    assert side.journal[-1] == "close"
    assert fails_again or side.journal[-3:] == ["fail", "flush", "close"]


def test_what_works_beside_the_ticks_ends_before_the_threads_of_the_loop():
    ended = []

    def begin(loop):
        if not ended:
            loop.run_in_executor(None, int)
            loop.call_later(0.0, begin, loop)

    assert go(Side(leave=3), on_open=[begin], on_close=[lambda: ended.append(True)]).orderly
    assert ended == [True]


def test_a_signal_ends_an_opening_that_hangs():
    side = Side()

    async def hang(loop):
        loop.call_later(0.01, send(signal.SIGTERM))
        await asyncio.sleep(60.0)

    result = go(side, opening=hang)
    assert result == ("terminated", True)
    assert side.journal == ["open", "stop", "close"]


def test_garbage_is_frozen_during_the_run_and_collected_in_the_slack():
    enabled, passes = [], []

    def note(phase, info):
        passes.append(phase)

    def begin():
        enabled.append(gc.isenabled())
        passes.clear()

    side = Side(at_tick={1: begin})

    def leave_once_collected(*_):
        side.stopped = bool(passes)

    gc.callbacks.append(note)
    try:
        go(side, duration_s=60.0, after_tick=leave_once_collected)  # a busy machine has no slack for long
    finally:
        gc.callbacks.remove(note)
    assert enabled == [False]
    assert gc.isenabled()
    assert passes
