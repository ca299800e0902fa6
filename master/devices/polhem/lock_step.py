"""A dialogue in lock-step: one answer for every message, never taken for the answer to another one.

An answer does not say which message it belongs to, so it counts only while no other is owed. After a missing answer,
none is accepted until all owed answers have come, or until the line was quiet for `QUIET_S` and then answered a single
message with a single answer.
"""

from collections.abc import Callable
from math import inf
from time import monotonic
from typing import Generic, NoReturn, Protocol, TypeVar

from weberlink.hardware.fault import BadReply

Message = TypeVar("Message")
Answer = TypeVar("Answer")
Message_contra = TypeVar("Message_contra", contravariant=True)

QUIET_S = 0.25
"""Owed answers count as lost after this silence [s]."""

SLICE_S = 0.01
"""The longest wait for what is owed in one `ask` [s]."""

PROBE_S = 0.025
"""Time in which a probe must get exactly one answer [s]; longer than from a message to the rest after it."""

UNKNOWN = 1_000_000
"""Number of owed answers after an unexpected one."""

SILENT, LATE = "does not answer", "answers late"


class MessageLine(Protocol[Message_contra, Answer]):
    """Carries messages and answers; raises HardwareFault when disconnected."""

    def send(self, message: Message_contra) -> None: ...

    def hear(self, until: float) -> list[Answer | None]:
        """All answers that have come, oldest first, as soon as there are any; empty if none comes by `until` [s].

        None stands for one that cannot be understood.
        """
        ...


class LockStep(Generic[Message, Answer]):
    """The host's end of a dialogue.

    Args:
        line: to the device.
        rest: message that is safe at any time; goes out at once where an answer does not come.
        clock: that of the line [s].
    """

    def __init__(
        self, line: MessageLine[Message, Answer], rest: Message, clock: Callable[[], float] = monotonic
    ) -> None:
        self._line = line
        self._rest = rest
        self._clock = clock
        self._owed = 0
        self._heard_at = 0.0
        self._complaint = ""

    def ask(self, message: Message, patience: float, fresh_until: float = inf) -> Answer:
        """Send a message and wait for its answer, for at most `patience` [s].

        After `fresh_until` [s] the rest goes out in its place: this process has stood still since the message was made.

        Raises:
            BadReply: it does not come, cannot be understood, or could be that to another message; the device was told
                to rest. In doubt about which is which, the message is not sent.
            HardwareFault: the line is cut.
        """
        self._settle()
        self._line.send(message if self._clock() <= fresh_until else self._rest)
        answers = self._line.hear(self._clock() + patience)
        if not answers:
            self._doubt(2, SILENT)
        if len(answers) > 1:
            self._doubt(UNKNOWN, LATE)
        answer = answers[0]
        if answer is None:
            raise BadReply("sends a malformed answer")
        return answer

    def _settle(self) -> None:
        """Wait until no answer is owed."""
        strays = self._line.hear(0.0)
        if self._owed == 0 and strays:
            self._doubt(UNKNOWN, LATE)
        until = self._clock() + SLICE_S
        while self._owed > 0:
            now = self._clock()
            if strays:
                self._owed = max(0, self._owed - len(strays))
                self._heard_at = now
            elif now >= self._heard_at + QUIET_S:
                self._probe()
            elif now >= until:
                raise BadReply(self._complaint)
            strays = self._line.hear(min(until, self._heard_at + QUIET_S)) if self._owed > 0 else []

    def _probe(self) -> None:
        """Send the rest message, and check that it gets exactly one answer, promptly."""
        self._line.send(self._rest)
        sent = self._clock()
        heard = len(self._line.hear(sent + SLICE_S))
        at_once = heard == 1
        while self._clock() < sent + PROBE_S:
            heard += len(self._line.hear(sent + PROBE_S))
        self._heard_at = self._clock()
        if not at_once or heard != 1:
            self._owed = max(1, self._owed + 1 - heard)
            raise BadReply(self._complaint)
        self._owed = 0

    def _doubt(self, owed: int, complaint: str) -> NoReturn:
        """Send the rest message, and accept nothing until `owed` answers have come."""
        self._line.send(self._rest)
        self._owed = owed
        self._heard_at = self._clock()
        self._complaint = complaint
        raise BadReply(complaint)
