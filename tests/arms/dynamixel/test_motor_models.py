"""The models of motors: figures of the data sheets, torque and current, and their registers."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.dynamixel.motor_models import (
    MODELS,
    XL330_M077,
    XL330_M288,
    XL430_W250,
    XM430_W350,
    CurrentLaw,
    MotorModel,
)
from weberlink.arms.dynamixel.registers import BY_NAME

EVERY = pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
MANUAL = {
    1190: {38: 1750, 44: 1620, 63: 53, 84: 400, 32: 70, 34: 35, 31: 70},
    1200: {38: 1750, 44: 445, 63: 53, 84: 400, 32: 70, 34: 35, 31: 70},
    1060: {44: 265, 63: 52, 84: 640, 80: 4000, 32: 140, 34: 60, 31: 72},
    1020: {38: 1193, 44: 350, 63: 52, 84: 800, 32: 160, 34: 95, 31: 80},
}
"""Values as delivered by address, written from the manuals apart from the tables of the product."""


@EVERY
def test_registers_as_delivered_are_those_of_manual(model: MotorModel) -> None:
    delivered = {each.address: each.initial for each in model.registers}
    assert delivered[0] == model.number
    assert {address: delivered[address] for address in MANUAL[model.number]} == MANUAL[model.number]
    assert {each.name for each in model.registers} <= BY_NAME.keys()
    for each in model.registers:
        assert (each.address, each.size, each.signed) == (*BY_NAME[each.name][:2], BY_NAME[each.name].signed)
        assert each.low <= each.initial <= each.high


def test_xl430_has_no_registers_of_current() -> None:
    assert not {38, 102} & {each.address for each in XL430_W250.registers}
    assert 0 not in XL430_W250.modes
    assert 5 not in XL430_W250.modes
    assert not XL430_W250.controls_current


@EVERY
@given(share=st.floats(-1.0, 1.0))
def test_torque_and_current_are_inverse(model: MotorModel, share: float) -> None:
    torque = share * model.stall_n_m
    for law in CurrentLaw if model.controls_current else (CurrentLaw.LOAD,):
        counts = model.counts(torque, law)
        step = max(
            abs(model.torque(counts + 1, law) - model.torque(counts, law)),
            abs(model.torque(counts, law) - model.torque(counts - 1, law)),
        )
        assert abs(model.torque(counts, law) - torque) <= step


@pytest.mark.parametrize("law", [CurrentLaw.MOTOR, CurrentLaw.SUPPLY])
@pytest.mark.parametrize("model", [XL330_M077, XL330_M288, XM430_W350], ids=lambda model: model.name)
def test_stall_current_gives_stall_torque_by_any_law(model: MotorModel, law: CurrentLaw) -> None:
    assert model.torque(round(model.stall_a / model.a_per_count), law) == pytest.approx(model.stall_n_m, rel=1e-3)
    assert model.torque(-round(model.stall_a / model.a_per_count), law) == pytest.approx(-model.stall_n_m, rel=1e-3)


def test_supply_law_follows_power_of_resistance() -> None:
    """U I = R i^2 at rest, with R = U / I_stall."""
    motor = XL330_M288.motor_current(100, CurrentLaw.SUPPLY)
    resistance = XL330_M288.volts / XL330_M288.stall_a
    assert XL330_M288.volts * 0.1 == pytest.approx(resistance * motor**2)


def test_published_torque_constants_lie_within_stated_error() -> None:
    for model, published in ((XL330_M288, (0.354, 0.370, 0.381, 0.463)), (XL330_M077, (0.099, 0.125, 0.146))):
        for each in published:
            assert abs(each - model.constant) <= model.constant_error * model.constant * 1.01


def test_stiffness_of_position_control_by_hand() -> None:
    # 400 / 256 counts of duty per count of error, 885 are the full duty.
    assert XL330_M288.stiffness(None) == pytest.approx(400 / 256 / 885 * 4096 / (2 * pi) * 0.52)
    assert XL430_W250.stiffness(1280) == pytest.approx(2 * XL430_W250.stiffness(None))
