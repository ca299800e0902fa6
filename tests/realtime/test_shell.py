"""The event loop of a daemon, with a side and a transport that keep a journal of calls, and with real signals."""

import asyncio
import gc
import os
import signal
import threading
import time

import pytest

from weberlink.realtime.garbage import GarbageSchedule
from weberlink.realtime.shell import run

PERIOD = 0.001


class Side:
    """Keeps a journal; comes to rest `settle` ticks after a stop, or at tick call number `leave`."""

    def __init__(self, *, settle=3, leave=None, at_tick=None):
        self.journal = []
        self.indices = []
        self.stops = []
        self.failures = []
        self.stopped = False
        self.outcome = None
        self.settle = settle
        self.leave = leave
        self.at_tick = at_tick or {}

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

    def open(self, loop):
        self.journal.append("open")
        return None if self.opening is None else self.opening(loop)

    def service(self, now):
        self.journal.append("service")

    def flush(self, now):
        self.journal.append("flush")

    def close(self):
        self.journal.append("close")


def go(side, *, opening=None, transport=None, **options):
    return run(side, transport=transport or Transport(side.journal, opening), ticker_period=PERIOD, **options)


def send(number):
    return lambda: os.kill(os.getpid(), number)


NEVER = 10**9


def test_order_of_calls_in_a_tick():
    side = Side(leave=2)
    go(side, after_tick=lambda *_: side.journal.append("after"))
    assert side.journal == ["open", *["service", "tick", "flush", "after"] * 2, "close"]


def test_after_the_duration_the_side_is_stopped_and_settles():
    side = Side(settle=4)
    result = go(side, duration_s=0.02)
    assert side.stops == ["completed"]
    assert side.failures == []
    assert (result.outcome, result.orderly) == ("completed", True)
    before = [index for index in side.indices if index < side.indices[0] + 20]
    assert len(side.indices) - len(before) == 4
    assert side.journal.index("stop") == len(before) * 3 + 1


def test_every_deadline_is_a_tick_or_missed():
    side = Side(at_tick={5: lambda: time.sleep(4.5 * PERIOD)})
    works = []
    result = go(side, duration_s=0.03, after_tick=lambda index, deadline, now, work_us: works.append(work_us))
    assert result.ticks == len(side.indices) == len(works)
    assert result.ticks + result.missed == side.indices[-1] - side.indices[0] + 1
    assert result.missed >= 3
    assert max(works) >= 4500.0


@pytest.mark.parametrize("busy_poll", [False, True])
@pytest.mark.parametrize(("number", "reason"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
def test_a_signal_begins_an_orderly_stop(number, reason, busy_poll):
    side = Side(at_tick={4: send(number)})
    result = go(side, busy_poll=busy_poll)
    assert side.stops == [reason]
    assert (result.outcome, result.orderly, side.failures) == (reason, True, [])


@pytest.mark.parametrize("busy_poll", [False, True])
def test_a_signal_from_outside_wakes_the_loop_while_it_waits(busy_poll):
    timer = threading.Timer(0.03, send(signal.SIGTERM))
    timer.start()
    result = go(Side(), busy_poll=busy_poll)
    timer.join()
    assert result.outcome == "terminated"


def test_a_second_signal_ends_a_stop_that_does_not_settle():
    side = Side(settle=NEVER, at_tick={3: send(signal.SIGINT), 6: send(signal.SIGINT)})
    result = go(side, stop_limit_s=60.0)
    assert side.stops == ["interrupted"]
    assert [type(error) for error in side.failures] == [InterruptedError]
    assert not result.orderly
    assert result.ticks <= 7


def test_a_hang_up_may_come_any_number_of_times():
    side = Side(settle=10, at_tick={3: send(signal.SIGHUP), 5: send(signal.SIGHUP), 6: send(signal.SIGHUP)})
    result = go(side)
    assert side.stops == ["hung up"]
    assert side.failures == []
    assert (result.outcome, result.orderly) == ("hung up", True)


def test_a_stop_that_takes_too_long_is_ended():
    side = Side(settle=NEVER)
    result = go(side, duration_s=0.005, stop_limit_s=0.02)
    assert [type(error) for error in side.failures] == [TimeoutError]
    assert not result.orderly
    assert result.outcome == "completed"


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
    assert side.journal[-1] == "close"
    assert not {"service", "tick"} & set(side.journal[side.journal.index("fail") :])


def test_datagrams_of_a_failing_side_are_still_sent():
    side = Side(at_tick={2: raise_fault})
    with pytest.raises(FaultError):
        go(side)
    assert side.journal[-3:] == ["fail", "flush", "close"]


def test_a_fault_while_failing_does_not_hide_the_first():
    side = Side(at_tick={2: raise_fault})
    side.fail = lambda now, error: 1 / 0
    with pytest.raises(FaultError):
        go(side)
    assert side.journal[-1] == "close"


def test_a_fault_in_a_callback_of_the_loop_is_an_own_fault():
    side = Side()
    with pytest.raises(FaultError):
        go(side, opening=lambda loop: loop.call_later(0.005, raise_fault) and None)
    assert [type(error) for error in side.failures] == [FaultError]


def test_opening_that_fails_propagates_and_closes():
    side = Side()

    async def refused(_loop):
        raise ConnectionRefusedError

    with pytest.raises(ConnectionRefusedError):
        go(side, opening=refused)
    assert side.journal == ["open", "fail", "flush", "close"]


def test_a_signal_ends_an_opening_that_hangs():
    side = Side()

    async def hang(loop):
        loop.call_later(0.01, send(signal.SIGTERM))
        await asyncio.sleep(60.0)

    result = go(side, opening=hang)
    assert (result.outcome, result.ticks, result.orderly) == ("terminated", 0, True)
    assert side.journal == ["open", "stop", "close"]


def test_garbage_is_frozen_during_the_run_and_collected_in_the_slack():
    enabled = []
    side = Side(at_tick={1: lambda: enabled.append(gc.isenabled())})
    garbage = GarbageSchedule(5)

    def leave_once_collected(*_):
        side.stopped = garbage.young.count > 0

    go(side, duration_s=60.0, garbage=garbage, after_tick=leave_once_collected)  # a busy machine has no slack for long
    assert enabled == [False]
    assert gc.isenabled()
    assert garbage.young.count >= 1
