"""The process that takes the force off: when it writes, when it does not, and what is refused without it."""

import os
import signal
import tty
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from select import select
from time import monotonic, sleep

import pytest

from tests.hardware.scripted import PATIENCE_S, descriptors, wait_for
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import LEASE_S, Guardian, HoldingGuardian
from weberlink.hardware.guardian_process import SLOT_SIZE
from weberlink.hardware.serial_port import SerialPort

ZERO, OTHER_ZERO, FORCE = b"zero\n", b"nothing\n", b"force\n"
LONG_S = 60.0
"""A command of this age is still good, and its lease twice as long: this machine may stall."""
WHILE_S = 0.12


@dataclass
class Wire:
    """A port with a guardian, and the device's end of it."""

    guardian: Guardian
    port: SerialPort
    near: int

    def heard(self, wait: float = 0.0) -> bytes:
        return os.read(self.near, 1000) if select((self.near,), (), (), wait)[0] else b""

    def push(self, stale: float = LONG_S) -> None:
        self.guardian.given(monotonic(), stale)
        self.port.write(FORCE)


@pytest.fixture
def wire() -> Iterator[Wire]:
    before = descriptors()
    near, far = os.openpty()
    tty.setraw(far)
    guardian = Guardian(ZERO, (OTHER_ZERO,))
    port = SerialPort(os.ttyname(far), guardian=guardian)
    yield Wire(guardian, port, near)
    port.close()
    assert guardian.pid is None
    os.close(near)
    os.close(far)
    assert descriptors() == before


def test_unrenewed_force_is_taken_off(wire: Wire) -> None:
    began = monotonic()
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE_S) == FORCE
    assert wire.heard(PATIENCE_S).startswith(ZERO)
    assert monotonic() - began >= LEASE_S
    assert wire.heard(PATIENCE_S).startswith(ZERO), "again"
    assert wire.guardian.has_written()


def test_nothing_is_written_while_the_lease_lasts(wire: Wire) -> None:
    wire.push()
    assert wire.heard(PATIENCE_S) == FORCE
    assert wire.heard(WHILE_S) == b""
    assert not wire.guardian.has_written()


@pytest.mark.parametrize("rest", [ZERO, OTHER_ZERO])
def test_nothing_is_written_where_there_is_no_force(wire: Wire, rest: bytes) -> None:
    assert wire.heard(WHILE_S) == b""
    wire.push()
    wire.port.write(rest)
    wire.guardian.given(monotonic() - 2.0 * LONG_S, LONG_S)
    wait_for(lambda: select((wire.near,), (), (), 0.0)[0] != [])
    sleep(0.01)
    assert wire.heard() == FORCE + rest
    assert wire.heard(WHILE_S) == b""


def test_a_parent_that_is_back_is_left_alone(wire: Wire) -> None:
    wire.push(LEASE_S / 2.0)
    wait_for(wire.guardian.has_written)
    wire.port.write(ZERO)
    sleep(WHILE_S)
    wire.heard()
    assert wire.heard(WHILE_S) == b""
    wire.push(LEASE_S / 2.0)
    assert wire.heard(PATIENCE_S) == FORCE
    assert wire.heard(PATIENCE_S).startswith(ZERO), "and watched again"


def test_stale_force_is_not_written(wire: Wire) -> None:
    wire.guardian.given(monotonic() - 0.02, 0.01)
    with pytest.raises(BadReply, match=r"held up for \d+ ms"):
        wire.port.write(FORCE)
    wire.port.write(ZERO)
    assert wire.heard(PATIENCE_S) == ZERO


def test_a_guardian_that_died_means_no_force(wire: Wire) -> None:
    assert wire.guardian.pid is not None
    wire.push()
    os.kill(wire.guardian.pid, signal.SIGKILL)

    def is_refused() -> bool:
        try:
            wire.push()
        except HardwareFault as fault:
            return "guardian process died" in str(fault)
        return False

    wait_for(is_refused)
    wire.heard()
    with suppress(HardwareFault):
        wire.port.write(ZERO)
    assert wire.heard(PATIENCE_S) == ZERO, "which is written all the same"


def test_stopped_guardian_means_no_force(wire: Wire) -> None:
    assert wire.guardian.pid is not None
    os.kill(wire.guardian.pid, signal.SIGSTOP)
    until = monotonic() + PATIENCE_S
    with pytest.raises(HardwareFault, match=r"guardian process \d+ has not run"):
        while monotonic() < until:
            wire.push()
            sleep(0.01)


def test_guardian_ignores_signals_to_the_parent(wire: Wire) -> None:
    pid = wire.guardian.pid
    assert pid is not None
    assert os.getsid(pid) == os.getpgid(pid) == pid
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(pid, number)
    wire.push(LEASE_S / 2.0)
    wait_for(wire.guardian.has_written)


def test_closing_takes_remaining_force_off(wire: Wire) -> None:
    wire.push()
    wire.port.close()
    heard = b""
    while not heard.endswith(ZERO):
        heard += wire.heard(PATIENCE_S)
    assert heard.startswith(FORCE + ZERO)


def test_blocked_device_still_gets_the_zero(wire: Wire) -> None:
    wire.push(LEASE_S / 2.0)
    with pytest.raises(HardwareFault, match="takes no more data"):
        while True:
            wire.guardian.given(monotonic(), LONG_S)
            wire.port.write(FORCE * 100)
    wire.guardian.given(monotonic(), LEASE_S / 2.0)
    with pytest.raises(HardwareFault):
        wire.port.write(FORCE)
    wait_for(wire.guardian.has_written)
    heard = b""
    while part := wire.heard(WHILE_S):
        heard += part
    assert heard.endswith(ZERO)


# --- what leaves an arm that must not lose its torque

HOLDS_S = 0.05


@pytest.fixture
def arm() -> Iterator[tuple[HoldingGuardian, SerialPort, int]]:
    """A guardian, its port, and the arm's end of it."""
    before = descriptors()
    near, far = os.openpty()
    tty.setraw(far)
    guardian = HoldingGuardian(HOLDS_S)
    port = SerialPort(os.ttyname(far), guardian=guardian)
    yield guardian, port, near
    port.close()
    os.close(near)
    os.close(far)
    assert descriptors() == before


def heard(near: int, wait: float = 0.0) -> bytes:
    return os.read(near, 1000) if select((near,), (), (), wait)[0] else b""


def test_last_message_is_written_when_the_cycles_end(arm: tuple[HoldingGuardian, SerialPort, int]) -> None:
    guardian, port, near = arm
    for number in range(50):
        guardian.hold(b"here %d\n" % number)
        port.write(b"there\n")
    expected = b"there\n" * 50 + b"here 49\n"
    written = b""
    while len(written) < len(expected) and (more := heard(near, PATIENCE_S)):  # the kernel hands it over in parts
        written += more
    assert written.startswith(expected)


def test_arm_that_is_safe_is_left_alone(arm: tuple[HoldingGuardian, SerialPort, int]) -> None:
    guardian, port, near = arm
    guardian.hold(b"here\n")
    guardian.end()
    assert heard(near, HOLDS_S + WHILE_S) == b""
    port.close()
    assert heard(near, WHILE_S) == b""


def test_closing_within_a_cycle_leaves_the_arm_safe(arm: tuple[HoldingGuardian, SerialPort, int]) -> None:
    guardian, port, near = arm
    guardian.hold(b"here\n")
    port.close()
    assert heard(near, PATIENCE_S).startswith(b"here\n")


def test_guardian_that_died_is_told_and_messages_still_pass(arm: tuple[HoldingGuardian, SerialPort, int]) -> None:
    guardian, port, near = arm
    assert guardian.pid is not None
    os.kill(guardian.pid, signal.SIGKILL)

    def is_told() -> bool:
        try:
            guardian.hold(b"here\n")
        except HardwareFault as fault:
            return "guardian process died" in str(fault)
        return False

    wait_for(is_told)
    heard(near)
    port.write(b"there\n")
    assert heard(near, PATIENCE_S) == b"there\n"


def test_message_that_has_no_room_is_refused(arm: tuple[HoldingGuardian, SerialPort, int]) -> None:
    guardian, _, near = arm
    guardian.hold(b"here\n")
    with pytest.raises(ValueError, match="too long"):
        guardian.hold(b"x" * SLOT_SIZE)
    assert heard(near, PATIENCE_S).startswith(b"here\n")
