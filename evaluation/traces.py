"""Recorded signals through the codec: packets, errors and run time for each predictor and Weber factor.

Owns the loop over a trace and the figures of a row. The encoder and decoder are the daemons' own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from time import perf_counter
from typing import Any

from codec import Channel, Decoder, Encoder, force_channel
from codec.vector import ZERO, Vector, distance
from master.trace import Trace


@dataclass(frozen=True)
class Row:
    """One trace, one predictor, one Weber factor."""

    trace: str
    predictor: str
    weber: float
    samples: int
    packets: int
    packets_per_s: float
    reduction: float
    """Against one packet per sample."""
    error_rms_n: float
    error_max_n: float
    jnd_max: float
    """Largest error in units of its bound."""
    tick_us: float
    """Median run time of encode plus decode."""
    selected: dict[str, int] | None
    """Sends per predictor; hybrid only."""

    def as_json(self) -> dict[str, Any]:
        return {key: value for key, value in asdict(self).items() if value is not None}


@dataclass(frozen=True)
class Study:
    """What is varied over every trace, and what is held.

    Args:
        predictors: names, "hybrid" among them.
        webers: Weber factors.
        floor: absolute threshold [N].
        force_step: wire step [N].
        position_step: wire step [m].
        saturates: whether the int16 range applies.
    """

    predictors: Sequence[str] = ("zoh", "linear", "plane", "sphere", "hybrid")
    webers: Sequence[float] = (0.10,)
    floor: float = 0.02
    force_step: float = 1e-3
    position_step: float = 1e-5
    saturates: bool = True

    def rows(self, name: str, trace: Trace) -> Iterator[Row]:
        """All rows of one trace, predictors outermost."""
        for predictor in self.predictors:
            for weber in self.webers:
                channel = force_channel(
                    predictor=predictor,
                    weber=weber,
                    floor=self.floor,
                    force_step=self.force_step,
                    position_step=self.position_step,
                    saturates=self.saturates,
                )
                yield code(name, trace, predictor, weber, channel)


def code(name: str, trace: Trace, predictor: str, weber: float, channel: Channel) -> Row:
    """Run one trace through a fresh encoder and decoder, sample by sample as a daemon would."""
    encoder, decoder = Encoder(channel), Decoder(channel)
    errors: list[float] = []
    jnds: list[float] = []
    times: list[float] = []
    sends = [0] * len(channel.bank)
    forces: list[list[float]] = trace.force_n.tolist()
    positions: list[list[float]] = trace.position_m.tolist()
    for tick, (f, p) in enumerate(zip(forces, positions, strict=True)):
        force: Vector = (f[0], f[1], f[2])
        position: Vector = (p[0], p[1], p[2])
        began = perf_counter()
        update = encoder.encode(tick, force, position)
        if update is not None:
            decoder.apply(update)
        decoded = decoder.value(tick, position) or ZERO
        times.append(perf_counter() - began)
        error = distance(decoded, force)
        errors.append(error)
        if update is not None:
            sends[update.selector] += 1
        if encoder.bound > 0.0:
            jnds.append(error / encoder.bound)
    samples, packets = len(errors), sum(sends)
    duration = samples * trace.period_s
    return Row(
        trace=name,
        predictor=predictor,
        weber=weber,
        samples=samples,
        packets=packets,
        packets_per_s=packets / duration,
        reduction=1.0 - packets / samples,
        error_rms_n=(sum(error * error for error in errors) / samples) ** 0.5,
        error_max_n=max(errors),
        jnd_max=max(jnds, default=0.0),
        tick_us=median(times) * 1e6,
        selected=dict(zip(channel.bank, sends, strict=True)) if len(channel.bank) > 1 else None,
    )
