"""The thread that owns a device: what it commands, when it gives up, and what is left of it."""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count, pairwise
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from tests.hardware.scripted import REST, Scripted, command_until, descriptors, gone, wait_for
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.worker import Worker

ROOT = Path(__file__).parents[2]


class Pushed:
    """An exchange of forces."""

    def __init__(self) -> None:
        self.pushed: list[float] = []

    def open(self) -> int:
        return 0

    def exchange(self, force: float) -> int:
        self.pushed.append(force)
        return 0

    def close(self) -> None: ...


@contextmanager
def working(exchange: Scripted, **options: Any) -> Iterator[Worker[str, int]]:
    """A worker that has been started; what it leaves behind is looked for."""
    files, threads = descriptors(), threading.active_count()
    worker = worker_of(exchange, **options)
    try:
        worker.start()
        yield worker
    finally:
        worker.stop()
        assert not exchange.is_open
        assert descriptors() == files
        assert threading.active_count() == threads


def worker_of(exchange: Scripted, **options: Any) -> Worker[str, int]:
    given = {"period": 0.001, "on_command": True, "stale": 60.0, "bad_replies": 3, **options}
    return Worker(exchange, rest=REST, **given)


def in_turn(*outcomes: Exception | int) -> Callable[[str], int]:
    """One after the other; the last one for ever."""
    turn = iter(outcomes)

    def deed(command: str) -> int:
        outcome = next(turn, outcomes[-1])
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    return deed


def test_command_arrives_and_sample_returns() -> None:
    exchange, before = Scripted(), monotonic()
    with working(exchange) as worker:
        assert before <= worker.connected_at <= worker.newest[1]
        began = monotonic()
        command_until(worker, "push", lambda: "push" in exchange.commands)
        wait_for(lambda: worker.newest[0] > 100)
        wait_for(lambda: worker.newest[1] >= began)
        assert worker.fault is None
        assert worker.round_trip > 0.0
    assert exchange.calls[0] == "open"
    assert exchange.calls[-1] == "close"


def test_a_command_starts_an_exchange_at_once() -> None:
    """With pauses of a minute in between, nothing would come of it otherwise."""
    exchange = Scripted()
    with working(exchange, period=60.0) as worker:
        for number in range(5):
            worker.command(f"push {number}", monotonic())
            wait_for(lambda number=number: f"push {number}" in exchange.commands)  # type: ignore[misc]


def test_a_command_that_nobody_renews_does_not_last() -> None:
    exchange = Scripted()
    with working(exchange, stale=0.02) as worker:
        command_until(worker, "push", lambda: "push" in exchange.commands)
        wait_for(lambda: exchange.commands[-1] == REST)
        command_until(worker, "push", lambda: exchange.commands[-1] == "push")


def test_after_a_pause_of_the_commands_the_output_rests_and_rises_anew() -> None:
    """A host that stood still goes on with a fresh command; the device must not get all of it at once."""
    now, forces = 0.0, Pushed()
    worker = Worker(forces, rest=0.0, period=0.01, on_command=True, stale=0.05, bad_replies=3,
                    scale=lambda force, share: force * share, ramp=0.05, clock=lambda: now)  # fmt: skip
    worker.start()
    try:

        def pushed(elapsed: float) -> float:
            nonlocal now
            now += elapsed
            done = len(forces.pushed)
            worker.command(2.0, now)
            wait_for(lambda: len(forces.pushed) > done)
            return forces.pushed[-1]

        assert [pushed(0.01) for _ in range(8)][-1] == 2.0
        assert pushed(0.06) == 0.0
        rise = [pushed(0.01) for _ in range(6)]
        assert all(b - a <= 2.0 * 0.01 / 0.05 + 1e-9 for a, b in pairwise([0.0, *rise]))
        assert rise[-1] == 2.0
    finally:
        worker.stop()


def test_a_command_of_the_last_session_is_forgotten() -> None:
    exchange = Scripted()
    with working(exchange) as worker:
        command_until(worker, "push", lambda: "push" in exchange.commands)
        worker.stop()
        worker.command("late", monotonic())
        exchange.calls.clear()
        worker.start()
        wait_for(lambda: len(exchange.commands) > 5)
        assert set(exchange.commands) == {REST}


def test_bad_reply_rests_until_a_good_one() -> None:
    exchange = Scripted()
    with working(exchange) as worker:
        command_until(worker, "push", lambda: "push" in exchange.commands)
        exchange.deed = in_turn(BadReply("torn"), BadReply("torn"), 7)
        command_until(worker, "push", lambda: worker.newest[0] == 7 and exchange.calls[-1] == "push")
        first = exchange.calls.index(REST, exchange.calls.index("push"))
        assert exchange.calls[first - 1 : first + 3] == ["push", REST, REST, "push"]
        assert worker.bad_count == 2
        assert worker.fault is None
        assert "close" not in exchange.calls


def test_bad_replies_in_a_row_close_with_fault() -> None:
    exchange = Scripted(in_turn(1, BadReply("torn 1"), BadReply("torn 2"), 2, BadReply("torn 3")))
    with working(exchange) as worker:
        command_until(worker, "push", lambda: worker.fault is not None)
        wait_for(lambda: exchange.calls[-2:] == ["close", "close"])
        assert worker.fault == "torn 3"
        assert worker.bad_count == 5
        assert worker.newest[0] == 2
        assert exchange.commands[-2:] == [REST, REST]
        done = len(exchange.calls)
        worker.command("push", monotonic())
        sleep(0.01)
        assert len(exchange.calls) == done, "nothing more is asked of it"


def test_gone_device_is_a_fault_at_once() -> None:
    exchange = Scripted(gone)
    with working(exchange) as worker:
        wait_for(lambda: worker.fault == "gone")
        assert len(exchange.commands) == 1
        wait_for(lambda: not exchange.is_open)
        assert exchange.calls.count("open") == 1


def test_device_back_in_time_continues_from_rest() -> None:
    def opening(number: int) -> int:
        if 0 < number < 3:
            raise HardwareFault(f"not there yet: {number}")
        return number

    exchange = Scripted(in_turn(1, HardwareFault("gone"), 2), opening)
    with working(exchange, reconnect=60.0) as worker:
        connected = worker.connected_at
        command_until(worker, "push", lambda: exchange.calls[-1] == "push" and worker.connected_at > connected)
        assert worker.fault is None
        back = exchange.calls.index("open", exchange.calls.index("close"))
        assert exchange.calls[back : back + 3] == ["open"] * 3
        assert exchange.calls[back + 3] == REST


def test_reconnection_ends_when_device_never_answers() -> None:
    """Patience counts from the last good reply, not from the last time that the port opened."""
    exchange = Scripted(in_turn(1, HardwareFault("mute")))
    with working(exchange, reconnect=0.2) as worker:
        wait_for(lambda: worker.fault is not None)
        assert worker.fault == "mute"
        assert exchange.calls.count("open") > 1
        assert set(exchange.commands) == {REST}


@pytest.mark.parametrize("mistake", [KeyError("oops"), SystemExit(3)])
def test_exception_in_the_thread_is_a_fault(mistake: BaseException) -> None:
    def deed(command: str) -> int:
        raise mistake

    exchange = Scripted(deed)
    with working(exchange) as worker:
        wait_for(lambda: worker.fault is not None)
        assert worker.fault == f"internal error: {mistake!r}"
        wait_for(lambda: not exchange.is_open)
        # An error of the exchange's code comes with its trace; what would end the program is a fault like another one.
        with pytest.raises(type(mistake) if isinstance(mistake, Exception) else HardwareFault) as caught:
            worker.check(HardwareFault)
        assert caught.value is mistake or str(caught.value) == worker.fault


def test_failed_open_leaves_nothing_behind() -> None:
    def opening(number: int) -> int:
        if number == 0:
            raise HardwareFault("taken")
        if number == 1:
            raise ZeroDivisionError
        return 42

    exchange = Scripted(None, opening)
    files, threads = descriptors(), threading.active_count()
    worker = worker_of(exchange)
    with pytest.raises(HardwareFault, match="taken"):
        worker.start()
    with pytest.raises(ZeroDivisionError):
        worker.start()
    assert exchange.calls == ["open", "close", "open", "close"]
    assert (descriptors(), threading.active_count()) == (files, threads)
    worker.command("push", monotonic())
    worker.stop()
    assert exchange.commands == []
    exchange.deed = Hanging()
    worker.start()
    assert worker.newest[0] == 42, "what opening gave, until there is more"
    exchange.deed.let_go.set()
    worker.stop()
    assert (descriptors(), threading.active_count()) == (files, threads)


@pytest.mark.parametrize("period", [0.0, 60.0])
@pytest.mark.parametrize("on_command", [False, True])
def test_stop_does_not_wait_for_exchange(period: float, on_command: bool) -> None:
    for _ in range(3):
        exchange = Scripted()
        with working(exchange, period=period, on_command=on_command):
            pass
        assert exchange.calls[-1] == "close"


class Hanging:
    """An exchange that does not come back until it is let go."""

    def __init__(self) -> None:
        self.let_go = threading.Event()
        self.inside = threading.Event()

    def __call__(self, command: str) -> int:
        self.inside.set()
        assert self.let_go.wait(60.0)
        return 1


def test_hanging_exchange_is_closed_when_it_returns() -> None:
    files, hanging = descriptors(), Hanging()
    exchange = Scripted(hanging)
    worker = worker_of(exchange)
    worker.start()
    assert hanging.inside.wait(60.0)
    worker.stop()
    assert exchange.is_open, "only the thread that is inside may touch it"
    worker.command("push", monotonic())
    with pytest.raises(HardwareFault, match="has not reacted since the last session"):
        worker.start()
    assert exchange.calls.count("open") == 1
    hanging.let_go.set()
    wait_for(lambda: not exchange.is_open)
    assert exchange.calls == ["open", REST, "close"]

    def starts() -> bool:
        try:
            worker.start()
        except HardwareFault:
            return False
        return True

    exchange.deed = lambda command: 9
    wait_for(starts)
    wait_for(lambda: worker.newest[0] == 9)
    worker.stop()
    assert descriptors() == files


PROGRAM = """
import sys, threading, time
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


@pytest.mark.parametrize(
    ("hang", "end"),
    [
        ("", ""),
        ("", "sys.exit(3)"),
        ("time.sleep(1.2)", "worker.stop()"),
    ],
    ids=["end", "exit", "hangs"],
)
def test_a_program_that_ends_leaves_the_device_safe(hang: str, end: str) -> None:
    """Whether it remembers to stop the worker or not, and though the exchange takes longer than a stop waits."""
    program = PROGRAM.format(hang=hang, end=end)
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == "closed\n"
    assert "Fatal" not in done.stderr


def test_missed_exchanges_are_not_made_up_for() -> None:
    """Every fifth exchange takes ten periods; making up for them would need no pause at all."""
    ahead, number = [0.0], count(1)
    starts: list[float] = []

    def clock() -> float:
        return monotonic() + ahead[0]

    def deed(command: str) -> int:
        starts.append(clock())
        if next(number) % 5 == 0:
            ahead[0] += 0.1
        return 1

    with working(Scripted(deed), period=0.01, on_command=False, clock=clock):
        wait_for(lambda: len(starts) >= 21)
    seen = starts[:21]
    stalls = 4
    assert len(seen) <= (seen[-1] - seen[0]) / 0.01 - 9 * stalls + 2
