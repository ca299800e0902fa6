"""Settings that doctor --link recommends: by the limits of a session, accepted by the file, and enough."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.system.systems import CONFIGS
from weberlink.apps.doctor.link_advice import recommend, silence_needs
from weberlink.apps.doctor.link_figures import LinkFigures, Way
from weberlink.apps.doctor.report import Finding, Grade
from weberlink.system.configuration import MASTER, Configuration, load

LOOPBACK, DELAY, ROTATION, ARMS = (CONFIGS / f"{name}.yaml" for name in ("loopback", "delay", "rotation", "arms"))
FIXES = {Grade.ADVICE, Grade.PROBLEM}


def link(
    rtt: float, jitter: float = 0.0, *, loss: float = 0.0, late: float | None = None, loop_age: float = 0.0
) -> LinkFigures:
    """Figures of a link [s]."""
    way = Way(0.5 * rtt, jitter if late is None else late, loss, float(loss > 0.0), int(loss > 0.0))
    return LinkFigures(
        questions=2000,
        answers=2000,
        seconds=10.0,
        rtt_s=(rtt, rtt, rtt + 2.0 * jitter, rtt + 3.0 * jitter),
        to_slave=way,
        to_master=way,
        jitter_s=(jitter, jitter),
        loop_age_s=max(loop_age, rtt + 0.005),
        silences=0,
    )


def found(figures: LinkFigures, file: Path = LOOPBACK, *overrides: str) -> dict[str, Finding]:
    return {each.check: each for each in recommend(figures, configuration(file, *overrides))}


def configuration(file: Path, *overrides: str) -> Configuration:
    return load(file, overrides, [MASTER])


def lines(findings: Sequence[Finding]) -> list[str]:
    """What `--set` is given in the recommended lines."""
    return [each.fix.removeprefix("--set ") for each in findings if each.fix is not None and "--set" in each.fix]


@pytest.mark.parametrize("file", [LOOPBACK, ROTATION, ARMS])
def test_none_is_left_where_it_does_not_bear_the_round_trip(file: Path) -> None:
    bounded = "--set control.scheme=bounded"
    assert found(link(0.001), file, "control.scheme=none")["control scheme"].fix is None
    assert found(link(0.05), file, "control.scheme=none")["control scheme"].fix == bounded
    assert found(link(0.3), file)["control scheme"].fix is None


@pytest.mark.parametrize("seen", [0.0, 0.35])
def test_silence_limit_covers_each_need(seen: float) -> None:
    figures = link(0.1, 0.005, loss=0.5, loop_age=seen)
    needs = silence_needs(figures, 0.001)
    assert needs[0] > silence_needs(link(0.1, 0.005, loss=0.01), 0.001)[0]
    (line,) = [line for line in lines(list(found(figures).values())) if "silence" in line]
    limit = float(line.partition("=")[2])
    assert 1e3 * max(needs) <= limit <= 1e3 * max(needs) + 10


@pytest.mark.parametrize(("rtt", "grade"), [(0.001, Grade.OK), (0.398, Grade.OK), (0.41, Grade.PROBLEM)])
def test_longest_round_trip_covers_the_measured_one(rtt: float, grade: Grade) -> None:
    finding = found(link(rtt))["longest round trip"]
    assert finding.grade is grade
    if grade is Grade.PROBLEM:
        assert finding.fix == "--set link.longest_round_trip_ms=420"


def test_measured_gap_beyond_the_limit_is_a_problem() -> None:
    assert found(link(0.01, loop_age=0.15))["silence limit"].grade is Grade.PROBLEM
    assert found(link(0.01, loss=0.5))["silence limit"].grade is Grade.ADVICE
    assert found(link(0.01))["silence limit"].grade is Grade.OK


def test_playout_is_advised_against() -> None:
    assert found(link(0.02, 0.005))["play-out"].fix is None
    assert found(link(0.02, 0.005), LOOPBACK, "link.playout_ms=5")["play-out"].fix == "--set link.playout_ms=0"


def test_lookahead_is_dropped_where_nothing_controls_it() -> None:
    used = ("codec.force.lookahead_ms=10", "codec.position.lookahead_ms=5")
    assert lines(list(found(link(0.05), LOOPBACK, *used).values())) == []
    near = recommend(link(0.001), configuration(LOOPBACK, *used, "control.scheme=none"))
    assert lines(list(near)) == ["codec.force.lookahead_ms=0", "codec.position.lookahead_ms=0"]


@settings(max_examples=25)
@given(
    rtt=st.floats(1e-4, 0.6),
    jitter=st.floats(0.0, 0.05),
    loss=st.sampled_from([0.0, 0.01, 0.2]),
    file=st.sampled_from([LOOPBACK, DELAY, ROTATION, ARMS]),
)
def test_followed_advice_leaves_no_advice(rtt: float, jitter: float, loss: float, file: Path) -> None:
    figures = link(rtt, jitter, loss=loss)
    first = list(recommend(figures, configuration(file)))
    again = list(recommend(figures, configuration(file, *lines(first))))
    assert [each for each in again if each.grade in FIXES] == []


def test_link_too_bad_for_any_limit_is_said() -> None:
    finding = found(link(11.0))["longest round trip"]
    assert finding.grade is Grade.PROBLEM
    assert finding.fix == "use another network"
    finding = found(link(0.01, loop_age=12.0))["silence limit"]
    assert finding.grade is Grade.PROBLEM
    assert finding.fix == "use another network"
