"""The event log of a session: words, times, ends, and its bounds."""

import pytest

from tests.watching.sources import WALL_OFFSET_S, HandSource, records
from weberlink.protocol.aio.hand_over import PathFacts
from weberlink.protocol.states import State
from weberlink.system.wording import FAULTS, INFO, STATES, Words, fault_words
from weberlink.telemetry.fault import Fault
from weberlink.watching.events import MOST_EVENTS, EventLog, events_message
from weberlink.watching.session import WatchedSession


def test_fault_begins_and_ends_with_times() -> None:
    log = EventLog(1000.0, 10.0)
    made = records(5000)
    made["fault"][1200:3450] = Fault.SILENCE
    log.look("master", made, WALL_OFFSET_S)
    _, began, over = log.events
    assert (began.at, began.level, began.side) == (1.2, "alarm", "master")
    assert began.wall == pytest.approx(WALL_OFFSET_S + 11.2, abs=1e-3)
    assert began.text == "hears nothing from the slave: the force is zero and the robot holds"
    assert (over.at, over.level, over.text) == (3.45, "info", "the fault silence is over after 2.25 s")


def test_every_state_and_fault_has_words() -> None:
    assert set(STATES) == {state.name.lower() for state in State}
    assert set(FAULTS) == {fault.name.lower() for fault in Fault if fault}
    for fault in FAULTS:
        assert "{" not in fault_words("slave", fault).text


def test_log_keeps_only_the_last_events() -> None:
    log = EventLog(1000.0, 10.0)
    for number in range(MOST_EVENTS + 20):
        log.note(10.0 + number, None, Words(INFO, str(number)))
    assert [event.text for event in log.events][:1] == ["20"] and len(log.events) == MOST_EVENTS
    assert [event.text for event in log.since(log.count - 2)] == ["518", "519"]
    assert len(log.since(0)) == MOST_EVENTS and log.since(log.count) == []
    assert events_message("7", log.since(log.count - 1))["events"][0]["at"] == MOST_EVENTS + 19


@pytest.mark.parametrize(
    ("in_order", "level", "words"),
    [(True, "info", "closed in order"), (False, "alarm", "died")],
)
def test_end_of_a_side_names_its_reason(in_order: bool, level: str, words: str) -> None:
    source = HandSource("slave")
    session = WatchedSession("7", source)
    made = records(1500)
    made["state"][1400:] = State.SILENT.value
    source.put(made)
    source.end(in_order=in_order)
    session.look()
    session.look()
    *_, change, end = session.log.events
    assert change.at == 1.4 and change.level == "warn"
    assert (end.level, end.side) == (level, "slave") and words in end.text


def test_figures_name_engagement_and_button() -> None:
    slave, master = HandSource("slave"), HandSource("master")
    session = WatchedSession("7", slave)
    session.admit(master)
    made = records(10)
    made["buttons"] = 2
    master.put(made)
    session.look()
    told = session.figures()
    assert told["engaged"] == {"master": True, "slave": False} and told["button"] is None
    for source in (slave, master):
        assert source.description is not None
        source.description["system"]["master"]["engage"] = {"button": 1}
    assert session.figures()["button"] == "held"
    made["buttons"] = 1
    master.put(made)
    session.look()
    assert session.figures()["button"] == "released"


def test_alarms_are_present_faults_and_causes_of_the_verdict() -> None:
    source = HandSource("slave")
    session = WatchedSession("7", source)
    assert session.figures()["alarms"] == []
    made = records(1000)
    made["ticks_missed"][500:] = 100
    made["fault"][900:] = Fault.TRIPPED
    source.put(made)
    session.look()
    alarms = {alarm["name"]: (alarm["level"], alarm["text"]) for alarm in session.figures()["alarms"]}
    level, text = alarms["slave_tripped"]
    assert level == "failed" and text.startswith("slave: the contact force passed its limit")
    assert alarms["missed_ticks"][0] == "degraded" and "9.1 %" in alarms["missed_ticks"][1]


def test_changed_path_is_an_event_and_in_figures() -> None:
    source = HandSource("master")
    session = WatchedSession("7", source)
    assert source.description is not None
    finding = PathFacts(route="", note="asking the mailbox")
    found = PathFacts(0, "punched", "", "wlan0", "203.0.113.9:40112", 0)
    relayed = PathFacts(0, "relayed", "relay.example", "usb0", "198.51.100.7:3478", 1)
    told = []
    for number, path in enumerate([finding, found, found, relayed]):
        source.description = {**source.description, "paths": [path._asdict()]}
        source.put(records(1100, first=1100 * number))
        session.look()
        told.append(session.figures())
    assert [figures["finding"] for figures in told] == ["asking the mailbox", "", "", ""]
    assert told[-1]["figures"]["paths"]["master"][0]["via"] == "relay.example"
    (shown,) = told[-1]["paths"]
    assert (shown["side"], shown["words"]) == ("master", "relayed by relay.example over usb0")
    events = [(event.level, event.text) for event in session.log.events if event.text.startswith("path")]
    assert events == [
        ("info", "path: asking the mailbox"),
        ("info", "path: punched over wlan0"),
        ("warn", "path: relayed by relay.example over usb0, 1 change"),
    ]
