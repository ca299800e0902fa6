"""What codes the signals of a study: the live encoder and decoder, or the same compiled. Rows do not tell which it was.

Owns the choice. Numba, which compiles (extra: compiled), is imported by the one choice that needs it.
"""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Literal

import numpy as np

from weberlink.codec import Channel, force_channel
from weberlink.studies.evaluate.replay import Replay, Signal
from weberlink.studies.evaluate.replay import replay as live

Engine = Literal["python", "compiled"]
Coding = Callable[[Signal, Channel], Replay]

WORTH_COMPILING = 2_000_000.0
"""Coded samples from which compiling pays, though it were for the first time on this machine."""


def coding(engine: Engine) -> Coding:
    """What replays a signal; what cannot be compiled (`adaptive`, and what it adds) is coded by the live codec.

    Raises:
        ImportError: numba is missing, and asked for.
    """
    if engine == "python":
        return live
    from weberlink.studies.evaluate.compiled.replay import knows, replay  # noqa: PLC0415 - heavy, an extra

    def replay_soonest(signal: Signal, channel: Channel) -> Replay:
        return (replay if knows(channel) else live)(signal, channel)

    return replay_soonest


def prepare(engine: Engine) -> None:
    """Compile what must be, once and for all processes, which otherwise would all do it at the same time."""
    coding(engine)(Signal(np.zeros((1, 3)), np.zeros((1, 3)), 1e-3), force_channel())


def fitting(samples: float) -> Engine:
    """What is done soonest with so many coded samples on this machine."""
    return "compiled" if samples >= WORTH_COMPILING and find_spec("numba") is not None else "python"
