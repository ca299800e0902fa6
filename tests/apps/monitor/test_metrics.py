"""Prometheus metrics, read by its own parser."""

from math import isnan

import pytest
from prometheus_client.parser import text_string_to_metric_families

from tests.watching.sources import HandSource, description, records
from weberlink.apps.monitor.metrics import CHANNEL_FIGURES, COUNTERS, exposition
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.telemetry.fault import Fault
from weberlink.telemetry.record import RELEASED
from weberlink.watching.session import WatchedSession


def test_metrics_have_names_units_and_labels() -> None:
    master, slave = HandSource("master"), HandSource("slave")
    session = WatchedSession("7", slave)
    session.admit(master)
    made = records(1000, seed=1)
    made["lateness_us"] = 120.0
    made["rtt_us"] = 900.0
    for number, (column, _) in enumerate(COUNTERS.values()):
        made[column] = 1000 + number
    made["fault"][500:510] = Fault.SILENCE
    made["ramping"][-1] = RELEASED
    slave.put(made)
    session.look()
    text, kind = exposition(lambda: [session])()
    assert kind.startswith("text/plain")
    families = {family.name: family for family in text_string_to_metric_families(text.decode())}
    ours = {name: family for name, family in families.items() if not name.startswith("weberlink_monitor")}
    assert all(name.startswith("weberlink_") for name in ours)
    assert "weberlink_monitor_process_cpu_seconds" in families
    values = {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in families.values()
        for sample in family.samples
    }
    side = (("session", "7"), ("side", "slave"))
    assert values["weberlink_ticks_total", *side] == 1000
    for number, name in enumerate(COUNTERS):
        assert families[f"weberlink_{name}"].type == "counter"
        assert values[f"weberlink_{name}_total", *side] == 1000 + number
    assert values["weberlink_round_trip_seconds", *side] == pytest.approx(900e-6)
    assert isnan(values["weberlink_one_way_delay_seconds", *side])
    assert values["weberlink_state", *side, ("state", "engaged")] == 1
    assert values["weberlink_state", *side, ("state", "silent")] == 0
    assert values["weberlink_button_released", *side] == 1
    assert values["weberlink_faults_total", ("fault", "silence"), *side] == 1
    assert values["weberlink_fault", ("fault", "silence"), *side] == 0
    assert families["weberlink_tick_lateness_seconds"].type == "summary"
    assert values["weberlink_tick_lateness_seconds", ("quantile", "0.99"), *side] == pytest.approx(120e-6, rel=0.005)
    assert values["weberlink_tick_lateness_seconds_count", *side] == 1000
    assert values["weberlink_session_live", ("session", "7")] == 1
    assert values["weberlink_session_seen_from_start", ("session", "7")] == 1
    assert values["weberlink_session_duration_seconds", ("session", "7")] == pytest.approx(1.0)
    reduction = session.score.summary()["force"]["reduction"]
    assert values["weberlink_reduction_ratio", ("channel", "force"), ("session", "7")] == pytest.approx(reduction)
    for family in ours.values():
        assert family.documentation
    of_master = {name for name, *labels in values if ("side", "master") in labels}
    assert of_master == {"weberlink_ticks_total"}, "a side without records has no values"


def test_paths_have_route_relay_interface_and_changes() -> None:
    source = HandSource("master")
    relayed = PathFacts(0, "relayed", "relay.example", "wlan0", "198.51.100.7:3478", 3)
    assert source.description is not None
    source.description |= {"paths": [relayed._asdict() | {"dscp": 0}, PathFacts(1, "", note="finding")._asdict()]}
    session = WatchedSession("7", source)
    made = records(100)
    made["jitter_us"], made["incoming_loss"], made["outgoing_loss"], made["peer_burst"] = 2500.0, 0.25, 0.5, 1.5
    source.put(made)
    session.look()
    text, _ = exposition(lambda: [session])()
    families = {family.name: family for family in text_string_to_metric_families(text.decode())}
    side = {"session": "7", "side": "master"}
    (info,) = families["weberlink_path_info"].samples
    assert info.value == 1
    assert info.labels == side | {
        "place": "0", "route": "relayed", "via": "relay.example", "interface": "wlan0", "remote": "198.51.100.7:3478"
    }  # fmt: skip
    changes = {sample.labels["place"]: sample.value for sample in families["weberlink_path_changes"].samples}
    assert changes == {"0": 3, "1": 0}
    (dscp,) = families["weberlink_path_dscp"].samples
    assert (dscp.labels, dscp.value) == (side | {"place": "0"}, 0)
    for name, value in {
        "jitter_seconds": 2.5e-3,
        "incoming_loss_ratio": 0.25,
        "outgoing_loss_ratio": 0.5,
        "incoming_burst_datagrams": 1.5,
    }.items():
        (sample,) = families[f"weberlink_{name}"].samples
        assert (sample.labels, sample.value) == (side, pytest.approx(value))


@pytest.mark.parametrize(
    ("file", "channels"),
    [("loopback.yaml", {"force", "position"}), ("rotation.yaml", {"force", "position", "torque", "orientation"})],
)
def test_metrics_cover_the_channels_of_the_session(file: str, channels: set[str]) -> None:
    source = HandSource("slave")
    source.description = description("slave", file)
    session = WatchedSession("7", source)
    source.put(records(1000, seed=1))
    session.look()
    text, _ = exposition(lambda: [session])()
    families = {family.name: family for family in text_string_to_metric_families(text.decode())}
    for name in CHANNEL_FIGURES:
        assert {sample.labels["channel"] for sample in families[f"weberlink_{name}"].samples} == channels


def test_without_session_only_process_metrics() -> None:
    text, _ = exposition(list)()
    families = list(text_string_to_metric_families(text.decode()))
    samples = [sample.name for family in families for sample in family.samples]
    assert samples and all(name.startswith("weberlink_monitor_") for name in samples)
