"""The page says what was measured, and says so where nothing was."""

from weberlink.studies.curves import Observation
from weberlink.studies.paper.claims import CLAIMS
from weberlink.studies.paper.document import PREDICTORS, Condition, document

RATES = {"zoh": 40.0, "linear": 30.0, "plane": 20.0, "sphere": 44.0, "hybrid": 16.0}


def condition(units=("a", "b")):
    observations = [
        Observation(unit, name, weber, RATES[name] * (0.2 / (0.1 + weber)), 5.0 * weber)
        for unit in units
        for name in PREDICTORS
        for weber in (0.05, 0.1, 0.2)
    ]
    return Condition("some", "Some signals", "Made for a test.", observations)


def test_every_claim_stands_beside_its_measurement():
    text = document([condition()], "machine, commit", [])
    summary = text.split("## ")[0]
    assert summary.count("\n| ") == 1 + len(CLAIMS)
    assert "| hybrid against zoh, k = 0.10 | 42 % fewer | 60 % fewer (holds) |" in summary
    assert "| sphere against zoh, k = 0.10 | 18 % fewer | 10 % more (no saving shown) |" in summary
    assert "a (+10 %), b (+10 %)" in text
    assert "| a | 40.0 (0.50) | 30.0 (0.50) | 20.0 (0.50) | 44.0 (0.50) | 16.0 (0.50) |" in text
    assert text.count("](some/") == 3
    assert text.rstrip().endswith("machine, commit")


def test_only_moments_that_were_drawn_are_shown():
    assert "](plane.png)" in document([condition()], "machine", ["force", "plane"])
    assert "](sphere.png)" not in document([condition()], "machine", ["force", "plane"])


def test_what_was_not_measured_is_said():
    text = document([Condition("none", "Recordings", "Nobody gave any.", [])], "machine", None)
    assert "Not measured in this run" in text
    assert "| plane against zoh, k = 0.10 | 31 % fewer | - |" in text
    assert "](" not in text
