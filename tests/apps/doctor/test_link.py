"""doctor --link: known links are measured right, in virtual time, and the slave's robot stays at rest."""

from math import sqrt
from random import Random

import pytest

from tests.apps.doctor.links import MeasuredLink
from weberlink.apps.doctor.link_figures import LinkFigures, Way, figures, lost_answers, lost_questions
from weberlink.apps.doctor.link_trial import PERIOD_S
from weberlink.protocol import UpdateReceived
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.probing import Heard
from weberlink.protocol.psk import PresharedKey

TICK_S = 1e-3
CLEAR = Emulation(delay_s=0.02)
LINKS = {
    "asymmetric loss": (Emulation(delay_s=0.02, loss=0.02), Emulation(delay_s=0.02, loss=0.2, burst=4.0)),
    "jitter and bursts": (Emulation(delay_s=0.08, jitter_s=0.01, loss=0.1, burst=3.0),) * 2,
    "clear": (CLEAR, CLEAR),
}


@pytest.mark.parametrize("name", LINKS)
def test_known_link_is_measured_right(name: str) -> None:
    to_slave, to_master = LINKS[name]
    link = MeasuredLink(to_slave, to_master, seconds=6.0).run()
    found = figures(link.trial)
    least = to_slave.delay_s + to_master.delay_s
    assert found.rtt_s[0] == pytest.approx(least, abs=4 * TICK_S)
    assert found.rtt_s[1] == pytest.approx(least + 0.5 * (to_slave.jitter_s + to_master.jitter_s), abs=2 * TICK_S)
    _is_right(found.to_slave, to_slave, found.questions)
    _is_right(found.to_master, to_master, found.questions)
    assert found.silences == 0
    assert found.loop_age_s >= found.rtt_s[1]


def _is_right(way: Way, true: Emulation, sent: int) -> None:
    """Within three standard deviations of what such a channel does: losses in runs vary more by that factor."""
    spread = sqrt(2.0 * true.burst * true.loss * (1.0 - true.loss) / sent)
    assert way.loss == pytest.approx(true.loss, abs=3.0 * spread)
    assert way.delay_s == pytest.approx(true.delay_s + 0.5 * true.jitter_s, abs=2 * TICK_S)
    assert way.late_s == pytest.approx(0.98 * true.jitter_s, abs=2 * TICK_S)
    if true.loss > 0.0:
        runs = sent * true.loss / true.burst
        assert way.burst == pytest.approx(true.burst, rel=3.0 / sqrt(runs), abs=0.2)
    else:
        assert way.burst == way.longest_burst == 0


def test_measured_slave_is_never_led() -> None:
    link = MeasuredLink(CLEAR, CLEAR, seconds=1.0).run()
    assert link.measurement.failure is None
    assert not link.was_encoding
    assert link.pair.slave.of(UpdateReceived) == []


def test_outage_is_a_long_loop_age() -> None:
    cut = Emulation(delay_s=0.001, blackouts=((2.0, 0.4),))
    found = figures(MeasuredLink(cut, cut, seconds=3.0).run().trial)
    assert found.loop_age_s == pytest.approx(0.4, abs=3 * PERIOD_S)
    assert found.silences == 0


def test_outage_past_the_limit_is_silence() -> None:
    cut = Emulation(delay_s=0.001, blackouts=((2.0, 0.4),))
    assert figures(MeasuredLink(cut, cut, seconds=3.0, silence=0.2).run().trial).silences == 1


def test_new_session_begins_new_numbers() -> None:
    cut = Emulation(delay_s=0.001, blackouts=((2.0, 4.0),))
    found = figures(MeasuredLink(cut, cut, seconds=6.0, silence=0.1).run().trial)
    assert found.to_master.loss < 0.05
    assert found.loop_age_s == pytest.approx(4.0, abs=0.2)


def test_other_file_at_the_slave_is_a_refusal() -> None:
    link = MeasuredLink(CLEAR, CLEAR, slave={"agreement": {"rate_hz": 500}}).run()
    assert link.measurement.failure is not None
    assert link.measurement.failure.startswith("refused: ")


def test_other_key_at_the_slave_is_no_answer() -> None:
    link = MeasuredLink(CLEAR, CLEAR, slave={"security": PresharedKey(bytes(32))}).run()
    assert link.measurement.failure == "the slave did not answer in 5 s: is it started, with the same file and key?"


def heard(*numbers: tuple[int, int | None]) -> list[Heard]:
    """Datagrams with (number, question that it answers)."""
    return [Heard(0, sequence, 0.0, question, 0.01) for sequence, question in numbers]


def test_loss_belongs_to_the_way_where_it_was() -> None:
    # Questions 1 and 2 never arrived: the slave's numbers go on. Of 4, the answer with number 13 is missing.
    came = heard((10, 0), (11, 3), (12, None), (14, 5))
    assert lost_questions(6, came) == [2]
    assert lost_answers(came) == ([1], 5)


def test_questions_at_either_end_count_as_lost() -> None:
    assert lost_questions(5, heard((10, 2))) == [2, 2]


def test_reordered_answers_are_not_lost() -> None:
    numbers = list(range(100))
    Random(1).shuffle(numbers)
    came = heard(*((number + 10, number) for number in numbers))
    assert lost_questions(100, came) == []
    assert lost_answers(came)[0] == []


def test_nothing_answered_is_an_error() -> None:
    link = MeasuredLink(CLEAR, CLEAR)
    with pytest.raises(ValueError, match="answered no question"):
        figures(link.trial)


def test_document_has_numbers_only() -> None:
    found: LinkFigures = figures(MeasuredLink(CLEAR, CLEAR, seconds=1.0).run().trial)
    assert found.document["rtt_ms"]["p50"] == pytest.approx(41.0, abs=2.0)
    assert found.document["to_slave"]["loss"] == 0.0
