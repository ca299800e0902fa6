"""The figures of one trace with one predictor at one Weber factor. Owns what they are called and mean."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from weberlink.codec import Channel
from weberlink.codec.deadband import ISOTROPIC
from weberlink.studies.evaluate.engine import Engine, coding
from weberlink.studies.evaluate.replay import Array, Signal
from weberlink.system.scoring.perception import in_units, longest_run, noticed, rms


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
    bytes_per_s: float
    """UDP payload of the updates, as on a link secured by a pre-shared key."""
    error_rms_n: float
    error_max_n: float
    jnd_max: float
    """Largest error in units of its bound, in the deadband's own measure."""
    violation_fraction: float
    """Share of ticks outside the row's own deadband: the check that the codec keeps its word."""
    violation_longest_s: float
    error_rms_jnd: float
    """In units of a person's threshold, which is the same for all rows; as are the three that follow."""
    error_max_jnd: float
    noticeable_fraction: float
    noticeable_longest_s: float
    tick_us: float
    """Median run time of encode plus decode by the live codec; on a part of the trace where compiled code codes it."""
    selected: dict[str, int] | None = None
    """Sends per predictor; hybrid only."""
    deadband: str = ISOTROPIC
    """Its shape."""
    clairvoyant_packets: int | None = None
    """No encoder of this predictor could send fewer, even one that knows the future; None if not computed."""

    @property
    def excess(self) -> float | None:
        """Packets in units of the fewest; None where that is none, or is not known."""
        return self.packets / self.clairvoyant_packets if self.clairvoyant_packets else None

    @property
    def clairvoyant_packets_per_s(self) -> float | None:
        """None where not computed."""
        if self.clairvoyant_packets is None:
            return None
        return self.clairvoyant_packets * self.packets_per_s / self.packets if self.packets else 0.0

    def as_json(self) -> dict[str, Any]:
        values = asdict(self) | {"excess": self.excess}
        return {key: value for key, value in values.items() if value is not None}


def code(
    name: str,
    signal: Signal,
    predictor: str,
    weber: float,
    channel: Channel,
    threshold_n: Array,
    clairvoyant_packets: int | None = None,
    engine: Engine = "python",
    deadband: str = ISOTROPIC,
) -> Row:
    """Run one signal through a fresh encoder and decoder.

    Args:
        name: of the trace.
        signal: what to code.
        predictor: name for the row; what is built is the channel's.
        weber: likewise.
        channel: a force channel.
        threshold_n: a person's, for each tick, shape (n,) [N].
        clairvoyant_packets: for the row.
        engine: what codes.
        deadband: name of its shape for the row.
    """
    run = coding(engine)(signal, channel)
    samples, packets, duration = len(run.error_n), len(run.updates), signal.duration_s
    sends = np.bincount(run.selected, minlength=len(channel.bank)).tolist()
    outside = run.deviation_n > run.bound_n
    return Row(
        trace=name,
        predictor=predictor,
        weber=weber,
        samples=samples,
        packets=packets,
        packets_per_s=packets / duration,
        reduction=1.0 - packets / samples,
        bytes_per_s=run.payload_bytes(channel) / duration,
        error_rms_n=rms(run.error_n),
        error_max_n=float(run.error_n.max()),
        jnd_max=float(in_units(run.deviation_n, run.bound_n).max(initial=0.0)),
        violation_fraction=float(outside.mean()),
        violation_longest_s=longest_run(outside) * signal.period_s,
        **noticed(run.error_n, threshold_n, signal.period_s)._asdict(),
        tick_us=run.tick_us,
        deadband=deadband,
        selected=dict(zip(channel.bank, sends, strict=True)) if len(channel.bank) > 1 else None,
        clairvoyant_packets=clairvoyant_packets,
    )
