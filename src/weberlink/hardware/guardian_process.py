"""The guardian process: takes the force off a device when the process that commands it stops.

`hardware.guardian` starts it by its path with an isolated interpreter; it imports the standard library alone.
Arguments: the descriptors of the socket to the parent, of the device, and of the shared memory, which holds the message
that takes the force off.

Every force has a lease: before the parent writes one, it stores in the shared memory until when that force may stand
(`LEASE` [ns, CLOCK_MONOTONIC]; 0 for no force). When the lease expires, the guardian writes the message repeatedly
until the parent renews or ends the lease. When the socket closes, which the kernel does however the parent dies, the
guardian writes the message and ends.
"""

import os
import select
import signal
import sys
import termios
from contextlib import suppress
from mmap import mmap
from struct import Struct
from time import monotonic_ns, sleep
from zlib import crc32

LEASE, BEATS, WRITES, SLOT = range(4)
"""Words of 64 bits in the shared memory: `BEATS` and `WRITES` are written by the guardian, the others by the parent.

`BEATS` counts the cycles of the loop, `WRITES` the messages sent, and `SLOT` is the number of the message in use.
"""
WORDS_SIZE = 4 * 8
SLOT_SIZE = 2048
"""Each of the two messages behind the words, its `HEAD` in front. The parent writes the one that is not in use."""
HEAD = Struct("<HI")
"""Length and checksum of a message."""
MEMORY_SIZE = WORDS_SIZE + 2 * SLOT_SIZE

PAUSE_NS = 20_000_000
"""Longest time between two checks of the lease; every lease must be longer."""
REPEATS = 10
"""Number of messages at that pace."""
SLOW_NS = 1_000_000_000
"""Pause between later messages: nobody reads the answers of the device."""
LAST_WRITES = 2
LAST_PAUSE_S = 0.01


def main(arguments: list[str]) -> None:
    socket, device, memory = map(int, arguments)
    # Whoever stops the parent may send the same to its children; this one ends with the parent, not before.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    _go_first()
    data = memoryview(mmap(memory, MEMORY_SIZE))
    data.cast("q")[BEATS] = 1
    watch(data, socket, device)


def put_message(memory: memoryview, message: bytes) -> None:
    """Set what the guardian is to write."""
    words = memory.cast("q")
    slot = 1 - words[SLOT]
    at = WORDS_SIZE + slot * SLOT_SIZE
    stored = HEAD.pack(len(message), crc32(message)) + message
    if len(stored) > SLOT_SIZE:
        raise ValueError(f"a message of {len(message)} bytes is too long for a guardian")
    memory[at : at + len(stored)] = stored
    words[SLOT] = slot


def get_message(memory: memoryview) -> bytes:
    """The message in use; the one before it where a processor that reorders stores (ARM) shows a part of it."""
    newest = memory.cast("q")[SLOT]
    for slot in (newest, 1 - newest):
        at = WORDS_SIZE + slot * SLOT_SIZE
        size, check = HEAD.unpack_from(memory, at)
        message = bytes(memory[at + HEAD.size : at + HEAD.size + size])
        if crc32(message) == check:
            return message
    return b""


def watch(memory: memoryview, socket: int, device: int) -> None:
    """Watch the lease until the parent says goodbye or dies."""
    words = memory.cast("q")
    poll = select.poll()
    poll.register(socket, select.POLLIN)
    repeats, due = 0, 0
    while True:
        words[BEATS] += 1
        lease, now = words[LEASE], monotonic_ns()
        pause = PAUSE_NS
        if lease == 0 or now < lease:
            repeats, due = 0, now
            pause = PAUSE_NS if lease == 0 else min(PAUSE_NS, lease - now)
        elif now >= due and words[LEASE] == lease:  # the parent may have come back this very moment
            words[WRITES] += 1
            write(device, get_message(memory))
            repeats += 1
            due = now + (PAUSE_NS if repeats < REPEATS else SLOW_NS)
        if poll.poll(pause / 1e6):
            goodbye = os.read(socket, 1)
            if not goodbye or words[LEASE] != 0:
                for _ in range(LAST_WRITES):
                    write(device, get_message(memory))
                    sleep(LAST_PAUSE_S)
            return


def write(device: int, message: bytes) -> None:
    """Write the whole message, in place of data that the device has not taken yet."""
    with suppress(OSError, termios.error):  # unplugged
        if not _taken(device, message):
            termios.tcflush(device, termios.TCOFLUSH)
            _taken(device, message)


def _taken(device: int, message: bytes) -> bool:
    try:
        return os.write(device, message) == len(message)
    except BlockingIOError:
        return False


def _go_first() -> None:
    """Raise the priority above the parent's, which may keep the processor busy."""
    with suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with suppress(OSError):
        if os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR):
            highest = os.sched_get_priority_max(os.SCHED_FIFO)
            priority = min(highest, os.sched_getparam(0).sched_priority + 1)
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        else:
            os.setpriority(os.PRIO_PROCESS, 0, -10)


if __name__ == "__main__":
    main(sys.argv[1:])
