"""The thread that owns a device: what it commands, when it gives up, and what is left of it."""

import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from itertools import count
from time import monotonic
from types import SimpleNamespace
from typing import Any

import pytest

from tests.program import ROOT
from tests.wait import PATIENCE, until
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.worker import Worker

TICK = 2.0**-7
"""Binary fractions, so that a time is exactly at a limit."""
RAMP_TICKS, STALE_TICKS, BAD_REPLIES = 4, 8, 3
REST, PUSH = 0.0, 2.0
STEP = PUSH / RAMP_TICKS
BAD, GONE = BadReply("torn"), HardwareFault("gone")


class Rig:
    """A worker in virtual time, and its exchange, in which it waits for the next step of the test."""

    def __init__(self, **options: Any) -> None:
        self.now = 100.0
        self.calls: list[Any] = []  # "open", "close", and every command
        self.threads: set[int] = set()
        self.outcomes: deque[Any] = deque()  # of the next exchanges; afterwards samples count on from 100
        self.openings: deque[Any] = deque()  # of the next ones; a callable is called
        self.closing: Exception | None = None  # raised by `close`
        self.guardian: Any = None
        self._samples = count(101)
        self._inside, self._go = False, threading.Semaphore(0)
        self.runs_free = False
        given = {"period": TICK, "on_command": True, "stale": STALE_TICKS * TICK, "bad_replies": BAD_REPLIES}
        given |= {"scale": lambda force, share: force * share, "ramp": RAMP_TICKS * TICK, "clock": lambda: self.now}
        self.worker: Worker[float, int] = Worker(self, rest=REST, **(given | options))

    def open(self) -> int:
        self.calls.append("open")
        return self._done(self.openings.popleft() if self.openings else 100)

    def exchange(self, command: float) -> int:
        self.calls.append(command)
        self.threads.add(threading.get_ident())
        if not self.runs_free:
            self._inside = True
            assert self._go.acquire(timeout=PATIENCE)
        return self._done(self.outcomes.popleft() if self.outcomes else next(self._samples))

    def close(self) -> None:
        self.calls.append("close")
        self.threads.add(threading.get_ident())
        if self.closing is not None:
            raise self.closing

    @staticmethod
    def _done(outcome: Any) -> int:
        outcome = outcome() if callable(outcome) else outcome
        if isinstance(outcome, BaseException):
            raise outcome
        return int(outcome)

    def start(self) -> None:
        self.worker.start()
        self._await()

    def step(self, ticks: float = 1.0, command: float | None = None) -> Any:
        """Let the exchange return after a time, in which a command may come; gives the next call."""
        self.now += ticks * TICK
        if command is not None:
            self.worker.command(command, self.now)
        self._inside = False
        self._go.release()
        self._await()
        return self.calls[-1]

    def _await(self) -> None:
        def is_over() -> bool:
            return self.worker.fault is not None and self.calls[-1] == "close"

        until(lambda: self._inside or is_over(), "an exchange or the end", pause=1e-4)

    def push(self) -> None:
        while self.step(1.0, PUSH) != PUSH:
            pass

    def let_go(self) -> None:
        self.runs_free = True
        self._go.release()


@pytest.fixture
def make() -> Iterator[Callable[..., Rig]]:
    """Makes rigs; what their workers leave behind is looked for."""
    threads, made = threading.active_count(), list[Rig]()

    def of(**options: Any) -> Rig:
        made.append(Rig(**options))
        return made[-1]

    yield of
    for rig in made:
        rig.let_go()
        rig.worker.stop()
        assert len(rig.threads) <= 1 + rig.calls.count("open"), "one thread a session, and who closes at a failure"
    assert threading.active_count() == threads


@pytest.fixture
def rig(make: Callable[..., Rig]) -> Rig:
    made = make()
    made.start()
    return made


def test_force_ramps_from_rest_and_sample_and_times_return(rig: Rig) -> None:
    worker = rig.worker
    assert rig.calls == ["open", REST]
    assert (worker.round_trip, worker.fault, worker.trouble) == (0.0, None, None)
    assert rig.worker.newest == (100, 100.0)
    forces = [rig.step(1.0, PUSH) for _ in range(RAMP_TICKS + 2)]
    assert forces == [STEP * min(step, RAMP_TICKS) for step in range(1, RAMP_TICKS + 3)]
    assert rig.worker.newest == (106, rig.now)
    rig.step(0.5)
    assert (rig.worker.round_trip, rig.worker.fault, rig.worker.trouble) == (0.5 * TICK, None, None)


def test_a_slow_exchange_takes_no_larger_step_of_the_ramp(rig: Rig) -> None:
    assert [rig.step(ticks, PUSH) for ticks in (STALE_TICKS, 0.5)] == [STEP, 1.5 * STEP]


@pytest.mark.parametrize(("ticks", "is_old"), [(STALE_TICKS, False), (STALE_TICKS + 2.0**-10, True)])
def test_a_command_lasts_until_it_is_stale_and_then_force_rises_anew(rig: Rig, ticks: float, is_old: bool) -> None:
    """Also from a fresh command: the device must not get all of it at once from a host that stood still."""
    rig.push()
    assert rig.step(ticks) == (REST if is_old else PUSH)
    assert rig.step(0.0, PUSH) == (REST if is_old else PUSH), "the first command after a gap is for rest"
    rig.push()
    forces = [rig.step(ticks, PUSH), *(rig.step(1.0, PUSH) for _ in range(RAMP_TICKS))]
    assert forces == ([STEP * step for step in range(RAMP_TICKS + 1)] if is_old else [PUSH] * (RAMP_TICKS + 1))


def test_without_a_ramp_commands_are_whole_and_a_command_starts_an_exchange_at_once(make: Callable[..., Rig]) -> None:
    rig = make(scale=None, period=60.0)
    rig.worker.start()
    rig.worker.command(PUSH, rig.now)  # else there were a minute until the first exchange
    until(lambda: rig.calls[-1] == PUSH, "the command")
    assert rig.step(1.0, -PUSH) == -PUSH
    assert rig.step(STALE_TICKS + 1, PUSH) == REST


@pytest.mark.parametrize("bad", [1, BAD_REPLIES - 1])
def test_bad_reply_rests_until_a_good_one_and_ramps(rig: Rig, bad: int) -> None:
    rig.push()
    for _ in range(2):  # a good one in between, and they are no longer in a row
        rig.outcomes.extend([BAD] * bad)
        assert [rig.step(1.0, PUSH) for _ in range(bad)] == [REST] * bad
        assert rig.worker.trouble == "torn"
        assert [rig.step(1.0, PUSH) for _ in range(RAMP_TICKS)][:2] == [STEP, 2 * STEP]
        assert (rig.worker.trouble, rig.worker.fault) == (None, None)
    assert "close" not in rig.calls


@pytest.mark.parametrize("outcomes", [[BAD] * BAD_REPLIES, [GONE], [BAD, GONE]], ids=["bad", "gone", "bad, gone"])
def test_a_device_that_is_lost_is_closed_with_its_fault(rig: Rig, outcomes: list[Exception]) -> None:
    rig.push()
    sample = rig.worker.newest[0]
    rig.outcomes.extend(outcomes)
    assert [rig.step(1.0, PUSH) for _ in outcomes] == [*[REST] * (len(outcomes) - 1), "close"]
    assert (rig.worker.fault, rig.worker.newest[0]) == (str(outcomes[-1]), sample)
    with pytest.raises(KeyError, match=str(outcomes[-1])):
        rig.worker.check(KeyError)
    rig.worker.command(PUSH, rig.now)
    rig.worker.stop()
    assert rig.calls[-2:] == ["close", "close"], "nothing more is asked of it"
    assert "open" not in rig.calls[1:]


def test_device_back_in_time_continues_from_rest(make: Callable[..., Rig]) -> None:
    rig = make(reconnect=10 * TICK)
    rig.start()
    rig.push()

    def later() -> Exception:
        rig.now += 5 * TICK - TICK  # one tick before the end, after two of them
        return HardwareFault("not there yet")

    rig.outcomes.append(GONE)
    rig.openings.extend([later, later, 42])
    lost = len(rig.calls)
    assert rig.step(0.0, PUSH) == REST
    assert rig.calls[lost:] == ["close", "open", "open", "open", REST]
    assert rig.worker.newest == (42, rig.now)
    assert [rig.step(1.0, PUSH) for _ in range(3)] == [REST, STEP, 2 * STEP], "after so long a gap"
    assert rig.worker.fault is None


@pytest.mark.parametrize("answers", [False, True], ids=["does not open", "opens and is mute"])
def test_reconnection_ends_in_time_with_the_last_fault(make: Callable[..., Rig], answers: bool) -> None:
    """Which counts from the last good reply, not from the last time that the port opened."""
    rig = make(reconnect=10 * TICK)
    rig.start()

    def later() -> Exception | int:
        rig.now += 5 * TICK
        return 1 if answers else HardwareFault("still away")

    rig.outcomes.extend([GONE, HardwareFault("mute"), HardwareFault("mute")])
    rig.openings.extend([later] * 9)
    called = [rig.step(0.0) for _ in range(3 if answers else 1)]
    assert called == ([REST, REST, "close"] if answers else ["close"])
    assert rig.worker.fault == ("mute" if answers else "still away")
    assert rig.calls.count("open") == 3
    assert set(rig.calls) == {"open", "close", REST}


@pytest.mark.parametrize("mistake", [KeyError("oops"), SystemExit(3)])
def test_exception_in_the_thread_is_a_fault(rig: Rig, mistake: BaseException) -> None:
    """An error of the exchange's code comes with its trace; what would end the program is a fault like another one."""
    rig.outcomes.append(mistake)
    assert rig.step() == "close"
    assert rig.worker.fault == f"internal error: {mistake!r}"
    with pytest.raises(type(mistake) if isinstance(mistake, Exception) else HardwareFault) as caught:
        rig.worker.check(HardwareFault)
    assert caught.value is mistake or str(caught.value) == rig.worker.fault


@pytest.mark.parametrize(("first", "fault"), [(None, "internal error: OSError('motors')"), (GONE, "gone")])
def test_a_close_that_fails_says_why_unless_there_was_a_fault(rig: Rig, first: Exception | None, fault: str) -> None:
    rig.closing = OSError("motors")
    if first is not None:
        rig.outcomes.append(first)
    rig.let_go()
    if first is None:
        rig.worker.stop()
    until(lambda: rig.worker.fault == fault, "the fault of the close")
    rig.worker.stop()
    with pytest.raises(KeyError, match="motors" if first is None else "gone"):
        rig.worker.check(KeyError)


def test_a_session_begins_afresh(rig: Rig) -> None:
    rig.push()
    rig.outcomes.extend([BAD, GONE])
    rig.step()
    assert rig.step() == "close"
    rig.worker.command(PUSH, rig.now)
    rig.calls.clear()
    rig.start()
    assert (rig.worker.fault, rig.worker.trouble) == (None, None)
    assert [rig.step(1.0), rig.step(1.0, PUSH)] == [REST, STEP], "the command of the last session is forgotten"
    rig.worker.check(KeyError)
    rig.push()
    rig.let_go()
    rig.worker.stop()
    rig.runs_free = False
    rig.calls.clear()
    rig.worker.start()
    rig.worker.command(PUSH, rig.now)
    rig._await()
    rig.step(1.0, PUSH)
    shown = [call for call in rig.calls if call != "open"]
    assert max(shown) <= 2 * STEP, "whether the command came before the first exchange or after it"


def test_the_guardian_is_told_the_time_of_each_command(make: Callable[..., Rig]) -> None:
    rig, given = make(), list[tuple[float, float]]()
    rig.guardian = SimpleNamespace(given=lambda at, stale: given.append((at, stale)))
    rig.worker = Worker(rig, rest=REST, period=TICK, on_command=True, stale=0.5, bad_replies=1, clock=lambda: rig.now)
    rig.start()
    rig.step(1.0, PUSH)
    assert given[-1] == (rig.now, 0.5)


def test_failed_open_leaves_nothing_behind(make: Callable[..., Rig]) -> None:
    rig = make()
    rig.openings.extend([GONE, ZeroDivisionError(), 42])
    for failure in (HardwareFault, ZeroDivisionError):
        with pytest.raises(failure):
            rig.worker.start()
    assert rig.calls == ["open", "close", "open", "close"]
    rig.worker.command(PUSH, rig.now)
    rig.start()
    assert rig.worker.newest[0] == 42, "what opening gave, until there is more"
    assert rig.calls[4:] == ["open", REST]


@pytest.mark.parametrize("period", [0.0, 60.0])
@pytest.mark.parametrize("on_command", [False, True])
def test_stop_does_not_wait_for_the_next_exchange(make: Callable[..., Rig], period: float, on_command: bool) -> None:
    rig = make(period=period, on_command=on_command, clock=monotonic)
    rig.runs_free = True
    for _ in range(3):
        rig.worker.start()
        rig.worker.stop()
        assert rig.calls[-1] == "close"


def test_hanging_exchange_is_closed_when_it_returns(rig: Rig) -> None:
    rig.worker.stop()
    assert rig.calls == ["open", REST], "only the thread that is inside may touch it"
    rig.worker.command(PUSH, rig.now)
    with pytest.raises(HardwareFault, match="has not reacted since the last session"):
        rig.worker.start()
    rig.let_go()
    until(lambda: rig.calls == ["open", REST, "close"], "the close")
    until(lambda: not rig.worker._thread.is_alive(), "the thread to end")
    rig.worker.start()
    until(lambda: rig.worker.newest[0] > 101, "samples again")


PROGRAM = """
import sys, time
from weberlink.hardware.worker import Worker

class Exchange:
    def open(self): return 0
    def exchange(self, command):
        {hang}
        return 1
    def close(self): print("closed", flush=True)

worker = Worker(Exchange(), rest=0, period=0.001, on_command=True, stale=1.0, bad_replies=1)
worker.start()
time.sleep(0.05)
{end}
"""
ENDS = {"end": ("", ""), "exit": ("", "sys.exit(3)"), "hangs": ("time.sleep(1.2)", "worker.stop()")}


@pytest.mark.parametrize(("hang", "end"), ENDS.values(), ids=ENDS)
def test_a_program_that_ends_leaves_the_device_safe(hang: str, end: str) -> None:
    """Whether it remembers to stop the worker or not, and though the exchange takes longer than a stop waits."""
    command = [sys.executable, "-c", PROGRAM.format(hang=hang, end=end)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.stdout == "closed\n"
    assert "Fatal" not in done.stderr


def test_missed_exchanges_are_not_made_up_for(make: Callable[..., Rig]) -> None:
    """Every fifth exchange takes ten periods; making up for them would need no pause at all."""
    ahead, starts = 0.0, list[float]()
    rig = make(period=0.01, on_command=False, clock=lambda: monotonic() + ahead)
    rig.runs_free = True

    def deed() -> int:
        nonlocal ahead
        starts.append(monotonic() + ahead)
        ahead += 0.1 if len(starts) % 5 == 0 else 0.0
        return 1

    rig.outcomes.extend([deed] * 10_000)
    rig.worker.start()
    until(lambda: len(starts) >= 21, "21 exchanges")
    seen, stalls = starts[:21], 4
    assert len(seen) <= (seen[-1] - seen[0]) / 0.01 - 9 * stalls + 2
