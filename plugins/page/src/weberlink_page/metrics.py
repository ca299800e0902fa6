"""Figures of all sessions as Prometheus metrics.

Names and base units follow https://prometheus.io/docs/practices/naming/.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import nan
from typing import Any

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest

from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED
from weberlink_figures.tree import Channel, Figures
from weberlink_figures.watching.session import WatchedSession

Newest = Sequence[tuple[str, str, Any]]  # session, side and newest record
SESSION, SIDE = ("session",), ("session", "side")
COUNTERS = {
    "ticks_missed": ("ticks_missed", "Deadlines without a tick."),
    "slew_limited_ticks": ("slew_ticks", "Ticks in which the slew limit held force or torque back."),
    "contact_limited_ticks": ("contact_ticks", "Ticks in which the limit of the contact force held the robot back."),
    "datagrams_sent": ("datagrams_sent", "Datagrams sent, of every kind."),
    "datagrams_received": ("datagrams_received", "Datagrams received and accepted."),
    "datagrams_lost": ("datagrams_lost", "Datagrams that the peer sent and that never arrived."),
    "datagrams_dropped": ("datagrams_dropped", "Datagrams received and refused."),
    "sent_bytes": ("bytes_sent", "UDP payload sent."),
    "updates_sent": ("updates_sent", "Samples that crossed the deadband and were sent."),
    "updates_received": ("updates_received", "Updates received and applied."),
    "repeats": ("repeats", "Updates repeated because no acknowledgement came."),
    "heartbeats": ("heartbeats", "Heartbeats sent."),
}
"""Metric name to column of the record and meaning."""
GAUGES = {
    "round_trip_seconds": ("rtt_us", 1e-6, "Round trip to the peer, newest estimate."),
    "one_way_delay_seconds": ("one_way_us", 1e-6, "Delay from the peer to this side, newest estimate."),
    "jitter_seconds": (
        "jitter_us",
        1e-6,
        "By how much few datagrams exceed their least delay, in the worse direction.",
    ),
    "incoming_loss_ratio": ("incoming_loss", 1.0, "Recent share of the peer's datagrams that never came."),
    "outgoing_loss_ratio": ("outgoing_loss", 1.0, "The same of this side's datagrams, as the peer reported it."),
    "incoming_burst_datagrams": ("peer_burst", 1.0, "Mean run of lost datagrams of the peer; 0 while unknown."),
    "energy_joules": ("energy", 1.0, "Energy that the display may still give to the hand; 0 without an account."),
}
PATH_INFO = ("route", "via", "interface", "remote")  # labels of a path
QUANTILES = {"0.5": "p50", "0.99": "p99", "0.999": "p99_9"}
CHANNEL_FIGURES: dict[str, tuple[Callable[[Channel], float | None], str]] = {
    "packets_per_second": (lambda channel: channel.packets_per_s, "Updates sent per second, over the session."),
    "reduction_ratio": (lambda channel: channel.reduction, "Share of samples that were not sent."),
    "violation_ratio": (
        lambda channel: channel.errors.violation_fraction,
        "Share of ticks outside the deadband, of felt or followed signals.",
    ),
}


def exposition(sessions: Callable[[], Iterable[WatchedSession]]) -> Callable[[], tuple[bytes, str]]:
    """A function that makes the text of /metrics and its content type; it includes the monitor's own process."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(SessionCollector(sessions))
    ProcessCollector(namespace="weberlink_monitor", registry=registry)
    return lambda: (generate_latest(registry), CONTENT_TYPE_LATEST)


class SessionCollector:
    """Collector that reads the sessions on each scrape."""

    def __init__(self, sessions: Callable[[], Iterable[WatchedSession]]) -> None:
        self._sessions = sessions

    def collect(self) -> Iterator[Metric]:
        sessions = list(self._sessions())
        newest = [(session.name, side, record) for session in sessions for side, record in session.last.items()]
        ticks = ((session.name, side, each.written) for session in sessions for side, each in session.sources.items())
        yield _family(CounterMetricFamily, "ticks", "Ticks of a side.", SIDE, ticks)
        yield from _records(newest)
        yield _faults(sessions)
        yield from _paths(sessions)
        yield from _figures({session.name: session.score.figures() for session in sessions})
        live = ((session.name, not session.ended) for session in sessions)
        yield _family(GaugeMetricFamily, "session_live", "1 while the session runs.", SESSION, live)
        meaning = "1 if the monitor read every record, so that its figures are those of the whole session."
        seen = ((session.name, session.seen_from_start) for session in sessions)
        yield _family(GaugeMetricFamily, "session_seen_from_start", meaning, SESSION, seen)


def _family(
    kind: type[CounterMetricFamily | GaugeMetricFamily],
    name: str,
    meaning: str,
    labels: Sequence[str],
    samples: Iterable[tuple[Any, ...]],
) -> Metric:
    """A metric; each sample is its label values, then its value (None for unknown, which is NaN)."""
    family = kind(f"weberlink_{name}", meaning, labels=labels)
    for *values, value in samples:
        family.add_metric(values, nan if value is None else float(value))
    return family


def _records(newest: Newest) -> Iterator[Metric]:
    """Columns of the newest record of each side."""
    for name, (column, meaning) in COUNTERS.items():
        yield _family(CounterMetricFamily, name, meaning, SIDE, ((*of, record[column]) for *of, record in newest))
    for name, (column, unit, meaning) in GAUGES.items():
        samples = ((*of, float(record[column]) * unit) for *of, record in newest)
        yield _family(GaugeMetricFamily, name, meaning, SIDE, samples)
    meaning = "1 while the robot does not follow because the operator does not hold the button of master.engage."
    released = ((*of, record["ramping"] == RELEASED) for *of, record in newest)
    yield _family(GaugeMetricFamily, "button_released", meaning, SIDE, released)
    for name, kind, meaning in (
        ("state", State, "1 for the state that a side is in."),
        ("fault", Fault, "1 while this fault is active."),
    ):
        members = [each for each in kind if each.value or kind is State]
        samples = ((*of, each.name.lower(), record[name] == each.value) for *of, record in newest for each in members)
        yield _family(GaugeMetricFamily, name, meaning, (*SIDE, name), samples)


def _faults(sessions: Iterable[WatchedSession]) -> Metric:
    samples = (
        (session.name, side, fault, count)
        for session in sessions
        for side, counts in session.faults.items()
        for fault, count in counts.items()
    )
    return _family(CounterMetricFamily, "faults", "How often a fault began.", (*SIDE, "fault"), samples)


def _paths(sessions: Iterable[WatchedSession]) -> Iterator[Metric]:
    """The paths of each side that has found one; `place` numbers them from 0."""
    found = [
        (session.name, side, str(path.place), path)
        for session in sessions
        for side, paths in session.paths.items()
        for path in paths
    ]
    place = (*SIDE, "place")
    infos = ((*of, *(getattr(path, name) for name in PATH_INFO), 1) for *of, path in found if path.route)
    meaning = "1 for the path in use: direct, punched through a NAT, or relayed by `via`."
    yield _family(GaugeMetricFamily, "path_info", meaning, (*place, *PATH_INFO), infos)
    changes = ((*of, path.changes) for *of, path in found)
    yield _family(CounterMetricFamily, "path_changes", "How often a path was replaced by another one.", place, changes)
    dscp = ((*of, path.dscp) for *of, path in found if path.dscp is not None)
    yield _family(GaugeMetricFamily, "path_dscp", "Class of service (DSCP) with which datagrams came.", place, dscp)


def _figures(found: Mapping[str, Figures]) -> Iterator[Metric]:
    """The figures of the report so far."""
    for name, figure, meaning in (
        ("lateness", "lateness_us", "From the deadline to the start of a tick."),
        ("work", "work_us", "From the start of a tick to its end."),
    ):
        family = Metric(f"weberlink_tick_{name}_seconds", meaning, "summary")
        for session, figures in found.items():
            for side, ticks in figures.ticks.items():
                labels = {"session": session, "side": side}
                for quantile, percentile in QUANTILES.items() if ticks.count else ():
                    us = getattr(getattr(ticks, figure), percentile)
                    value = nan if us is None else us * 1e-6
                    family.add_sample(family.name, labels | {"quantile": quantile}, value)
                if ticks.count:
                    family.add_sample(f"{family.name}_count", labels, ticks.count)
        yield family
    for name, (of_channel, meaning) in CHANNEL_FIGURES.items():
        samples = (
            (session, name, of_channel(channel))
            for session, figures in found.items()
            for name, channel in figures.channels.items()
        )
        yield _family(GaugeMetricFamily, name, meaning, ("session", "channel"), samples)
    errors = ((session, each.felt.errors.error_rms) for session, each in found.items() if not each.is_arm)
    yield _family(GaugeMetricFamily, "felt_error_rms_newtons", "RMS error of the felt force.", SESSION, errors)
    lengths = ((session, each.duration_s) for session, each in found.items())
    yield _family(GaugeMetricFamily, "session_duration_seconds", "Length so far.", SESSION, lengths)
