"""What a page is told: the greeting, rows, the felt error, and rates of the last second."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.examples import examples
from tests.session.systems import CONFIGS
from tests.watching.sources import BANK, RATE, description, pieces, records
from weberlink.figures.session import Layout, SessionScore, TickPairs
from weberlink.figures.tree import to_json
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink.watching.hello import hello
from weberlink.watching.rows import (
    COLUMNS,
    ROTATION,
    Pace,
    Thinning,
    felt_message,
    samples_message,
)

HAND = Layout(RATE, BANK)


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


@pytest.mark.parametrize(
    "name", sorted(path.name for path in CONFIGS.glob("*.yaml") if "key_file" not in path.read_text())
)
def test_every_shipped_scene_can_be_drawn(name: str) -> None:
    told = hello("7", {"slave": description("slave", name)})
    json.dumps(told, allow_nan=False)
    for shape in told["scene"]:
        assert shape["shape"] in ("plane", "sphere", "box", "height_field")
        assert shape.get("heights_m", ()) is not None


@given(st.lists(st.integers(0, 2000), max_size=12))
def test_every_fourth_tick_and_all_events_are_shown(cuts: list[int]) -> None:
    made = records(2000)
    made["sent"][[7, 501, 502, 503]] = 1
    made["rotation_sent"][[1999, 41]] = 1
    made["fault"][801:1203] = Fault.SILENCE
    made["state"][1301:] = 5
    thinning = Thinning(RATE)
    ticks = [tick for piece in pieces(made, cuts) for tick in thinning.choose(piece)["tick"].tolist()]
    assert ticks == sorted({*range(0, 2000, 4), 7, 41, 501, 502, 503, 801, 1203, 1301, 1999})


def test_rows_have_their_columns_and_null_for_what_is_unknown() -> None:
    rows = records(3)
    rows["position"] = [[0.1, 0.2, 0.3]] * 3
    rows["energy"] = [0.5, np.nan, np.inf]
    told = json.loads(json.dumps(samples_message("master", rows, 9.5, HAND), allow_nan=False))
    assert (told["t"], set(told["columns"])) == ([0.5, 0.501, 0.502], set(COLUMNS))
    assert told["columns"]["position"] == [[0.1] * 3, [0.2] * 3, [0.3] * 3]
    assert told["columns"]["rtt_us"] == [None] * 3
    assert told["columns"]["energy"] == [0.5, None, None]
    assert told["columns"]["state"] == [4, 4, 4]
    turned = samples_message("master", rows, 0.0, replace(HAND, torque_bank=("zoh",)))["columns"]
    assert (set(turned), len(turned["rotation_raw"])) == (set(COLUMNS) | set(ROTATION), 3)


@examples(40)
@given(
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.lists(st.integers(0, 900), min_size=3, max_size=3),
    st.sampled_from((0.0, 2e-4, 4.9e-4, 5.1e-4, 8e-4)),
)
def test_felt_error_equals_the_figures(cuts: list[int], others: list[int], phase: float) -> None:
    master, slave = records(900, phase=phase, seed=1), records(900, seed=2)
    slave["state"][200:300] = State.SILENT.value
    master["ramping"][400:450] = 1
    score, felt = SessionScore(HAND), TickPairs(RATE)
    errors: list[float] = []
    for one, other in zip(pieces(master, cuts), pieces(slave, others), strict=True):
        score.add(one, other)
        matched, now, counts = felt.add(one, other)
        told = felt_message(matched[counts], now[counts], 10.0, HAND)
        errors += told["error_n"]
        assert told["t"] == sorted(told["t"])
        assert told["deadbands"] == pytest.approx([error / 1.5 for error in told["error_n"]], abs=1e-4)
    force: dict[str, Any] = to_json(score.figures().felt)
    assert max(errors) == pytest.approx(force["error_max"], abs=1e-5)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(force["error_rms"], abs=1e-5)
    assert np.mean(np.array(errors) > 1.5) == pytest.approx(force["violation_fraction"], abs=2 / len(errors))


def test_pace_covers_the_last_second_of_a_session() -> None:
    pace, made = Pace(), records(5000)
    assert (pace.packets_per_s, pace.reduction) == (None, None)
    # 100 a second for 3 s, then 10 a second.
    made["updates_sent"] = np.minimum(np.arange(5000) // 10, 300) + np.maximum(np.arange(5000) - 3000, 0) // 100
    for part, rate, reduction in ((made[:3000], 100.0, 0.9), (made[3000:], 10.0, 0.99)):
        for piece in np.split(part, 50):
            pace.add(piece)
        assert pace.packets_per_s == pytest.approx(rate, rel=0.11 if rate < 20 else 0.02)
        assert pace.reduction == pytest.approx(reduction, abs=0.005 if reduction < 0.95 else 0.002)
