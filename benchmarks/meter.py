"""Stopwatch around method calls: the time spent in each part, without the calls that it makes to other parts.

Methods of classes are replaced for a while, so that methods bound in a constructor are timed too. The cost of the
timing itself is calibrated.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from inspect import isfunction
from statistics import median
from time import perf_counter_ns
from typing import Any

OUTSIDE = "outside"
"""The part that is charged by default."""


def _zeros() -> dict[str, float]:
    return defaultdict(int)


@dataclass
class Account:
    """By part: own time [ns], its calls, and the timed calls that it made."""

    spent: dict[str, float] = field(default_factory=_zeros)
    calls: dict[str, float] = field(default_factory=_zeros)
    nested: dict[str, float] = field(default_factory=_zeros)

    def scaled(self, share: float) -> "Account":
        """The same calls in a share of the time, where other processes had the processor for the rest."""
        return Account({part: share * spent for part, spent in self.spent.items()}, self.calls, self.nested)


@dataclass(frozen=True)
class Overhead:
    """Cost of timing one call [ns]: within its own part, and within the calling part."""

    inside: float
    outside: float

    def cost(self, account: Account) -> float:
        """Cost of all timing [ns]."""
        return self.inside * sum(account.calls.values()) + self.outside * sum(account.nested.values())

    def corrected(self, account: Account) -> dict[str, float]:
        """Time by part without the cost of timing it [ns]; never less than 0."""
        calls, nested = account.calls, account.nested
        return {
            part: max(0.0, spent - self.inside * calls.get(part, 0) - self.outside * nested.get(part, 0))
            for part, spent in account.spent.items()
        }


class Meter:
    """Charges all time from one part boundary to the next, so that no time is counted twice or lost.

    Args:
        clock: ascending [ns].
    """

    __slots__ = ("_account", "_clock", "_part", "_since")

    def __init__(self, clock: Callable[[], int] = perf_counter_ns) -> None:
        self._clock = clock
        self._account = Account()
        self._part = OUTSIDE
        self._since = clock()

    @contextmanager
    def charging(self, account: Account, part: str) -> Iterator[None]:
        """In this block, time goes to an account: to `part` where no timed method runs."""
        before = self._account, self._part
        self._switch(part)
        self._account = account
        try:
            yield
        finally:
            self._switch(before[1])
            self._account = before[0]

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """A wrapper that charges the time of a function to `part`."""
        clock = self._clock

        @wraps(function)
        def measured(*arguments: Any, **named: Any) -> Any:
            account, caller = self._account, self._part
            account.nested[caller] += 1
            account.calls[part] += 1
            now = clock()
            account.spent[caller] += now - self._since
            self._since = now
            self._part = part
            try:
                return function(*arguments, **named)
            finally:
                now = clock()
                account.spent[part] += now - self._since
                self._since = now
                self._part = caller

        return measured

    def _switch(self, part: str) -> None:
        now = self._clock()
        self._account.spent[self._part] += now - self._since
        self._since = now
        self._part = part


@contextmanager
def metered(meter: Meter, parts: Mapping[type, str]) -> Iterator[None]:
    """In this block every public method of these classes is timed, inherited ones too; properties are not."""
    replaced: list[tuple[type, str, Any]] = []
    try:
        for owner, part in parts.items():
            for name, function in _methods(owner).items():
                replaced.append((owner, name, vars(owner).get(name)))
                setattr(owner, name, meter.timed(part, function))
        yield
    finally:
        for owner, name, original in reversed(replaced):
            if original is None:
                delattr(owner, name)
            else:
                setattr(owner, name, original)


def _methods(owner: type) -> dict[str, Callable[..., Any]]:
    found: dict[str, Callable[..., Any]] = {}
    for base in reversed(owner.__mro__[:-1]):
        found |= {name: each for name, each in vars(base).items() if isfunction(each) and not name.startswith("_")}
    # A class may override a function of its base with something else.
    return {name: each for name, each in found.items() if isfunction(owner.__dict__.get(name, each))}


def calibrate(rounds: int = 31, calls: int = 1000) -> Overhead:
    """Time empty methods with and without the meter; median of several rounds."""
    inside, outside = [], []
    for _ in range(rounds):
        meter, account = Meter(), Account()
        timed = meter.timed("callee", _nothing)
        began = perf_counter_ns()
        for _ in range(calls):
            _nothing(1, 2)
        bare = perf_counter_ns() - began
        with meter.charging(account, "caller"):
            for _ in range(calls):
                timed(1, 2)
        inside.append(account.spent["callee"] / calls)
        outside.append((account.spent["caller"] - bare) / calls)
    return Overhead(median(inside), median(outside))


def _nothing(_one: object, _other: object) -> None:
    """An empty method."""
