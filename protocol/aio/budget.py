"""How much of a processor may be spent on what others send."""


class WorkBudget:
    """Time that may be spent: a share of the time that passes, saved up to a limit.

    A budget of work and not of datagrams: one of the peer costs ten times one of nobody. What is owed is bounded as
    what is saved up is: a machine that stands still would otherwise not hear the peer for several times as long.

    Args:
        share: of one processor, in (0, 1].
        most: that can be saved up, and owed [s].
        now: [s].
    """

    def __init__(self, share: float, most: float, now: float) -> None:
        self._share = share
        self._most = most
        self._left = most
        self._updated_at = now

    def left(self, now: float) -> float:
        """What may be spent now [s]; negative after a piece of work that took longer than was left."""
        self._left = min(self._most, self._left + self._share * max(0.0, now - self._updated_at))
        self._updated_at = now
        return self._left

    def spend(self, seconds: float, now: float) -> None:
        """Take what has been worked until now [s]."""
        self._left = max(self.left(now) - seconds, -self._most)

    def limit(self, share: float) -> None:
        """Change the share from now on."""
        self._share = share

    def wait(self) -> float:
        """How long until there is something left [s]."""
        return max(0.0, -self._left / self._share)
