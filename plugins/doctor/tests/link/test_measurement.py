"""doctor --link: known links are measured right, in virtual time, the slave's robot stays at rest, and the report."""

import json
from dataclasses import asdict, replace
from math import sqrt
from random import Random

import pytest

from tests.protocol.harness import KEY, MASTER, SLAVE, Pair, Side, local_end
from tests.session.systems import CONFIGS
from weberlink.config import MASTER as LEADS, load
from weberlink.config.loading import Part
from weberlink.protocol import Endpoint, UpdateReceived
from weberlink.protocol.emulation import Emulation
from weberlink.protocol.paths import LinkPath
from weberlink.protocol.psk import PresharedKey
from weberlink_doctor.link.examination import Way, WayOut, figures, judge, lost_answers, lost_questions
from weberlink_doctor.link.trial import PERIOD_S, Heard, LinkTrial, Measurement, received
from weberlink_doctor.report import DoctorReport, Grade, problem

LOOPBACK = CONFIGS / "loopback.yaml"
TICK_MS = 1.0
CLEAR = Emulation(delay_s=0.02)


class _Master(Side):
    """The side that measures, which takes its events itself."""

    def collect(self, world: float) -> None:
        pass


class MeasuredLink:
    """The endpoint of a real slave behind known faults, and its measurement by the endpoint of the doctor.

    Attributes:
        was_encoding: whether the slave ever took this master for one that leads.
    """

    def __init__(
        self, to_slave: Emulation, to_master: Emulation, *, seconds: float = 10.0, silence: float = 1.0, **slave: object
    ) -> None:
        self.pair = Pair(
            link=to_slave,
            backward=to_master,
            seed=1,
            slave={"silence": silence, "security": PresharedKey(KEY), **slave},
            offsets=(0.0, 300.0),
            on_tick=self._on_tick,
            every=5,
        )
        own = local_end(security=PresharedKey(KEY), entropy=Random("doctor").randbytes, silence=silence)
        endpoint = Endpoint(own, peer=SLAVE)
        self.pair.master = _Master(endpoint, MASTER)
        self.pair.slave.endpoint.connect(self.pair.slave.local(0.0))
        self.measurement = Measurement(endpoint, 0.0, seconds)
        self._due, self.was_encoding = 0.0, False
        while not self.measurement.is_done:
            self.pair.run(0.1)
        self.pair.run(0.5)

    def _on_tick(self, pair: Pair, now: float, _tick: int) -> None:
        if now >= self._due:
            self._due = self.measurement.service(now)
        self.was_encoding |= pair.slave.endpoint.may_follow(pair.slave.local(now))


@pytest.mark.parametrize(
    ("to_slave", "to_master"),
    [
        (Emulation(delay_s=0.02, loss=0.02), Emulation(delay_s=0.02, loss=0.2, burst=4.0)),
        (Emulation(delay_s=0.08, jitter_s=0.01, loss=0.1, burst=3.0),) * 2,
        (CLEAR, CLEAR),
    ],
)
def test_known_link_is_measured_right_and_nobody_is_led(to_slave: Emulation, to_master: Emulation) -> None:
    link = MeasuredLink(to_slave, to_master, seconds=6.0)
    found = figures(link.measurement.result())
    least = to_slave.delay_s + to_master.delay_s
    usual = least + 0.5 * (to_slave.jitter_s + to_master.jitter_s)
    assert found.rtt_ms.min == pytest.approx(1e3 * least, abs=4 * TICK_MS)
    assert found.rtt_ms.p50 == pytest.approx(1e3 * usual, abs=2 * TICK_MS)
    _is_right(found.to_slave, to_slave, found.questions)
    _is_right(found.to_master, to_master, found.questions)
    assert (found.silences, found.loop_age_ms >= found.rtt_ms.p50) == (0, True)
    assert (link.measurement.failure, link.was_encoding, link.pair.slave.of(UpdateReceived)) == (None, False, [])


def _is_right(way: Way, true: Emulation, sent: int) -> None:
    """Within three standard deviations of what such a channel does: losses in runs vary more by that factor."""
    spread = sqrt(2.0 * true.burst * true.loss * (1.0 - true.loss) / sent)
    assert way.loss == pytest.approx(true.loss, abs=3.0 * spread)
    assert way.delay_ms == pytest.approx(1e3 * (true.delay_s + 0.5 * true.jitter_s), abs=2 * TICK_MS)
    assert way.late_p99_ms == pytest.approx(1e3 * 0.98 * true.jitter_s, abs=2 * TICK_MS)
    if true.loss > 0.0:
        runs = sent * true.loss / true.burst
        assert way.burst == pytest.approx(true.burst, rel=3.0 / sqrt(runs), abs=0.2)
    else:
        assert way.burst == way.longest_burst == 0


@pytest.mark.parametrize(
    ("cut_s", "silence", "silences"),
    [(0.4, 1.0, 0), (0.4, 0.2, 1), (4.0, 0.1, 1)],
    ids=["within the limit", "past it", "of a new session"],
)
def test_outage_is_a_long_loop_age_and_past_the_limit_silence(cut_s: float, silence: float, silences: int) -> None:
    cut = Emulation(delay_s=0.001, blackouts=((2.0, cut_s),))
    found = figures(MeasuredLink(cut, cut, seconds=2.5 + cut_s, silence=silence).measurement.result())
    assert 1e-3 * found.loop_age_ms == pytest.approx(cut_s, abs=max(3 * PERIOD_S, 0.05 * cut_s))
    assert found.silences == silences
    if cut_s > 1.0:
        assert found.to_master.loss < 0.05, "a new session begins new numbers"


@pytest.mark.parametrize(
    ("slave", "failure"),
    [
        ({"agreement": {"rate_hz": 500}}, "refused: "),
        ({"security": PresharedKey(bytes(32))}, "the slave did not answer in 5 s: is it started"),
    ],
    ids=["another file", "another key"],
)
def test_other_slave_is_a_failure(slave: dict[str, object], failure: str) -> None:
    link = MeasuredLink(CLEAR, CLEAR, **slave)
    assert (link.measurement.failure or "").startswith(failure)


def heard(*numbers: tuple[int, int | None]) -> list[Heard]:
    """Datagrams with (number, question that it answers)."""
    return [Heard(0, sequence, 0.0, question, 0.01) for sequence, question in numbers]


@pytest.mark.parametrize(
    ("sent", "came", "questions", "answers"),
    [
        # Questions 1 and 2 never arrived: the slave's numbers go on. Of 4, the answer with number 13 is missing.
        (6, heard((10, 0), (11, 3), (12, None), (14, 5)), [2], ([1], 5)),
        (5, heard((10, 2)), [2, 2], ([], 1)),  # those at either end count as lost
        (4, heard((12, 2), (10, 0), (13, 3), (11, 1)), [], ([], 4)),  # another order loses nothing
    ],
)
def test_loss_belongs_to_the_way_where_it_was(
    sent: int, came: list[Heard], questions: list[int], answers: tuple[list[int], int]
) -> None:
    assert (lost_questions(sent, came), lost_answers(came)) == (questions, answers)


# --- the report

NONE: WayOut = ({}, [])
BLOCKED: WayOut = ({"nat": "blocked"}, [problem("UDP is blocked", "another network", "udp")])


class Finder:
    """Finds paths."""

    finds_path = staticmethod(lambda _: True)


def report(trial: LinkTrial, way_out: WayOut, *overrides: str, finder: type | None = None) -> DoctorReport:
    configuration = load(LOOPBACK, overrides, [LEADS])
    return judge(replace(configuration, finder=finder and Part(finder, load(LOOPBACK).system)), way_out, trial)


def test_report_advises_settings_and_its_document_is_json() -> None:
    faults = Emulation(delay_s=0.02, jitter_s=0.005, loss=0.45, burst=3.0)
    path = LinkPath(route="relayed", via="lab", interface="wifi", remote="a:1", dscp=0)
    result = MeasuredLink(faults, faults, seconds=2.0).measurement.result((path,), "in real time: yes")
    trial = received(**json.loads(json.dumps(asdict(result))))  # as it comes from its process
    found = report(trial, NONE, "control.scheme=none", "link.playout_ms=5")
    fixes = [each.fix or "" for each in found.findings]
    assert {"--set control.scheme=bounded", "--set link.playout_ms=0"} <= set(fixes)
    assert any(fix.startswith("--set link.silence_ms=") for fix in fixes)
    document = json.loads(json.dumps(report(trial, BLOCKED, finder=Finder).document, allow_nan=False))
    assert document["nat"] == "blocked"
    assert document["link"]["rtt_ms"]["min"] == pytest.approx(41.0, abs=4.0)
    assert document["paths"][0]["route"] == "relayed"


@pytest.mark.parametrize(
    ("failure", "way_out", "finder"),
    [
        ("no path to robot: UDP is blocked", NONE, Finder),
        (None, NONE, None),
        ("no path to robot: UDP is blocked between here and relay.example:3478", BLOCKED, Finder),  # said once
    ],
)
def test_failed_measurement_is_one_problem(failure: str | None, way_out: WayOut, finder: type | None) -> None:
    found = report(LinkTrial(failure=failure), way_out, finder=finder)
    assert (found.count(Grade.PROBLEM), found.document["link"]) == (1, None)
    assert failure is None or found.document["failure"] == failure
