"""What is measured and for how long: one system, with encryption, hybrid prediction and telemetry, at several rates."""

import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from weberlink.system.configuration import Configuration, load

RATES_HZ = (1000.0, 2000.0, 4000.0)
MAIN_RATE_HZ = 1000.0
"""Of CPU time, memory and the latency of an update."""
DURATION_S = 20.0
QUICK_DURATION_S = 1.0

Ports = Callable[[list[str]], list[str]]
"""Overrides that name a free port, for those that there are."""


class BenchError(RuntimeError):
    """A measurement could not be made. One line says which and why."""


@dataclass(frozen=True)
class Arrangement:
    """The system and the time that each part of the run may take.

    Args:
        file: the configuration.
        key_file: a key that is good for this run.
        given: overrides of the user, which come last but for the rate.
        ports: finds a free port.
        duration_s: of the live run at one rate [s]; the other parts take their share of it.
        quick: a glance instead of a measurement.
    """

    file: Path
    key_file: Path
    given: tuple[str, ...]
    ports: Ports
    duration_s: float = DURATION_S
    quick: bool = False

    def overrides(self, rate_hz: float) -> list[str]:
        """Of the file, with a port that is free now."""
        overrides = [
            "link.security=psk",
            f"link.key_file={json.dumps(str(self.key_file))}",
            "codec.force.predictor=hybrid",
            *self.given,
            f"rate_hz={rate_hz:g}",
        ]
        return [*overrides, *self.ports(overrides)]

    def configuration(self, overrides: Sequence[str]) -> Configuration:
        """Raises ConfigurationError for what is wrong with the file or an override."""
        return load(self.file, overrides)


def tell(text: str) -> None:
    """Print an answer of whatever length from a process of this package.

    A kernel may take a part only of a long text, after an event loop on io_uring for one, and Python drops the rest
    where its output is not buffered.
    """
    sys.stdout.flush()
    left = text.encode()
    while left:
        left = left[os.write(sys.stdout.fileno(), left) :]


def module(name: str, *arguments: str) -> list[str]:
    """The command line of a module of this package that is a process of its own."""
    return [sys.executable, "-m", f"weberlink.bench.{name}", *arguments]
