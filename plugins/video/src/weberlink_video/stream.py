"""The way of pictures between two hosts: fragments, what is sent again, and a rate that yields to the link. No I/O.

A message is cut into fragments, each a datagram of a session of its own. The receiver says which of them are missing,
how late they come beyond the quickest one and beyond those that met none of ours, and how many bytes came; the sender
keeps its rate below what fills the queues of the link, so that what shares it, the force first of all, does not wait
behind pictures (as LEDBAT, RFC 6817).
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf
from struct import Struct
from typing import Final

from weberlink_figures.pictures import HEAD as MESSAGE_HEAD, LARGEST, LONGEST_TEXT

HEAD: Final = Struct("<BIHHq")
"""Camera, number of the message, place of the fragment, number of fragments, when taken on the sender's clock [us]."""
CHUNK: Final = 1150 - HEAD.size
"""Bytes of a message in a fragment, at most: with all that is around it, a datagram fits the least path of IPv6."""
LEAST_CHUNK: Final = 300
FRAGMENT_S: Final = 0.002
"""Longest time that a fragment takes at the rate, above `LEAST_CHUNK`: what shares the link waits for it to pass."""
MOST_FRAGMENTS: Final = (MESSAGE_HEAD.size + 2 * LONGEST_TEXT + LARGEST) // CHUNK + 1
FORM_BYTES: Final = HEAD.size + CHUNK
REPORT: Final = Struct("<IHI")  # number of the report, delay in queues [0.1 ms], and bytes so far, modulo 2^32
MISSING: Final = Struct("<IH")  # message and place of a fragment that is missing
MOST_MISSING: Final = 60
REPORT_BYTES: Final = REPORT.size + MOST_MISSING * MISSING.size
REPORT_S: Final = 0.05
KEPT: Final = 8  # messages of which fragments can be sent again, and that are put together at a time
DEADLINE_S: Final = 0.5  # a picture that is older is given up
QUEUE_S: Final = 0.005  # delay in queues up to which the rate grows
GROWTH, SLOW_GROWTH, FALL = 0.08, 0.01, 0.8  # at a report
NEAR: Final = 0.9  # of the rate at which queues grew before: from there on, and as far beyond, it grows slowly
LEAST_BIT_S, FIRST_BIT_S = 1e5, 2e6
BURST_S: Final = 0.01  # of the rate, which a host that stood still for so long makes up for
ALONE_SHARE: Final = 1 / 32  # of a fragment in the mean delay of those that met no queue of pictures
WAITED_SHARE: Final = 0.75
"""Of the time that a host did not look, which fragments count as having waited there: half of it would be the mean, and
what is left over passes for a queue of the link; all of it would hide one."""
ASK_AGAIN_S: Final = 0.02  # beside the round trip, until a fragment that is missing is asked for again
TAIL_S: Final = 0.03  # without a fragment for so long, the rest of a picture is missing


class Sender:
    """Sends the newest message of each camera; an older one that has not begun to leave is dropped."""

    def __init__(self, most_bit_s: float) -> None:
        self.rate = FIRST_BIT_S  # [bit/s]
        self.most_bit_s = most_bit_s  # of all of them; may be changed
        self._next: dict[int, tuple[bytes, float, int]] = {}
        self._queue: deque[bytes] = deque()
        self._sent: dict[int, tuple[list[bytes], float]] = {}  # fragments of a message, and when it was taken [s]
        self._number = 0
        self._tokens, self._filled_at = 0.0, -inf
        self._report = 0
        self._received: tuple[int, float] | None = None
        self._fell_at = -inf
        self._top = inf  # [bit/s] that filled queues last

    def put(self, camera: int, message: bytes, at: float, at_us: int) -> None:
        """Send a message, taken at a moment [s] that is `at_us` on the sender's clock."""
        self._next[camera] = message, at, at_us

    def take(self, now: float) -> Iterator[bytes]:
        """The fragments that may leave now."""
        self.rate = min(self.rate, self.most_bit_s)
        self._tokens = min(BURST_S * self.rate / 8.0, self._tokens + max(0.0, now - self._filled_at) * self.rate / 8.0)
        self._filled_at = now
        while self._tokens > 0.0 and (self._queue or self._begin(now)):
            fragment = self._queue.popleft()
            self._tokens -= len(fragment)
            yield fragment

    def _begin(self, now: float) -> bool:
        """Cut the next message into fragments."""
        while self._next:
            camera = next(iter(self._next))
            message, at, at_us = self._next.pop(camera)
            if now - at > DEADLINE_S:
                continue
            self._number += 1
            most = min(CHUNK, max(LEAST_CHUNK, int(self.rate / 8.0 * FRAGMENT_S)))
            count = min(MOST_FRAGMENTS, -(-len(message) // most))
            ends = [len(message) * place // count for place in range(count + 1)]
            fragments = [
                HEAD.pack(camera, self._number, place, count, at_us) + message[ends[place] : ends[place + 1]]
                for place in range(count)
            ]
            self._sent[self._number] = fragments, at
            self._sent.pop(self._number - KEPT, None)
            self._queue.extend(fragments)
            return True
        return False

    def hear(self, report: bytes, now: float) -> None:
        """Take a report of the receiver: send again what is missing, and keep to a rate that the link carries."""
        if len(report) < REPORT.size or (len(report) - REPORT.size) % MISSING.size:
            return
        number, late, received = REPORT.unpack_from(report)
        if number <= self._report:
            return
        self._report = number
        again = []
        for message, place in MISSING.iter_unpack(report[REPORT.size :]):
            fragments, at = self._sent.get(message, ([], -inf))
            if place < len(fragments) and now - at < DEADLINE_S:
                again.append(fragments[place])
        self._queue.extendleft(reversed(again[:MOST_MISSING]))
        self._adapt(late * 1e-4, received, now)

    def _adapt(self, queue_s: float, received: int, now: float) -> None:
        before, self._received = self._received, (received, now)
        if queue_s <= QUEUE_S:
            growth = SLOW_GROWTH if NEAR * self._top < self.rate < self._top / NEAR else GROWTH
            self.rate *= 1.0 + growth * (1.0 - queue_s / QUEUE_S)
        elif before is not None and now - self._fell_at > max(2.0 * REPORT_S, queue_s):
            carried = (received - before[0] & 0xFFFF_FFFF) * 8.0 / max(now - before[1], 1e-3)
            self._top = min(self.rate, max(carried, 0.5 * self.rate))
            self.rate = max(LEAST_BIT_S, FALL * self._top)
            self._fell_at = now


@dataclass
class _Partial:
    """A message that is being put together."""

    camera: int
    count: int
    at_us: int
    began: float
    fragments: dict[int, bytes] = field(default_factory=dict)
    highest: int = -1
    asked: dict[int, float] = field(default_factory=dict)
    heard_at: float = 0.0


class Receiver:
    """Puts messages together; of each camera none that is older than one that it gave before."""

    def __init__(self) -> None:
        self._partial: dict[int, _Partial] = {}
        self._newest: dict[int, int] = {}
        self._bytes = self._number = self._seen = 0
        self._late: list[float] = []
        self._alone, self._came_at = 0.0, -inf
        self._quickest: deque[tuple[float, float]] = deque()
        self._report_at = -inf

    def take(self, fragment: bytes, age: float, now: float, stood: float = 0.0) -> tuple[bytes, int] | None:
        """Take a fragment; a message that is whole by now, and when it was taken on the sender's clock [us]. What does
        not fit is dropped.

        Args:
            age: for how long it was on its way when it was read [s].
            stood: for how long this host had not looked [s]: so long it may have waited here, not on the link.
        """
        if len(fragment) <= HEAD.size:
            return None
        camera, number, place, count, at_us = HEAD.unpack_from(fragment)
        body = fragment[HEAD.size :]
        if not place < count <= MOST_FRAGMENTS:
            return None
        self._bytes += len(fragment)
        self._measure(age, now, stood)
        if number <= self._newest.get(camera, 0) or number <= self._seen - KEPT:
            return None
        self._seen = max(self._seen, number)
        partial = self._partial.setdefault(number, _Partial(camera, count, at_us, now))
        for old in [each for each in self._partial if each <= self._seen - KEPT]:
            del self._partial[old]
        if (partial.camera, partial.count, partial.at_us) != (camera, count, at_us):
            return None
        partial.fragments[place] = body
        partial.highest, partial.heard_at = max(partial.highest, place), now
        if len(partial.fragments) < count:
            return None
        self._newest[camera] = number
        for old in [each for each, of in self._partial.items() if of.camera == camera and each <= number]:
            del self._partial[old]
        return b"".join(partial.fragments[index] for index in range(count)), at_us

    def _measure(self, age: float, now: float, stood: float) -> None:
        """Note by how much the link made a fragment later than the quickest one of the last 10 s, at least.

        One that was sent after those before it had left the link met no queue of pictures, but what varies every delay.
        """
        quickest = self._quickest
        while quickest and quickest[-1][1] >= age:
            quickest.pop()
        quickest.append((now, age))
        while quickest[0][0] < now - 10.0:
            quickest.popleft()
        late = max(0.0, age - quickest[0][1] - WAITED_SHARE * stood)
        if now - age > self._came_at:
            self._alone += (late - self._alone) * ALONE_SHARE
        self._came_at = max(self._came_at, now - quickest[0][1])
        self._late.append(late)

    def report(self, now: float, round_trip: float) -> bytes | None:
        """What to tell the sender now; None for nothing."""
        missing = list(self._missing(now, round_trip))[:MOST_MISSING]
        if not missing and now < self._report_at + REPORT_S:
            return None
        if not missing and not self._late:
            return None
        late = sum(self._late) / max(1, len(self._late))
        queue = max(0.0, min(6.5, late - 3.0 * self._alone))  # of delays that vary by chance few are longer
        if now >= self._report_at + REPORT_S:
            self._report_at = now
            self._late.clear()
        self._number += 1
        told = REPORT.pack(self._number, round(queue * 1e4), self._bytes & 0xFFFF_FFFF)
        return told + b"".join(MISSING.pack(*each) for each in missing)

    def _missing(self, now: float, round_trip: float) -> Iterator[tuple[int, int]]:
        """Message and place of fragments that did not come in their turn and were not asked for lately."""
        for number, partial in list(self._partial.items()):
            if now - partial.began > DEADLINE_S:
                del self._partial[number]
                continue
            is_over = number < self._seen or now - partial.heard_at > TAIL_S
            for place in range(partial.count if is_over else partial.highest):
                asked = partial.asked.get(place, -inf)
                if place not in partial.fragments and now - asked > round_trip + ASK_AGAIN_S:
                    partial.asked[place] = now
                    yield number, place
