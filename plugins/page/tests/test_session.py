"""What a page is told of a session: the greeting, rows, and what is repeated for who begins to watch."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from plugins.figures.tests.sources import BANK, RATE, HandSource, description, pieces, records
from plugins.figures.tests.test_verdict import clean
from plugins.recording.tests import arm_sessions as arms
from weberlink.protocol.paths import LinkPath
from weberlink.telemetry.fault import Fault
from weberlink_figures.session import Layout
from weberlink_figures.verdict import verdict
from weberlink_page.report import figures_of
from weberlink_page.session import (
    BACKLOG_S,
    CARTESIAN,
    COLUMNS,
    SECOND_STREAM,
    PageSession,
    Thinning,
    hello,
    samples_message,
    ways_now,
)

HAND = Layout.hand(RATE, BANK)


def test_backlog_repeats_the_messages_of_the_last_seconds() -> None:
    master, slave = HandSource("master"), HandSource("slave")
    session = PageSession("7", slave)
    session.admit(master)
    assert session.rows() == session.backlog() == []
    told = []
    for first in range(0, 12_000, 500):
        for source in (master, slave):
            source.put(records(500, first=first, seed=first))
        told += session.rows()
    kinds = {("samples", "master"), ("samples", "slave"), ("felt", None)}
    assert {(message["type"], message.get("side")) for message in told} == kinds
    again = session.backlog()
    json.dumps(again, allow_nan=False)
    assert [message["type"] for message in again] == ["samples", "samples", "felt"]
    for message in again:
        same = [one for one in told if (one["type"], one.get("side")) == (message["type"], message.get("side"))]
        assert message["t"] == [t for one in same for t in one["t"]][-len(message["t"]) :]
        assert 11.99 - BACKLOG_S - 0.51 < message["t"][0] <= 12.0 - BACKLOG_S


def test_arms_are_told_by_axis_and_channel() -> None:
    made = {side: arms.records(side, 2000) for side in ("master", "slave")}
    sources = {side: HandSource(side) for side in made}
    for side, source in sources.items():
        source.description = {"side": side, "system": arms.SYSTEM, "bank": ["zoh"], "changes": ["weber"]}
        source.put(made[side])
    session = PageSession("7", sources["slave"])
    session.admit(sources["master"])
    told = {(each["type"], each.get("side")): each for each in session.rows()}
    hello = session.hello()
    assert (hello["axes"], hello["settings"]["weber"], hello["scene"]) == ([*arms.NAMES, "gripper"], 0.13, [])
    assert PageSession("8", HandSource("slave")).hello()["axes"] is None

    for side in made:
        rows = told["samples", side]
        json.dumps(rows, allow_nan=False)
        ticks = np.rint(np.array(rows["t"]) * arms.RATE).astype(int)
        assert {0, arms.SENT_EVERY, arms.GRIPPER_SENT_EVERY} <= set(ticks.tolist())
        assert not (set(CARTESIAN) - {"bound"}) & set(rows["columns"])
        for name in ("position", "raw", "output"):
            shown = np.array(rows["columns"][name]).T
            np.testing.assert_allclose(shown, made[side][name][ticks, : arms.AXES], atol=1e-6)
    columns = told["samples", "slave"]["columns"]
    bound = np.maximum(0.13 * np.abs(columns["raw"]), 0.02)
    np.testing.assert_allclose(columns["bound"], bound, atol=1e-6)

    felt = told["felt", None]
    ticks = np.rint(np.array(felt["t"]) * arms.RATE).astype(int)
    actual = made["slave"]["raw"][ticks, : arms.AXES]
    error = np.abs(made["master"]["output"][ticks, : arms.AXES] - actual)
    worst = (error / np.maximum(0.13 * np.abs(actual), 0.02)).max(axis=1)
    assert worst.max() > 0.1
    np.testing.assert_allclose(felt["deadbands"], worst, atol=1e-3)

    figures = session.figures()
    json.dumps(figures, allow_nan=False)
    assert (figures["ended"], figures["engaged"]) == (False, {"master": True, "slave": True})
    for channel, every in (("joint_torque", arms.SENT_EVERY), ("gripper_angle", arms.GRIPPER_SENT_EVERY)):
        assert figures["packets_per_s_now"][channel] == pytest.approx(arms.RATE / every, rel=0.03)
        assert figures["reduction_now"][channel] == pytest.approx(1.0 - 1.0 / every, abs=0.002)


def test_greeting_has_scene_settings_choices_and_who_is_there() -> None:
    told = hello("7", {"master": description("master"), "slave": None})
    assert told["scene"][0]["normal"] == [0.0, 0.0, 1.0]
    sphere = {"center_m": [0.0, 0.0, -0.045], "radius_m": 0.05, "inside": False, "stiffness_n_m": 500.0, "carve": []}
    assert told["scene"][1] == {"shape": "sphere"} | sphere
    assert told["predictors"] == ["zoh", "linear", "plane", "sphere", "hybrid"]
    assert told["settings"] == {"weber": 0.1, "predictor": "hybrid"}
    assert (told["rate_hz"], told["readonly"]) == (1000.0, False)
    assert (told["states"]["4"], told["faults"]["1"]) == ("engaged", "silence")
    assert (set(told["sides"]), told["present"]) == ({"master", "slave"}, ["master", "slave"])
    unknown = hello("7", {"slave": None})
    assert (unknown["readonly"], unknown["changes"], set(unknown["names"].values())) == (True, [], {None})


@given(st.lists(st.integers(0, 2000), max_size=12))
def test_every_fourth_tick_and_all_events_are_shown(cuts: list[int]) -> None:
    made = records(2000)
    made["sent"][[7, 501, 502, 503]] = 1
    made["second_sent"][[1999, 41]] = 1
    made["fault"][801:1203] = Fault.SILENCE
    made["state"][1301:] = 5
    thinning = Thinning(RATE)
    ticks = [tick for piece in pieces(made, cuts) for tick in thinning.choose(piece)["tick"].tolist()]
    assert ticks == sorted({*range(0, 2000, 4), 7, 41, 501, 502, 503, 801, 1203, 1301, 1999})


def test_rows_have_their_columns_and_null_for_what_is_unknown() -> None:
    rows = records(3)
    rows["position"][:, :3] = [[0.1, 0.2, 0.3]] * 3
    rows["energy"] = [0.5, np.nan, np.inf]
    told = json.loads(json.dumps(samples_message("master", rows, 9.5, HAND), allow_nan=False))
    assert (told["t"], set(told["columns"])) == ([0.5, 0.501, 0.502], set(COLUMNS))
    assert told["columns"]["position"] == [[0.1] * 3, [0.2] * 3, [0.3] * 3]
    assert told["columns"]["rtt_us"] == [None] * 3
    assert told["columns"]["energy"] == [0.5, None, None]
    assert told["columns"]["state"] == [4, 4, 4]
    turned = samples_message("master", rows, 0.0, Layout.hand(RATE, BANK, ("zoh",)))["columns"]
    assert (set(turned), len(turned["raw"])) == (set(COLUMNS) | set(SECOND_STREAM), 6)


def test_a_document_gives_the_figures_back() -> None:
    found = replace(
        clean(), verdict=verdict(clean()), paths={"master": [LinkPath(0, "direct", "", "", "a:1", 0, "", 46)]}
    )
    assert figures_of(json.loads(json.dumps(found.to_json()))) == found


def test_without_a_record_no_way_is_known() -> None:
    assert ways_now({})["to_slave"] == {"one_way_us": None, "loss": None, "burst": None}
