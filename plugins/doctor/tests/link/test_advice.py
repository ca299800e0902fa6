"""Settings that doctor --link recommends: by the limits of a session, accepted by the file, and enough."""

from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from tests.session.systems import ARMS, CONFIGS, HAS_ARMS
from weberlink.config import MASTER, load
from weberlink_doctor.link.examination import LinkFigures, Times, Way, recommend, silence_needs
from weberlink_doctor.report import Finding, Grade

LOOPBACK, DELAY, ROTATION = (CONFIGS / f"{name}.yaml" for name in ("loopback", "delay", "rotation"))


def link(
    rtt: float, jitter: float = 0.0, *, loss: float = 0.0, loop_age: float = 0.0, silences: int = 0
) -> LinkFigures:
    """Figures of a link [s]."""
    way = Way(0.5e3 * rtt, 1e3 * jitter, loss, float(loss > 0.0), int(loss > 0.0))
    return LinkFigures(
        questions=2000,
        answers=2000,
        seconds=10.0,
        rtt_ms=Times(*(1e3 * (rtt + share * jitter) for share in (0.0, 0.0, 2.0, 3.0))),
        to_slave=way,
        to_master=way,
        jitter_ms=Times(*[1e3 * jitter] * 4),
        loop_age_ms=1e3 * max(loop_age, rtt + 0.005),
        silences=silences,
    )


def found(figures: LinkFigures, file: Path = LOOPBACK, *overrides: str) -> list[Finding]:
    return list(recommend(figures, load(file, overrides, [MASTER])))


def lines(findings: list[Finding]) -> list[str]:
    """What `--set` is given in the recommended lines."""
    fixes = [each.fix for each in findings if each.fix is not None]
    return [fix.removeprefix("--set ") for fix in fixes if "--set" in fix]


NONE = "control.scheme=none"


@pytest.mark.parametrize(
    ("figures", "overrides", "check", "grade", "fix"),
    [
        (link(0.001), (NONE,), "control scheme", None, None),
        (link(0.05), (NONE,), "control scheme", None, "--set control.scheme=bounded"),
        (link(0.3), (), "control scheme", None, None),
        (link(0.398), (), "longest round trip", Grade.OK, None),
        (link(0.41), (), "longest round trip", Grade.PROBLEM, "--set link.longest_round_trip_ms=420"),
        (link(11.0), (), "longest round trip", Grade.PROBLEM, "use another network"),
        (link(0.01), (), "silence limit", Grade.OK, None),
        (link(0.01, loop_age=12.0), (), "silence limit", Grade.PROBLEM, "use another network"),
        (link(0.02, 0.005), (), "play-out", None, None),
        (link(0.02, 0.005), ("link.playout_ms=5",), "play-out", None, "--set link.playout_ms=0"),
    ],
)
def test_advice_is_by_the_limits(
    figures: LinkFigures, overrides: tuple[str, ...], check: str, grade: Grade | None, fix: str | None
) -> None:
    (finding,) = (each for each in found(figures, LOOPBACK, *overrides) if each.check == check)
    assert finding.fix == fix
    assert grade in (None, finding.grade)


@pytest.mark.parametrize(
    ("seen", "silences", "grade"), [(0.0, 0, Grade.ADVICE), (0.35, 0, Grade.PROBLEM), (0.0, 1, Grade.PROBLEM)]
)
def test_silence_limit_covers_each_need(seen: float, silences: int, grade: Grade) -> None:
    figures = link(0.1, 0.005, loss=0.5, loop_age=seen, silences=silences)
    needs = silence_needs(figures, 0.001)
    assert needs[0] > silence_needs(link(0.1, 0.005, loss=0.01), 0.001)[0]
    (finding,) = (each for each in found(figures) if each.check == "silence limit")
    limit = float((finding.fix or "").partition("=")[2])
    assert 1e3 * max(needs) - 1e-6 <= limit <= 1e3 * max(needs) + 10
    assert finding.grade is grade


def test_lookahead_is_dropped_where_nothing_controls_it() -> None:
    ahead = ("codec.force.lookahead_ms=10", "codec.position.lookahead_ms=5")
    assert lines(found(link(0.05), LOOPBACK, *ahead)) == []
    zero = ["codec.force.lookahead_ms=0", "codec.position.lookahead_ms=0"]
    assert lines(found(link(0.001), LOOPBACK, *ahead, NONE)) == zero


@settings(max_examples=25)
@given(
    rtt=st.floats(1e-4, 0.6),
    jitter=st.floats(0.0, 0.05),
    loss=st.sampled_from([0.0, 0.01, 0.2]),
    file=st.sampled_from([LOOPBACK, DELAY, ROTATION, *([ARMS] if HAS_ARMS else [])]),
)
def test_followed_advice_leaves_no_advice(rtt: float, jitter: float, loss: float, file: Path) -> None:
    figures = link(rtt, jitter, loss=loss)
    again = found(figures, file, *lines(found(figures, file)))
    assert [each for each in again if each.grade in (Grade.ADVICE, Grade.PROBLEM)] == []
