"""The claims of the paper: savings computed by hand, the page, and the command on a small scope."""

import csv
import re
from dataclasses import replace
from math import exp, log
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from tests.examples import examples
from tests.system.systems import CONFIGS
from weberlink.cli import app
from weberlink.master.trace import read_trace
from weberlink.studies.curves import Observation
from weberlink.studies.evaluate.traces import NamedTrace
from weberlink.studies.paper.claims import CLAIMS, PREDICTORS, Claim, measure, rate_at
from weberlink.studies.paper.command import PAGE, SCENE_STUDY, SCENES, STUDY, PaperScope, run
from weberlink.studies.paper.document import PaperCondition, document

AT_WEBER = Claim("hybrid", "zoh", "weber", 0.42)
AT_QUALITY = Claim("hybrid", "zoh", "quality", 0.60)


def unit(name, predictor, *points):
    """Observations of (weber, rate, error)."""
    return [Observation(name, predictor, weber, rate, error) for weber, rate, error in points]


# --- savings


def test_claims_are_shares_of_known_predictors():
    assert {name for claim in CLAIMS for name in (claim.predictor, claim.reference)} == set(PREDICTORS)
    assert all(0.0 < claim.fewer < 1.0 for claim in CLAIMS)


def test_at_equal_weber_factor_ratios_are_averaged_geometrically():
    observations = [
        *unit("a", "zoh", (0.1, 40.0, 0.5)), *unit("a", "hybrid", (0.1, 10.0, 0.5)),
        *unit("b", "zoh", (0.1, 20.0, 0.5)), *unit("b", "hybrid", (0.1, 20.0, 0.5)),
        *unit("silent", "zoh", (0.1, 0.0, 0.0)), *unit("silent", "hybrid", (0.1, 0.0, 0.0)),
    ]  # fmt: skip
    found = measure(AT_WEBER, observations)
    assert found.units == 2
    assert found.ratios == {"a": 0.25, "b": 1.0}
    assert list(found.fewer) == pytest.approx([0.5, 0.0, 0.75])
    assert found.failing == ("b",)


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ([0.5, 0.5], "holds"),
        ([0.5, 0.58], "holds"),
        ([0.5, 0.59], "undecided"),  # the mean saves as much as claimed, the interval does not
        ([0.3, 1.4], "undecided"),
        ([0.57, 0.9], "undecided"),
        ([0.8, 0.81], "fails"),
        ([1.2, 1.1], "fails"),
        ([0.5], "undecided"),
        ([], "not measured"),
    ],
)
def test_the_verdict_on_a_claim(ratios, verdict):
    observations = []
    for index, ratio in enumerate(ratios):
        observations += unit(str(index), "zoh", (0.1, 100.0, 0.5)) + unit(str(index), "hybrid", (0.1, 100 * ratio, 0.5))
    assert measure(AT_WEBER, observations).verdict == verdict


def test_at_equal_quality_the_rate_is_interpolated():
    """Half way between 0.3 and 0.5 JND: the geometric mean of 16 and 4 packets."""
    found = measure(
        AT_QUALITY,
        [
            *unit("a", "zoh", (0.05, 60.0, 0.2), (0.1, 40.0, 0.4)),
            *unit("a", "hybrid", (0.05, 30.0, 0.2), (0.1, 16.0, 0.3), (0.15, 4.0, 0.5)),
            *unit("worse", "zoh", (0.1, 40.0, 0.1)), *unit("worse", "hybrid", (0.05, 9.0, 0.2), (0.1, 8.0, 0.3)),
            *unit("better", "zoh", (0.1, 40.0, 0.9)), *unit("better", "hybrid", (0.05, 9.0, 0.2), (0.1, 8.0, 0.3)),
        ],
    )  # fmt: skip
    assert found.ratios == {"a": pytest.approx(8.0 / 40.0), "better": pytest.approx(0.2)}
    assert (found.unreached, found.clipped) == (("worse",), ("better",))
    assert (found.units, found.signals, found.as_json()["never_reach_the_quality"]) == (2, 3, 1)


def test_of_several_crossings_the_largest_weber_factor_counts():
    points = [(0.2, 10.0), (0.6, 8.0), (0.2, 6.0), (0.6, 4.0)]
    assert rate_at(points, 0.4)[0] == pytest.approx(exp((log(6) + log(4)) / 2))


@examples(50)
@given(
    st.lists(st.floats(0.01, 2.0), min_size=2, max_size=8).map(sorted),
    st.floats(0.0, 3.0),
    st.randoms(use_true_random=False),
)
def test_the_rate_lies_between_those_of_the_curve(errors, error, random):
    rates = sorted((random.uniform(1.0, 100.0) for _ in errors), reverse=True)
    rate, clipped = rate_at(list(zip(errors, rates, strict=True)), error)
    if rate is None:
        assert error < errors[0]
    else:
        assert rates[-1] <= rate * (1 + 1e-9) and rate <= rates[0] * (1 + 1e-9)
        assert clipped == (errors[-1] < error)


# --- the page

RATES = {"zoh": 40.0, "linear": 30.0, "plane": 20.0, "sphere": 44.0, "hybrid": 16.0}


def test_every_claim_stands_beside_its_measurement():
    observations = [
        Observation(unit, name, weber, RATES[name] * (0.2 / (0.1 + weber)), 5.0 * weber)
        for unit in ("a", "b")
        for name in PREDICTORS
        for weber in (0.05, 0.1, 0.2)
    ]
    text = document([PaperCondition("some", "Some signals", "Made for a test.", observations)], "machine", drawn=True)
    assert text.split("## ")[0].count("\n| ") == 1 + len(CLAIMS)
    assert "| hybrid against zoh, k = 0.10 | 42 % fewer | 60 % fewer (holds) |" in text
    assert "| sphere against zoh, k = 0.10 | 18 % fewer | 10 % more (fails) |" in text
    assert "a (+10 %), b (+10 %)" in text
    assert text.count("](some/") == 3
    assert "](force.png)" in text
    assert text.rstrip().endswith("machine")


def test_a_condition_without_signals_is_reported():
    text = document([PaperCondition("none", "Recordings", "Nobody gave any.", [])], "machine", drawn=False)
    assert "Not measured in this run" in text
    assert "| plane against zoh, k = 0.10 | 31 % fewer | - |" in text
    assert "](" not in text


# --- the command

OPERATOR = CONFIGS / "traces" / "operator.npz"
SMALL = PaperScope(scenes=(SCENES[2],), webers=(0.10,), duration_s=2.0)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The beginning of the shipped recording."""
    path = tmp_path_factory.mktemp("recorded") / OPERATOR.name
    with np.load(OPERATOR) as whole:
        np.savez(path, **{name: array[:2499] for name, array in whole.items()})
    return path


@pytest.fixture(scope="module")
def study(recorded: Path, tmp_path_factory: pytest.TempPathFactory):
    told: list[tuple[int, int, str]] = []
    found = run([recorded], plots=True, workers=1, progress=lambda *state: told.append(state), scope=SMALL)
    folder = tmp_path_factory.mktemp("paper")
    found.draw(folder)
    return found, folder, told


def test_every_claim_is_measured_under_every_condition(study):
    found, _, told = study
    assert [condition["key"] for condition in found.document["conditions"]] == ["recordings", "scenes", "systems"]
    for condition in found.document["conditions"]:
        assert len(condition["claims"]) == len(CLAIMS)
        at_weber = [claim for claim in condition["claims"] if claim["at"] == "weber"]
        assert all(claim["units"] == len(condition["signals"]) for claim in at_weber)
    works = {"simulated sessions", "explored scenes", "signals through the codec"}
    assert {what for _, _, what in told} == works
    assert told[-1][0] == told[-1][1]


def test_the_numbers_are_those_of_codec_and_whole_system(study, recorded):
    found, _, _ = study
    asked = replace(STUDY, predictors=("hybrid", "zoh"), webers=(0.10,))
    hybrid, zoh = asked.rows(NamedTrace("operator", read_trace(recorded)))
    (claim,) = [
        claim
        for claim in found.document["conditions"][0]["claims"]
        if (claim["predictor"], claim["reference"], claim["at"]) == ("hybrid", "zoh", "weber")
    ]
    assert claim["measured"] == pytest.approx(1.0 - hybrid["packets"] / zoh["packets"])
    assert claim["ratios"] == {"operator": pytest.approx(hybrid["packets"] / zoh["packets"])}
    rates = {one.predictor: one.packets_per_s for one in found.conditions[2].observations}
    assert rates["hybrid"] < 0.5 * rates["zoh"]
    assert SCENE_STUDY.position_step < STUDY.position_step


def test_the_page_shows_existing_figures_and_numbers(study):
    found, folder, _ = study
    page = (folder / PAGE).read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(([\w/]+\.png)\)", page)
    assert len(pictures) == 3 * 3 + 1
    for picture in pictures:
        assert (folder / picture).stat().st_size > 10_000
        assert (folder / picture).with_suffix(".svg").is_file()
    for condition in found.conditions:
        with (folder / condition.key / "curves.csv").open(newline="", encoding="utf-8") as file:
            assert [row["predictor"] for row in csv.DictReader(file)] == list(PREDICTORS)
    assert found.table.caption.rpartition("\n")[2] in page
    for condition in found.conditions:
        for claim in condition.results:
            for unit in claim.unreached:
                assert f"{unit} (never reaches the quality)" in page
            assert claim.signals <= len(condition.units)


def test_a_wrong_trace_is_refused_before_any_work(tmp_path: Path):
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("a,b\n1,2\n", encoding="utf-8")
    for traces, said in (([wrong], "wrong.csv: row 1: missing column"), ([OPERATOR, OPERATOR], "listed twice")):
        result = CliRunner().invoke(app, ["study", "paper", *map(str, traces)])
        assert result.exit_code == 2
        assert said in result.stderr
