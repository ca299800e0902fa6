"""What a master without a device does to measure a link: call, wait, ask, and wait for the last answers."""

from weberlink.protocol import PeerClosed, PeerSilent, Refused, State
from weberlink.protocol.probing import ProbingEndpoint

PERIOD_S = 0.005
"""Between two questions: as dense as the updates of a busy session."""
LEAST_PAUSE_S = 0.001
"""Resolution of the timers of uvloop."""
WARM_UP_S = 1.0
"""From the session's beginning to the first question, in which the ends map their clocks."""
ANSWER_S = 5.0
"""Longest time until the slave answers a call."""
FAREWELL = "measured"


class Measurement:
    """What a master without a device does: call, wait, ask, and wait for the last answers.

    Args:
        endpoint: not yet connected.
        now: [s].
        seconds: for how long to ask.
        patience: longest time until the session [s].
    """

    def __init__(self, endpoint: ProbingEndpoint, now: float, seconds: float, patience: float = ANSWER_S) -> None:
        self._endpoint = endpoint
        self._seconds = seconds
        self._give_up_at = now + patience
        self._patience = patience
        self._first_at: float | None = None
        self._due = now
        self.delays: list[tuple[float, float, float]] = []
        self.silences = 0
        self.failure: str | None = None
        self.is_done = False
        endpoint.report_encoding(now, is_encoding=False)
        endpoint.connect(now)

    def service(self, now: float) -> float:
        """Do what is due; returns when to be called again [s]."""
        endpoint = self._endpoint
        self._hear()
        endpoint.report_encoding(now, is_encoding=False)
        if self._first_at is None and not self.is_done:
            self._wait(now)
        if self._first_at is None or self.is_done:
            return now + PERIOD_S
        last_at = self._first_at + self._seconds
        if now > last_at + self._settling():
            self.finish(now)
        elif self._due <= min(now, last_at):
            endpoint.ask(now)
            if endpoint.rtt is not None:
                self.delays.append((now, endpoint.rtt, endpoint.jitter))
            # What this process was too late for is left out: questions in a heap would measure its own stall.
            self._due = max(self._due + PERIOD_S, now)
        return max(self._due, now + LEAST_PAUSE_S)

    def finish(self, now: float, failure: str | None = None) -> None:
        """Leave the session."""
        self.failure = self.failure or failure
        self.is_done = True
        if self._endpoint.state is not State.CLOSED:
            self._endpoint.close(now, FAREWELL)

    def _settling(self) -> float:
        """How long to wait for the last answers."""
        return max(0.1, 2.0 * ((self._endpoint.rtt or 0.0) + self._endpoint.jitter))

    def _wait(self, now: float) -> None:
        endpoint = self._endpoint
        if endpoint.state is State.ENGAGED and endpoint.peer_time(now) is not None:
            self._due = self._first_at = now + WARM_UP_S
        elif now > self._give_up_at:
            why = f"the slave did not answer in {self._patience:g} s: is it started, with the same file and key?"
            self.finish(now, why)

    def _hear(self) -> None:
        while (event := self._endpoint.next_event()) is not None:
            match event:
                case PeerSilent():
                    self.silences += self._first_at is not None
                case Refused(message):
                    self.failure, self.is_done = f"refused: {message}", True
                case PeerClosed(reason) if self._first_at is not None:
                    self.failure, self.is_done = f"the slave left: {reason}", True
