"""The process that takes the force off: when it writes, when it does not, and what is refused without it.

Live: the guardian is a process, and its messages come through a pseudo terminal. A lease is a least time; nothing here
measures how soon after it a message comes.
"""

import os
import signal
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from select import select
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

import pytest

from tests.hardware.helpers import descriptors
from tests.wait import PATIENCE, until
from weberlink.hardware import guardian_process
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import LEASE_S, SILENT_S, Guardian, HoldingGuardian
from weberlink.hardware.guardian_process import (
    BEATS,
    HEAD,
    LEASE,
    MEMORY_SIZE,
    SLOT,
    SLOT_SIZE,
    WORDS_SIZE,
    WRITES,
    get_message,
    put_message,
    watch,
)
from weberlink.hardware.serial_port import SerialPort

ZERO, OTHER_ZERO, FORCE, HERE = b"zero\n", b"nothing\n", b"force\n", b"here\n"
LONG_S = 60.0
"""A command of this age is still good, and its lease twice as long: this machine may stall."""
WHILE_S = 0.12


@dataclass
class Wire:
    """A port with a guardian, and the device's end of it."""

    guardian: Any
    port: SerialPort
    near: int

    def heard(self, wait: float = 0.0, *, size: int = 1) -> bytes:
        """What comes within a time; with a size, at least so much, for the kernel hands it over in parts."""
        came = b""
        while len(came) < size and select((self.near,), (), (), wait)[0]:
            came += os.read(self.near, 1000)
        return came

    def push(self, stale: float = LONG_S) -> None:
        self.guardian.given(monotonic(), stale)
        self.port.write(FORCE)

    def signal_guardian(self, number: signal.Signals) -> None:
        assert self.guardian.pid is not None
        os.kill(self.guardian.pid, number)

    def until_told(self, use: Callable[[], None]) -> None:
        """Use it until the death of its guardian is told."""

        def is_told() -> bool:
            self.heard()
            try:
                use()
            except HardwareFault as fault:
                return "guardian process died" in str(fault)
            return False

        until(is_told, "the news of its death", pause=0.005)


@contextmanager
def guarded(guardian: Guardian) -> Iterator[Wire]:
    before = descriptors()
    near, far = os.openpty()
    tty.setraw(far)
    wire = Wire(guardian, SerialPort(os.ttyname(far), guardian=guardian), near)
    yield wire
    wire.port.close()
    assert guardian.pid is None
    os.close(near)
    os.close(far)
    assert descriptors() == before


@pytest.fixture
def wire() -> Iterator[Wire]:
    with guarded(Guardian(ZERO, (OTHER_ZERO,))) as wire:
        yield wire


@pytest.fixture
def arm() -> Iterator[Wire]:
    """Of an arm, which would drop without its torque."""
    with guarded(HoldingGuardian(LEASE_S)) as wire:
        yield wire


def test_unrenewed_force_is_taken_off_again_and_again(wire: Wire) -> None:
    began = monotonic()
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE) == FORCE
    assert wire.heard(PATIENCE).startswith(ZERO)
    assert monotonic() - began >= LEASE_S
    assert wire.heard(PATIENCE).startswith(ZERO), "again"
    assert wire.guardian.new_writes()
    wire.port.write(ZERO)
    sleep(WHILE_S)
    wire.heard()
    assert wire.heard(WHILE_S) == b"", "a parent that is back is left alone"
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE) == FORCE
    assert wire.heard(PATIENCE).startswith(ZERO), "and watched again"


def test_nothing_is_written_while_the_lease_lasts_nor_where_there_is_no_force(wire: Wire) -> None:
    assert wire.heard(WHILE_S) == b""
    for rest in (b"", ZERO, OTHER_ZERO):
        wire.push()
        if rest:
            wire.port.write(rest)
            wire.guardian.given(monotonic() - 2.0 * LONG_S, LONG_S)
        assert wire.heard(PATIENCE, size=len(FORCE + rest)) == FORCE + rest
        assert wire.heard(WHILE_S) == b""
        assert not wire.guardian.new_writes()


def test_stale_force_is_not_written(wire: Wire) -> None:
    wire.guardian.given(monotonic() - 0.02, 0.01)
    with pytest.raises(BadReply, match=r"held up for \d+ ms"):
        wire.port.write(FORCE)
    wire.port.write(ZERO)
    assert wire.heard(PATIENCE) == ZERO


@pytest.mark.parametrize(
    ("number", "says"), [(signal.SIGKILL, "guardian process died"), (signal.SIGSTOP, r"process \d+ has not run")]
)
def test_without_its_guardian_there_is_no_force(wire: Wire, number: signal.Signals, says: str) -> None:
    wire.push()
    wire.signal_guardian(number)
    gives_up = monotonic() + PATIENCE
    with pytest.raises(HardwareFault, match=says) as caught:
        while monotonic() < gives_up:
            wire.push()
            sleep(0.01)
    assert not isinstance(caught.value, BadReply)
    wire.heard()
    with suppress(HardwareFault):
        wire.port.write(ZERO)
    assert wire.heard(PATIENCE) == ZERO, "which is written all the same"


def test_a_guardian_that_runs_is_trusted_and_one_that_died_is_told_at_rest_too(wire: Wire) -> None:
    ends = monotonic() + 2.0 * SILENT_S
    while monotonic() < ends:
        wire.push()
        wire.heard()
        sleep(0.005)
    wire.signal_guardian(signal.SIGKILL)
    wire.until_told(lambda: wire.port.write(ZERO))


def test_guardian_ignores_signals_to_the_parent(wire: Wire) -> None:
    pid = wire.guardian.pid
    assert os.getsid(pid) == os.getpgid(pid) == pid
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        wire.signal_guardian(number)
    wire.push(LEASE_S / 2.0)
    until(wire.guardian.new_writes, "the zero")


def test_closing_takes_remaining_force_off(wire: Wire) -> None:
    wire.push()
    wire.port.close()
    heard = b""
    while not heard.endswith(ZERO):
        heard += wire.heard(PATIENCE)
    assert heard.startswith(FORCE + ZERO)
    with pytest.raises(HardwareFault, match="guardian process died"):
        wire.guardian.before(FORCE)
    wire.guardian.before(ZERO)
    assert not wire.guardian.new_writes(), "nobody writes any more"


def test_a_guardian_that_has_written_watches_anew(wire: Wire) -> None:
    wire.push(LEASE_S / 2.0)
    until(wire.guardian.new_writes, "the zero")
    wire.port.close()
    wire.port = SerialPort(wire.port.path, guardian=wire.guardian)
    assert not wire.guardian.new_writes()
    wire.port.write(OTHER_ZERO)


def test_blocked_device_still_gets_the_zero(wire: Wire) -> None:
    wire.push(LEASE_S / 2.0)
    with pytest.raises(HardwareFault, match="takes no more data"):
        while True:
            wire.guardian.given(monotonic(), LONG_S)
            wire.port.write(FORCE * 100)
    wire.guardian.given(monotonic(), LEASE_S / 2.0)
    with pytest.raises(HardwareFault):
        wire.port.write(FORCE)
    until(wire.guardian.new_writes, "the zero")
    assert wire.heard(WHILE_S, size=1_000_000).endswith(ZERO)


# --- what leaves an arm that must not lose its torque


def test_last_message_is_written_when_the_cycles_end(arm: Wire) -> None:
    for number in range(50):
        arm.guardian.hold(b"here %d\n" % number)
        arm.port.write(b"there\n")
    expected = b"there\n" * 50 + b"here 49\n"
    assert arm.heard(PATIENCE, size=len(expected)).startswith(expected)


def test_arm_that_is_safe_is_left_alone_and_one_within_a_cycle_is_made_safe(arm: Wire) -> None:
    arm.guardian.hold(HERE)
    arm.guardian.end()
    assert arm.heard(LEASE_S + WHILE_S) == b""
    arm.guardian.hold(HERE)
    arm.port.close()
    assert arm.heard(PATIENCE).startswith(HERE)


def test_guardian_that_died_is_told_and_messages_still_pass(arm: Wire) -> None:
    arm.signal_guardian(signal.SIGKILL)
    arm.until_told(lambda: arm.guardian.hold(HERE))
    arm.heard()
    arm.port.write(b"there\n")
    assert arm.heard(PATIENCE) == b"there\n"


def test_a_message_that_just_has_room_is_kept_and_a_longer_one_refused(arm: Wire) -> None:
    most = b"x" * (SLOT_SIZE - HEAD.size)
    arm.guardian.hold(most)
    with pytest.raises(ValueError, match="too long"):
        arm.guardian.hold(most + b"x")
    assert arm.heard(PATIENCE, size=len(most)).startswith(most)


def test_a_message_that_is_seen_in_part_is_not_written() -> None:
    """As where a processor reorders stores: the message before it counts, and nothing where there is none."""
    memory = memoryview(bytearray(MEMORY_SIZE))
    for whole in (b"", ZERO):
        put_message(memory, FORCE)
        slot = memory.cast("q")[SLOT]
        memory[WORDS_SIZE + slot * SLOT_SIZE + HEAD.size] ^= 1
        assert get_message(memory) == whole
        put_message(memory, ZERO)


# --- the loop of the process, in virtual time

MS = 1_000_000


class Loop:
    """The loop with a clock that goes on while it polls; deeds of the parent come at their time [ms]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, deeds: dict[int, int], goodbye: bytes) -> None:
        self.now, self.deeds, self.writes, self.beats = MS, deeds, list[int](), list[int]()
        self.memory = memoryview(bytearray(MEMORY_SIZE))
        self.words = self.memory.cast("q")
        self.words[BEATS] = 1
        put_message(self.memory, OTHER_ZERO)
        put_message(self.memory, ZERO)
        monkeypatch.setattr(guardian_process, "monotonic_ns", lambda: self.now)
        monkeypatch.setattr(guardian_process, "select", SimpleNamespace(poll=lambda: self, POLLIN=1))
        monkeypatch.setattr(guardian_process, "write", self._write)
        monkeypatch.setattr(guardian_process, "sleep", lambda _: None)
        reading, writing = os.pipe()
        os.write(writing, goodbye)
        os.close(writing)
        watch(self.memory, reading, -1)
        os.close(reading)

    def register(self, *socket: int) -> None: ...

    def poll(self, wait_ms: float) -> bool:
        self.beats.append(self.words[BEATS])
        due = min(self.deeds)
        self.now = min(self.now + round(wait_ms * MS), due * MS)
        if self.now < due * MS:
            return False
        self.words[LEASE] = self.deeds.pop(due) * MS
        return not self.deeds

    def _write(self, device: int, message: bytes) -> None:
        assert message == ZERO
        self.writes.append(self.now // MS)


@pytest.mark.parametrize(("goodbye", "ends", "last"), [(b"x", 0, 0), (b"x", 9000, 2), (b"", 0, 2)])
def test_a_lease_that_expires_is_met_at_once_ten_times_and_then_slowly(
    monkeypatch: pytest.MonkeyPatch, goodbye: bytes, ends: int, last: int
) -> None:
    loop = Loop(monkeypatch, {100: 150, 2500: 2551, 3000: 0, 5000: ends}, goodbye)
    met = [*range(150, 331, 20), 1330, 2330, *range(2551, 2732, 20)]
    assert (loop.writes, loop.words[WRITES]) == (met + [5000] * last, len(met))
    assert loop.beats == list(range(2, len(loop.beats) + 2))
    assert len(loop.beats) >= (5000 - 1) // 20, "every 20 ms at the longest"


@pytest.mark.parametrize("first", [BlockingIOError(), 2])
def test_what_the_device_has_not_taken_makes_room_for_the_message(monkeypatch: pytest.MonkeyPatch, first: Any) -> None:
    done, outcomes = list[Any](), [first, len(ZERO)]

    def write(device: int, message: bytes) -> int:
        done.append((device, message))
        outcome = outcomes.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return int(outcome)

    flush = SimpleNamespace(error=OSError, TCOFLUSH=1, tcflush=lambda device, _: done.append(device))
    monkeypatch.setattr(guardian_process, "os", SimpleNamespace(write=write))
    monkeypatch.setattr(guardian_process, "termios", flush)
    guardian_process.write(5, ZERO)
    assert done == [(5, ZERO), 5, (5, ZERO)]
