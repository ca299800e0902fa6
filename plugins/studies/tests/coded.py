"""The shipped trace, runs of it, and traces of a press along z."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from weberlink.codec import force_channel
from weberlink.master.trace import Trace, read_trace
from weberlink_studies.coded_trace import CodedTrace


@cache
def own() -> Trace:
    return read_trace(Path(__file__).parents[3] / "configs" / "traces" / "operator.npz")


@cache
def run(predictor: str) -> CodedTrace:
    return CodedTrace(own(), force_channel(predictor=predictor))


def pressed(force: Callable[[float], float], seconds: float = 2.0, axis: int = 2) -> Trace:
    """A trace along one axis whose force is a function of time."""
    time = np.arange(round(1e3 * seconds)) * 1e-3
    forces = np.zeros((len(time), 3))
    forces[:, axis] = [force(t) for t in time.tolist()]
    return Trace(time, -forces / 500.0, forces, np.empty((0, 2)))
