"""Settings that change during a session."""

from math import inf

import pytest
from hypothesis import given, strategies as st

from weberlink.protocol.negotiation import PACE, PACE_SHARE
from weberlink.session.tuning import BUSY, LATE, ChangeResult, LiveSettings, Tuning, change_margin

FILE = LiveSettings(0.1, "hybrid")
PERMITTED = {"weber": (), "predictor": ("zoh", "plane", "hybrid")}


class Applied:
    """A tuning and the changes that it has made, with the peer's tick of each."""

    def __init__(self, permitted: dict[str, tuple[str, ...]] = PERMITTED, *, is_master: bool = False) -> None:
        self.seen: list[LiveSettings] = []
        self.peer_ticks: list[float] = []
        self.tuning = Tuning(FILE, permitted, self.apply, is_master=is_master)

    def apply(self, settings: LiveSettings, peer_tick: float) -> None:
        self.seen.append(settings)
        self.peer_ticks.append(peer_tick)


def asked(tuning: Tuning, change: dict[str, object], tick: int = 100, refusal: str | None = None) -> None:
    body = tuning.propose(change)
    tuning.on_answer(tick, body, refusal)


def test_a_change_is_made_at_its_tick_and_not_before() -> None:
    applied = Applied()
    asked(applied.tuning, {"weber": 0.2, "predictor": "plane"})
    assert applied.tuning.result == ChangeResult(100, None)
    applied.tuning.advance(99, 1e9)
    assert (applied.seen, applied.tuning.settings, applied.tuning.generation) == ([], FILE, 0)
    applied.tuning.advance(100, None)
    assert applied.seen == [LiveSettings(0.2, "plane")] == [applied.tuning.settings]
    assert (applied.tuning.generation, applied.tuning.pending) == (1, None)
    asked(applied.tuning, {"weber": 0.3}, refusal="no")
    applied.tuning.advance(1000, 1000.0)
    assert (len(applied.seen), applied.tuning.result) == (1, ChangeResult(100, "no"))


def test_a_change_of_the_peer_is_made_at_its_tick_of_the_peer() -> None:
    applied = Applied()
    assert applied.tuning.on_proposal(500, b'{"predictor": "plane"}') is None
    applied.tuning.advance(10_000, None)
    applied.tuning.advance(10_000, 499.4)
    assert not applied.seen
    applied.tuning.advance(10_000, 499.6)  # the tick that is nearest to it
    assert applied.seen == [FILE._replace(predictor="plane")]


@pytest.mark.parametrize("late", [0, 7])
@pytest.mark.parametrize("offset", [-3000.0, 0.0, 12.4, 12.6, 1e6])
def test_each_end_knows_the_tick_at_which_the_other_makes_a_change(offset: float, late: int) -> None:
    """Clocks apart by an offset; the answer may come when the tick has passed."""
    proposer, peer = Applied(), Applied()
    tick = 5000
    body = proposer.tuning.propose({"weber": 0.2})
    assert peer.tuning.on_proposal(tick, body) is None
    made = 0
    for own in range(tick + round(offset) - 5, tick + round(offset) + 6):
        peer.tuning.advance(own, own - offset)
        made = made or (own if peer.seen else 0)
    assert peer.peer_ticks == [tick]
    proposer.tuning.on_answer(tick, body, None)
    proposer.tuning.advance(tick + late, tick + late + offset)
    assert made - 1 < proposer.peer_ticks[0] <= made
    unknown = Applied()
    asked(unknown.tuning, {"weber": 0.2}, tick)
    unknown.tuning.advance(tick, None)
    assert unknown.peer_ticks == [-inf]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({}, "nothing to change"), ({"weber": 1.0}, "weber must be"), ({"weber": -0.1}, "weber must be"),
        ({"weber": float("nan")}, "weber must be"), ({"weber": True}, "weber must be"),
        ({"weber": "0.1"}, "weber must be"),
        ({"predictor": "sphere"}, "predictor must be one of zoh, plane, hybrid, not 'sphere'"),
        ({"predictor": ["zoh"]}, "predictor must be one of"),
        ({"floor": 1}, "unknown setting floor; known are weber, predictor"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_what_could(change: dict[str, object], complaint: str) -> None:
    tuning = Applied().tuning
    assert complaint in (tuning.complaint(change) or "")
    assert tuning.complaint({"weber": 0.0}) is tuning.complaint({"predictor": "zoh"}) is None
    for name in ("weber", "predictor"):
        fixed = Applied({}).tuning.complaint({name: 0.1}) or ""
        assert fixed.startswith(f"{name} is fixed in this session: control.")


@pytest.mark.parametrize(
    "body",
    [
        b"", b"[]", b"\xff", b"1", b'{"weber": 7}', b'{"weber": NaN}', b"[" * 1200, b'{"a":' * 240,
        b'{"weber":' + b"[" * 900 + b"]" * 900 + b"}",
    ],
)  # fmt: skip
def test_nonsense_of_a_peer_is_refused(body: bytes) -> None:
    applied = Applied()
    assert applied.tuning.on_proposal(10, body) is not None
    applied.tuning.advance(1000, 1000.0)
    assert not applied.seen


def test_one_change_at_a_time_whoever_asks() -> None:
    tuning = Applied(is_master=True).tuning
    body = tuning.propose({"weber": 0.2})
    assert tuning.complaint({"weber": 0.3}) == BUSY == tuning.on_proposal(50, b'{"weber": 0.3}')
    tuning.on_answer(100, body, None)
    assert tuning.complaint({"weber": 0.3}) == BUSY, "agreed, and still to come"
    tuning.advance(100, None)
    assert tuning.complaint({"weber": 0.3}) is None


def test_a_new_session_begins_with_the_settings_of_the_file() -> None:
    applied = Applied()
    asked(applied.tuning, {"weber": 0.2})
    applied.tuning.advance(100, None)
    asked(applied.tuning, {"weber": 0.3}, tick=200)
    applied.tuning.reset()
    applied.tuning.advance(10_000, 10_000.0)
    assert applied.seen == [FILE._replace(weber=0.2), FILE]
    assert (applied.tuning.settings, applied.tuning.generation, applied.tuning.pending) == (FILE, 0, None)
    assert applied.tuning.result == ChangeResult(0, "the session ended")


@pytest.mark.parametrize(("answered_at", "refusal"), [(99.9, None), (100.0, None), (100.1, LATE), (inf, LATE)])
def test_a_proposal_whose_answer_cannot_be_there_in_time_is_refused(answered_at: float, refusal: str | None) -> None:
    assert Applied().tuning.on_proposal(100, b'{"weber":0.2}', answered_at) == refusal


@pytest.mark.parametrize("first", ["proposal", "answer"])
def test_of_two_that_cross_the_one_of_the_master_is_made(first: str) -> None:
    master, slave = Applied(is_master=True), Applied()
    own, other = master.tuning.propose({"predictor": "zoh"}), slave.tuning.propose({"weber": 0.2})
    assert master.tuning.on_proposal(300, other, 0.0) == BUSY
    if first == "answer":
        slave.tuning.on_answer(300, other, BUSY)
    assert slave.tuning.on_proposal(100, own, 0.0) is None
    if first == "proposal":
        slave.tuning.on_answer(300, other, BUSY)
    master.tuning.on_answer(100, own, None)
    master.tuning.advance(100, None)
    slave.tuning.advance(50, 100.0)
    assert master.seen == slave.seen == [FILE._replace(predictor="zoh")]
    assert slave.tuning.result == ChangeResult(300, BUSY)
    assert slave.tuning.complaint({"weber": 0.2}) is None


def test_a_change_whose_answer_was_late_is_made_beside_the_next_one_of_the_peer() -> None:
    """The master has made the slave's change and goes on to its own; the slave hears of both at once."""
    slave = Applied()
    own = slave.tuning.propose({"weber": 0.2})
    assert slave.tuning.on_proposal(400, b'{"predictor":"zoh"}', 0.0) is None
    slave.tuning.on_answer(90, own, None)
    slave.tuning.advance(100, 300.0)
    assert slave.seen == [FILE._replace(weber=0.2)]
    slave.tuning.advance(200, 400.0)
    assert slave.seen[1:] == [FILE._replace(weber=0.2, predictor="zoh")]


@given(rtt=st.floats(0.0, 3.0), jitter=st.floats(0.0, 0.1))
def test_the_margin_leaves_time_for_five_exchanges(rtt: float, jitter: float) -> None:
    repeat = max(PACE, PACE_SHARE * (rtt + jitter))
    assert change_margin(rtt, jitter) - (rtt + jitter) >= 4.0 * repeat
    assert change_margin(rtt, jitter) == pytest.approx(0.01 + 1.5 * rtt + 2.0 * jitter)
    assert change_margin(None, jitter) == change_margin(0.1, jitter)
