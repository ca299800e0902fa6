"""Parts off: the same sender but for the part."""

import pytest

from weberlink.codec import Encoder
from weberlink.codec.predictors import ADAPTIVE_BANK
from weberlink.studies.adaptive.coding import coded
from weberlink.studies.adaptive.variants import ABLATIONS, TUNINGS, Part, altered, channel_of
from weberlink.studies.evaluate.replay import Signal
from weberlink.studies.evaluate.scenes import scene_signal


@pytest.fixture(scope="module")
def moved() -> Signal:
    """In contact with a plane that heaves, from where the hand has found it."""
    whole = scene_signal("plane_moving", 2, 2.0, 2e-3)
    return Signal(whole.force_n[600:], whole.position_m[600:], whole.period_s)


def updates(signal: Signal, encoder: Encoder) -> list[object]:
    return [encoder.encode(tick, force, position) for tick, (force, position) in enumerate(signal.samples)]


def test_with_nothing_off_it_is_the_live_sender(moved: Signal) -> None:
    live = updates(moved, Encoder(channel_of("adaptive")))
    assert updates(moved, altered(Part())) == live
    assert any(live)


@pytest.mark.parametrize("name", [*ABLATIONS, *TUNINGS])
def test_each_part_can_be_off_and_the_law_holds(moved: Signal, name: str) -> None:
    part = (ABLATIONS | TUNINGS)[name]
    found = coded(Signal(moved.force_n[:400], moved.position_m[:400], 1e-3), altered(part))
    assert found.packets > 0
    assert found.outside == 0


@pytest.mark.parametrize("name", ADAPTIVE_BANK)
def test_every_member_of_the_bank_is_off_in_turn(name: str) -> None:
    assert set(ABLATIONS[f"no {name}"].bank) == set(ADAPTIVE_BANK) - {name}


def test_without_curvature_a_ball_is_coded_otherwise() -> None:
    ball = scene_signal("sphere_friction", 1, 2.0, 2e-3)
    ball = Signal(ball.force_n[600:], ball.position_m[600:], ball.period_s)
    assert updates(ball, altered(ABLATIONS["no curvature"])) != updates(ball, altered(Part()))


def test_what_is_off_makes_a_difference(moved: Signal) -> None:
    live = updates(moved, Encoder(channel_of("adaptive")))
    for name in ("no surface", "no motion"):
        assert updates(moved, altered(ABLATIONS[name])) != live
