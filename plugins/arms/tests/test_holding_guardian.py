"""What leaves an arm as it is, which must not lose its torque, when its host stops; live, as of every guardian."""

import signal
from collections.abc import Iterator
from socket import SHUT_RDWR

import pytest

from tests.hardware.test_guardian import HERE, WHILE_S, Wire, guarded
from tests.wait import PATIENCE, until
from weberlink.hardware.guardian import LEASE_S
from weberlink_arms.feetech.follower import HoldingGuardian


@pytest.fixture
def arm() -> Iterator[Wire]:
    with guarded(HoldingGuardian(LEASE_S)) as wire:
        yield wire


def test_last_message_is_written_when_the_cycles_end(arm: Wire) -> None:
    for number in range(50):
        arm.guardian.hold(b"here %d\n" % number)
        arm.port.write(b"there\n")
    came = bytearray()
    until(lambda: came.extend(arm.heard()) or b"here 49\n" in came, "the last message")
    # Where a cycle came late, an earlier one was written before it.
    assert came.count(b"there\n") == 50 and came.rindex(b"there\n") < came.index(b"here 49\n")


def test_arm_that_is_safe_is_left_alone_and_one_within_a_cycle_is_made_safe(arm: Wire) -> None:
    arm.guardian.hold(HERE)
    arm.guardian.end()
    assert arm.heard(LEASE_S + WHILE_S) == b""
    arm.guardian.hold(HERE)
    arm.port.close()
    assert arm.heard(PATIENCE).startswith(HERE)


def test_arm_that_was_left_safe_is_left_alone_when_its_host_dies(arm: Wire) -> None:
    arm.guardian.hold(HERE)
    arm.guardian.end()
    arm.guardian._connection.shutdown(SHUT_RDWR)
    assert arm.heard(WHILE_S) == b""


def test_guardian_that_died_is_told_and_messages_still_pass(arm: Wire) -> None:
    arm.signal_guardian(signal.SIGKILL)
    arm.until_told(lambda: arm.guardian.hold(HERE))
    arm.heard()
    arm.port.write(b"there\n")
    assert arm.heard(PATIENCE) == b"there\n"
