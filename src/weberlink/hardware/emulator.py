"""What an emulated device offers, and the loop that carries its bytes; sans-I/O but for that loop.

Bytes and `now` go into an emulator, messages come out. `serve` moves them over a descriptor, a pty's or an emulated HID
node's alike, and adds the faults that lie between a device and its host.
"""

import os
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from select import select
from time import monotonic
from typing import Protocol

CHUNK = 4096
LONGEST_PAUSE_S = 0.02


@dataclass
class WireFaults:
    """What goes wrong between device and host; may be changed at any time, from any thread.

    Args:
        garble: this many of the next replies arrive with a byte changed.
        late_s: every reply leaves this much later [s].
        silent: replies are lost.
    """

    garble: int = 0
    late_s: float = 0.0
    silent: bool = False


class Emulator(Protocol):
    """A device on the wire. `now` [s] never goes back."""

    faults: WireFaults

    def receive(self, data: bytes, now: float) -> None:
        """Bytes as they come, or one HID report without its number."""
        ...

    def advance(self, now: float) -> None:
        """Let mechanics, watchdog and timers come up to `now`."""
        ...

    def replies(self, now: float) -> list[bytes]:
        """The messages that leave the device by `now`, oldest first; each of them once."""
        ...

    def next_timer(self) -> float | None:
        """When `advance` or `replies` is next worth a call though nothing arrives [s]; None for never."""
        ...


def serve(
    emulator: Emulator,
    descriptor: int,
    stopping: Callable[[], bool],
    clock: Callable[[], float] = monotonic,
    encode: Callable[[bytes], bytes] = bytes,
) -> None:
    """Carry bytes until told to stop; `encode` makes of a message what is written on the descriptor for it.

    A read error is not an end: it may only be that no host has the other end open.
    """
    leaving: deque[tuple[float, bytes]] = deque()
    while not stopping():
        now = clock()
        emulator.advance(now)
        faults = emulator.faults
        for reply in emulator.replies(now):
            if not faults.silent:
                leaving.append((now + faults.late_s, _garbled(reply, faults)))
        while leaving and leaving[0][0] <= now:
            try:
                os.write(descriptor, encode(leaving.popleft()[1]))
            except BlockingIOError:
                continue  # the host does not read
            except OSError:
                break
        _wait(emulator, descriptor, leaving[0][0] if leaving else None, clock)


def _wait(emulator: Emulator, descriptor: int, leaves_at: float | None, clock: Callable[[], float]) -> None:
    """Until something arrives, or the next thing is due."""
    due = [each for each in (emulator.next_timer(), leaves_at) if each is not None]
    pause = min(LONGEST_PAUSE_S, max(0.0, min(due) - clock())) if due else LONGEST_PAUSE_S
    try:
        ready, _, _ = select((descriptor,), (), (), pause)
        if ready:
            emulator.receive(os.read(descriptor, CHUNK), clock())
    except OSError:
        select((), (), (), 0.001)


def _garbled(reply: bytes, faults: WireFaults) -> bytes:
    if faults.garble <= 0 or not reply:
        return reply
    faults.garble -= 1
    middle = len(reply) // 2
    return reply[:middle] + bytes([reply[middle] ^ 0x55]) + reply[middle + 1 :]
