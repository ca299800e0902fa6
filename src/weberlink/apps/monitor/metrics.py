"""The figures of all sessions as Prometheus reads them: names, units and labels. Knows no HTTP.

Base units and names follow https://prometheus.io/docs/practices/naming/.
"""

from collections.abc import Callable, Iterable, Iterator
from math import nan
from typing import Any

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST, generate_latest

from weberlink.apps.monitor.session import Session
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED

COUNTERS = {
    "ticks_missed": ("ticks_missed", "Deadlines without a tick."),
    "slew_limited_ticks": ("slew_ticks", "Ticks in which the slew limit held force or torque back."),
    "datagrams_sent": ("datagrams_sent", "Datagrams sent, of every kind."),
    "datagrams_received": ("datagrams_received", "Datagrams received and accepted."),
    "datagrams_lost": ("datagrams_lost", "Datagrams that the peer sent and that never came."),
    "datagrams_dropped": ("datagrams_dropped", "Datagrams received and refused."),
    "sent_bytes": ("bytes_sent", "UDP payload sent."),
    "updates_sent": ("updates_sent", "Samples that crossed the deadband and were sent."),
    "updates_received": ("updates_received", "Updates received and applied."),
    "repeats": ("repeats", "Updates sent again for want of an acknowledgement."),
    "heartbeats": ("heartbeats", "Heartbeats sent."),
}
"""Name of the metric, to the column of the record and its meaning."""
GAUGES = {
    "round_trip_seconds": ("rtt_us", 1e-6, "Round trip to the peer, newest estimate."),
    "one_way_delay_seconds": ("one_way_us", 1e-6, "Delay from the peer to this side, newest estimate."),
    "tank_joules": ("tank", 1.0, "Energy that passivity control may still spend."),
}
QUANTILES = {"0.5": "p50", "0.99": "p99", "0.999": "p99_9"}
CHANNELS = ("force", "position", "torque", "orientation")
"""Of which a session has the first two or all."""
CHANNEL_FIGURES = {
    "packets_per_second": ("packets_per_s", "Updates sent per second, over the session."),
    "reduction_ratio": ("reduction", "Share of samples that were not sent."),
    "violation_ratio": (
        "violation_fraction",
        "Share of ticks on which what is felt (force, torque) or followed (the others) is outside the deadband.",
    ),
}


class Sessions:
    """The collector: reads the sessions when Prometheus asks.

    Args:
        sessions: all there are.
    """

    def __init__(self, sessions: Callable[[], Iterable[Session]]) -> None:
        self._sessions = sessions

    def describe(self) -> list[Metric]:
        """Nothing beforehand: what there is depends on the sessions."""
        return []

    def collect(self) -> Iterator[Metric]:
        sessions = list(self._sessions())
        summaries = {session.name: session.score.summary() for session in sessions}
        yield from _counters(sessions)
        yield from _states(sessions)
        yield from _gauges(sessions)
        yield from _timing(summaries)
        yield from _channels(summaries)
        yield _whole(sessions)


def exposition(sessions: Callable[[], Iterable[Session]]) -> Callable[[], tuple[bytes, str]]:
    """What makes the text of /metrics, and its type; the monitor's own process is in it too."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(Sessions(sessions))
    ProcessCollector(namespace="weberlink_monitor", registry=registry)
    return lambda: (generate_latest(registry), CONTENT_TYPE_LATEST)


def _counters(sessions: list[Session]) -> Iterator[Metric]:
    ticks = CounterMetricFamily("weberlink_ticks", "Ticks of a side.", labels=["session", "side"])
    for session in sessions:
        for side, feed in session.feeds.items():
            ticks.add_metric([session.name, side], feed.written)
    yield ticks
    for name, (column, meaning) in COUNTERS.items():
        family = CounterMetricFamily(f"weberlink_{name}", meaning, labels=["session", "side"])
        for session, side, record in _newest(sessions):
            family.add_metric([session.name, side], int(record[column]))
        yield family


def _states(sessions: list[Session]) -> Iterator[Metric]:
    live = GaugeMetricFamily("weberlink_session_live", "1 while the session runs.", labels=["session"])
    for session in sessions:
        live.add_metric([session.name], 0.0 if session.ended else 1.0)
    yield live
    for name, column, names, meaning in (
        ("state", "state", {state.value: state.name for state in State}, "1 for the state that a side is in."),
        ("fault", "fault", {fault.value: fault.name for fault in Fault if fault}, "1 while this fault is active."),
    ):
        family = GaugeMetricFamily(f"weberlink_{name}", meaning, labels=["session", "side", name])
        for session, side, record in _newest(sessions):
            for value, word in names.items():
                family.add_metric([session.name, side, word.lower()], float(record[column] == value))
        yield family
    released = GaugeMetricFamily(
        "weberlink_button_released",
        "1 while the robot does not follow, since the operator does not hold the button of master.engage.",
        labels=["session", "side"],
    )
    for session, side, record in _newest(sessions):
        released.add_metric([session.name, side], float(record["ramping"] == RELEASED))
    yield released
    faults = CounterMetricFamily("weberlink_faults", "How often a fault began.", labels=["session", "side", "fault"])
    for session in sessions:
        for side, counts in session.faults.items():
            for fault, count in counts.items():
                faults.add_metric([session.name, side, fault], count)
    yield faults


def _gauges(sessions: list[Session]) -> Iterator[Metric]:
    for name, (column, unit, meaning) in GAUGES.items():
        family = GaugeMetricFamily(f"weberlink_{name}", meaning, labels=["session", "side"])
        for session, side, record in _newest(sessions):
            family.add_metric([session.name, side], float(record[column]) * unit)
        yield family


def _timing(summaries: dict[str, dict[str, Any]]) -> Iterator[Metric]:
    for name, figure, meaning in (
        ("lateness", "lateness_us", "From the deadline to the start of a tick."),
        ("work", "work_us", "From the start of a tick to its end."),
    ):
        family = Metric(f"weberlink_tick_{name}_seconds", meaning, "summary")
        for session, summary in summaries.items():
            for side, timing in summary["ticks"].items():
                if not timing["count"]:
                    continue
                labels = {"session": session, "side": side}
                for quantile, percentile in QUANTILES.items():
                    family.add_sample(
                        family.name, labels | {"quantile": quantile}, _seconds(timing[figure][percentile])
                    )
                family.add_sample(f"{family.name}_count", labels, timing["count"])
        yield family


def _channels(summaries: dict[str, dict[str, Any]]) -> Iterator[Metric]:
    for name, (figure, meaning) in CHANNEL_FIGURES.items():
        family = GaugeMetricFamily(f"weberlink_{name}", meaning, labels=["session", "channel"])
        for session, summary in summaries.items():
            for channel in filter(summary.__contains__, CHANNELS):
                family.add_metric([session, channel], _number(summary[channel][figure]))
        yield family
    felt = GaugeMetricFamily("weberlink_felt_error_rms_newtons", "Of the felt force.", labels=["session"])
    duration = GaugeMetricFamily("weberlink_session_duration_seconds", "Length so far.", labels=["session"])
    for session, summary in summaries.items():
        felt.add_metric([session], _number(summary["force"]["error_rms"]))
        duration.add_metric([session], summary["duration_s"])
    yield felt
    yield duration


def _whole(sessions: list[Session]) -> Metric:
    family = GaugeMetricFamily(
        "weberlink_session_seen_from_start",
        "1 if the monitor saw every record, so that its figures are those of the whole session.",
        labels=["session"],
    )
    for session in sessions:
        family.add_metric([session.name], float(session.seen_from_start))
    return family


def _newest(sessions: list[Session]) -> Iterator[tuple[Session, str, Any]]:
    for session in sessions:
        for side, record in session.last.items():
            yield session, side, record


def _number(value: float | None) -> float:
    """Prometheus writes NaN for what is not known."""
    return nan if value is None else value


def _seconds(us: float | None) -> float:
    return _number(us) * 1e-6
