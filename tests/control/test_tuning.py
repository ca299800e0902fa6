"""Settings that change during a session."""

import pytest

from weberlink.control.tuning import BUSY, ChangeResult, LiveSettings, Tuning

FILE = LiveSettings(0.1, "hybrid", "auto")
PERMITTED = {"weber": (), "predictor": ("zoh", "plane", "hybrid"), "scheme": ("none", "tdpa")}


class Applied:
    def __init__(self, permitted: dict[str, tuple[str, ...]] | None = None) -> None:
        self.seen: list[LiveSettings] = []
        self.tuning = Tuning(FILE, PERMITTED if permitted is None else permitted, self.seen.append)


def asked(tuning: Tuning, change: dict[str, object], tick: int = 100, refusal: str | None = None) -> None:
    body = tuning.ask(change)
    tuning.settle(tick, body, refusal)


def test_a_change_is_made_at_its_tick_and_not_before() -> None:
    applied = Applied()
    asked(applied.tuning, {"weber": 0.2, "predictor": "plane"})
    assert applied.tuning.result == ChangeResult(100, None)
    applied.tuning.advance(99, 1e9)
    assert (applied.seen, applied.tuning.settings, applied.tuning.generation) == ([], FILE, 0)
    applied.tuning.advance(100, None)
    assert applied.seen == [LiveSettings(0.2, "plane", "auto")] == [applied.tuning.settings]
    assert (applied.tuning.generation, applied.tuning.pending) == (1, None)


def test_a_change_of_the_peer_is_made_at_its_tick_of_the_peer() -> None:
    applied = Applied()
    assert applied.tuning.hear(500, b'{"scheme": "tdpa"}') is None
    applied.tuning.advance(10_000, None)
    applied.tuning.advance(10_000, 499.9)
    assert not applied.seen
    applied.tuning.advance(10_000, 500.2)
    assert applied.seen == [FILE._replace(scheme="tdpa")]


def test_a_refusal_changes_nothing_and_is_the_verdict() -> None:
    applied = Applied()
    asked(applied.tuning, {"weber": 0.2}, refusal="no")
    applied.tuning.advance(1000, 1000.0)
    assert (applied.seen, applied.tuning.result) == ([], ChangeResult(100, "no"))


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({}, "nothing to change"),
        ({"weber": 1.5}, "weber must be a number from 0 to 1, not 1.5"),
        ({"weber": -0.1}, "weber must be"),
        ({"weber": float("nan")}, "weber must be"),
        ({"weber": True}, "weber must be"),
        ({"weber": "0.1"}, "weber must be"),
        ({"predictor": "sphere"}, "predictor must be one of zoh, plane, hybrid, not 'sphere'"),
        ({"predictor": ["zoh"]}, "predictor must be one of"),
        ({"scheme": "mmt"}, "scheme must be one of none, tdpa"),
        ({"floor": 1}, "unknown setting floor; known are weber, predictor, scheme"),
    ],
)
def test_what_cannot_be_is_refused_with_what_could(change: dict[str, object], complaint: str) -> None:
    assert complaint in (Applied().tuning.complaint(change) or "")


@pytest.mark.parametrize("name", ["weber", "predictor", "scheme"])
def test_what_is_fixed_says_by_what(name: str) -> None:
    complaint = Applied({}).tuning.complaint({name: 0.1})
    assert complaint is not None
    assert complaint.startswith(f"{name} is fixed in this session: control.")


@pytest.mark.parametrize("body", [b"", b"[]", b"\xff", b"1", b'{"weber": 7}', b'{"weber": NaN}'])
def test_nonsense_of_a_peer_is_refused(body: bytes) -> None:
    applied = Applied()
    assert applied.tuning.hear(10, body) is not None
    applied.tuning.advance(1000, 1000.0)
    assert not applied.seen


def test_one_change_at_a_time_whoever_asks() -> None:
    tuning = Applied().tuning
    body = tuning.ask({"weber": 0.2})
    assert tuning.complaint({"weber": 0.3}) == BUSY == tuning.hear(50, b'{"weber": 0.3}')
    tuning.settle(100, body, None)
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


@pytest.mark.parametrize("body", [b"[" * 1200, b'{"a":' * 240, b'{"weber":' + b"[" * 900 + b"]" * 900 + b"}", b"\xff"])
def test_no_content_of_a_proposal_raises(body: bytes) -> None:
    applied = Applied()
    assert applied.tuning.hear(500, body) == "not a change"
    applied.tuning.settle(500, body, None)
    assert applied.tuning.pending is None
