"""Prometheus metrics, read by its own parser."""

from math import nan
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from plugins.figures.tests.sources import HandSource, records, watched
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED
from weberlink_figures.watching.session import WatchedSession
from weberlink_page.metrics import COUNTERS, exposition


def exposed(*sessions: WatchedSession) -> tuple[dict[str, Any], dict[tuple[str, ...], float]]:
    """Families by name, and values by name and labels, those of the session left out."""
    text, kind = exposition(lambda: sessions)()
    assert kind.startswith("text/plain")
    families = {family.name: family for family in text_string_to_metric_families(text.decode())}
    samples = [sample for family in families.values() for sample in family.samples]
    return families, {
        (sample.name, *(value for key, value in sorted(sample.labels.items()) if key != "session")): sample.value
        for sample in samples
    }


def test_metrics_have_names_units_and_labels() -> None:
    made = records(1000, seed=1)
    made["lateness_us"], made["rtt_us"] = 120.0, 900.0
    for number, (column, _) in enumerate(COUNTERS.values()):
        made[column] = 1000 + number
    made["fault"][500:510] = Fault.SILENCE
    made["ramping"][-1] = RELEASED
    session = watched(made)
    session.admit(HandSource("master"))
    families, values = exposed(session)
    ours = {name: family for name, family in families.items() if not name.startswith("weberlink_monitor")}
    assert all(name.startswith("weberlink_") and family.documentation for name, family in ours.items())
    assert "weberlink_monitor_process_cpu_seconds" in families
    for number, name in enumerate(COUNTERS):
        assert families[f"weberlink_{name}"].type == "counter"
        assert values[f"weberlink_{name}_total", "slave"] == 1000 + number
    expected = {
        ("ticks_total", "slave"): 1000,
        ("round_trip_seconds", "slave"): 900e-6,
        ("one_way_delay_seconds", "slave"): nan,
        ("state", "slave", "engaged"): 1,
        ("state", "slave", "silent"): 0,
        ("button_released", "slave"): 1,
        ("faults_total", "silence", "slave"): 1,
        ("fault", "silence", "slave"): 0,
        ("tick_lateness_seconds", "0.99", "slave"): pytest.approx(120e-6, rel=0.005),
        ("tick_lateness_seconds_count", "slave"): 1000,
        ("session_live",): 1,
        ("session_seen_from_start",): 1,
        ("session_duration_seconds",): 1.0,
        ("reduction_ratio", "force"): session.score.figures().felt.reduction,
    }
    for (name, *labels), value in expected.items():
        assert values[f"weberlink_{name}", *labels] == pytest.approx(value, nan_ok=True), name
    assert families["weberlink_tick_lateness_seconds"].type == "summary"
    assert {name for name, *labels in values if "master" in labels} == {"weberlink_ticks_total"}, (
        "no values of no records"
    )
