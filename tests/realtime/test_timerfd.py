"""The kernel's timer as a file descriptor."""

import fcntl
import os
import select
import time

import pytest

from weberlink.realtime import timerfd

MILLISECOND = 1_000_000


@pytest.fixture
def timer():
    fd = timerfd.create()
    yield fd
    os.close(fd)


def test_the_descriptor_is_not_inherited(timer):
    assert fcntl.fcntl(timer, fcntl.F_GETFD) & fcntl.FD_CLOEXEC


def test_timer_set_in_the_past_has_expired_once_per_interval(timer):
    first = time.monotonic_ns() - 10 * MILLISECOND
    timerfd.arm(timer, first, 3 * MILLISECOND)
    before = (time.monotonic_ns() - first) // (3 * MILLISECOND) + 1
    count = timerfd.expirations(timer)
    after = (time.monotonic_ns() - first) // (3 * MILLISECOND) + 1
    assert 4 <= before <= count <= after


def test_it_never_expires_early(timer):
    first = time.monotonic_ns() + 5 * MILLISECOND
    timerfd.arm(timer, first, 3600 * 1000 * MILLISECOND)
    select.select([timer], [], [])
    assert time.monotonic_ns() >= first
    assert timerfd.expirations(timer) == 1
    assert timerfd.expirations(timer) == 0
