"""Where a fault takes place: what it can reach, and how long it may last."""

from dataclasses import dataclass, field
from random import Random

from tests.soak.ledger import Ledger
from tests.soak.rig import Rig
from tests.soak.watch import Watch


@dataclass
class Field:
    """Where a fault takes place.

    Args:
        short: whether each fault is to last no longer than it must.
        notes: what a fault has to say beside violations, with a count of it.
    """

    rig: Rig
    watch: Watch
    ledger: Ledger
    random: Random
    short: bool
    notes: dict[str, int] = field(default_factory=dict)
    ended_at: float | None = None
    """When the way back began, if not when the fault returned [s]."""

    def lasting(self, short: float, least: float, most: float) -> float:
        """How long a fault lasts [s]."""
        return short if self.short else self.random.uniform(least, most)
