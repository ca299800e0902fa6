"""A dialogue with a board: which answer belongs to which message.

In lock-step there is one answer for every message, and it does not say for which. So it counts only while no other is
owed. After a missing answer, none is accepted until all owed answers have come, or until the line was quiet for
`QUIET_S` and then answered a single message with a single answer.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import inf
from time import monotonic
from typing import NoReturn

from weberlink.hardware.fault import BadReply
from weberlink.master.devices.polhem.protocol import NO_CURRENT, Message, Sensors

REPLY_S = 0.01
QUIET_S = 0.25  # owed answers count as lost after this silence [s]
SLICE_S = 0.01  # the longest wait for what is owed in one `ask` [s]
# Time in which a probe must get exactly one answer [s]; longer than from a message to the rest after it.
PROBE_S = 0.025
UNKNOWN = 1_000_000  # number of owed answers after an unexpected one
SILENT, LATE = "does not answer", "answers late"


class LockStep(ABC):
    """The host's end of a dialogue; `send` and `hear` raise HardwareFault when disconnected."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        self._clock = clock
        self._owed = 0
        self._heard_at = 0.0
        self._complaint = ""

    @abstractmethod
    def send(self, message: Message) -> None: ...

    @abstractmethod
    def hear(self, until: float) -> Sequence[Sensors | None]:
        """All answers that have come, oldest first, as soon as there are any; empty if none comes by `until` [s].

        None stands for one that cannot be understood.
        """

    def ask(self, message: Message, fresh_until: float = inf) -> Sensors:
        """Send a message and wait for its answer, for at most `REPLY_S`; where none comes, one without current follows.

        After `fresh_until` [s] no current goes out in its place: this process has stood still since it was made. Raises
        BadReply if it does not come, cannot be understood, or could be that to another message; the board was told to
        rest, and in doubt about which is which, the message is not sent. Raises HardwareFault if the line is cut.
        """
        self._settle()
        self.send(message if self._clock() <= fresh_until else NO_CURRENT)
        answers = self.hear(self._clock() + REPLY_S)
        if not answers:
            self._doubt(2, SILENT)
        if len(answers) > 1:
            self._doubt(UNKNOWN, LATE)
        if answers[0] is None:
            raise BadReply("sends a malformed answer")
        return answers[0]

    def _settle(self) -> None:
        """Wait until no answer is owed."""
        strays = self.hear(0.0)
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
            strays = self.hear(min(until, self._heard_at + QUIET_S)) if self._owed > 0 else []

    def _probe(self) -> None:
        """Send a message without current, and check that it gets exactly one answer, promptly."""
        self.send(NO_CURRENT)
        sent = self._clock()
        heard = len(self.hear(sent + SLICE_S))
        at_once = heard == 1
        while self._clock() < sent + PROBE_S:
            heard += len(self.hear(sent + PROBE_S))
        self._heard_at = self._clock()
        if not at_once or heard != 1:
            self._owed = max(1, self._owed + 1 - heard)
            raise BadReply(self._complaint)
        self._owed = 0

    def _doubt(self, owed: int, complaint: str) -> NoReturn:
        """Send a message without current, and accept nothing until `owed` answers have come."""
        self.send(NO_CURRENT)
        self._owed = owed
        self._heard_at = self._clock()
        self._complaint = complaint
        raise BadReply(complaint)
