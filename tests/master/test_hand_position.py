"""What is sent of the hand, and which of its errors may stay unsent."""

from math import inf, nan
from types import SimpleNamespace

import pytest
from hypothesis import given, strategies as st

from tests.control.wall import Wall
from weberlink.codec import Encoder, position_channel
from weberlink.control.contract import FREE_FORCE, LEAST_CONTACT, AccountParameters, MasterControl, SchemeParameters
from weberlink.geometry.vector import ZERO, Vector, norm
from weberlink.master.devices.contract import DeviceReading
from weberlink.master.operator_port import HandPosition

COUPLING = 2500.0
SETTINGS = SchemeParameters(1e-3, COUPLING, AccountParameters(0.02, 0.01, 1.0, 0.1))
WEBER, FLOOR = 0.1, 0.02


def felt(output: Vector, decoded: Vector, asked: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(output=output, decoded=decoded, asked=asked)


def hand_of(control: MasterControl) -> HandPosition:
    return HandPosition(Encoder(position_channel()), control, WEBER, FLOOR)


forces = st.tuples(*[st.floats(-20.0, 20.0)] * 3)


@given(forces, st.one_of(st.none(), st.floats(10.0, 1e5)))
def test_an_error_stays_unsent_only_if_the_change_of_force_would(
    displayed: tuple[float, float, float], stiffness: float | None
) -> None:
    control = MasterControl(SETTINGS)
    control.reset()
    if stiffness is not None:
        control.learn(Wall(stiffness), ZERO, ZERO)
    hand = hand_of(control)
    hand.take(DeviceReading(0.0, (0.01, 0.02, 0.03)))
    hand.felt = felt(displayed, displayed)
    position, most = hand.sample(0)
    assert (hand.sampled, position) == (hand.value, ZERO)
    if norm(displayed) > LEAST_CONTACT:
        assert most * (COUPLING if stiffness is None else stiffness) == pytest.approx(
            max(WEBER * norm(displayed), FLOOR)
        )
    else:
        assert most == inf


@pytest.mark.parametrize("above", [0.0, 1e-9])
def test_the_least_contact_alone_is_none(above: float) -> None:
    """A model that is `asked` for a force counts: else the robot may stop above a surface that the hand presses on."""
    hand, least = hand_of(MasterControl(SETTINGS)), LEAST_CONTACT + above
    cases = {"displayed": (least, 1.0, 0.0), "touched": (1.0, least, 0.0), "asked": (1.0, 0.0, FREE_FORCE + above)}
    for displayed, touched, asked in cases.values():
        hand.felt = felt((displayed, 0.0, 0.0), (0.0, -touched, 0.0), asked)
        assert (hand.sample(0)[1] < inf) == (above > 0.0)


def test_a_position_that_is_not_finite_is_named() -> None:
    hand = hand_of(MasterControl(SETTINGS))
    assert hand.complaint(DeviceReading(0.0, ZERO)) is None
    assert "nan" in (hand.complaint(DeviceReading(0.0, (nan, 0.0, 0.0))) or "")
