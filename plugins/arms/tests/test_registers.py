"""Registers of both kinds of servos, and models of motors: addresses, signs and units, against the manuals."""

from math import pi

import pytest
from hypothesis import given, strategies as st

from weberlink_arms.dynamixel import motor_models, registers as dynamixel
from weberlink_arms.dynamixel.motor_models import MODELS, XL330_M077, XL330_M288, XL430_W250, CurrentLaw, MotorModel
from weberlink_arms.feetech import registers as feetech
from weberlink_arms.feetech.registers import BY_NAME, Present

USED = {
    "model_number": (0, 2, False), "id": (7, 1, False), "baud_rate": (8, 1, False),
    "return_delay_time": (9, 1, False), "drive_mode": (10, 1, False), "operating_mode": (11, 1, False),
    "homing_offset": (20, 4, True), "max_voltage_limit": (32, 2, False), "min_voltage_limit": (34, 2, False),
    "current_limit": (38, 2, False), "torque_enable": (64, 1, False), "hardware_error_status": (70, 1, False),
    "position_p_gain": (84, 2, False), "bus_watchdog": (98, 1, True), "goal_current": (102, 2, True),
    "goal_position": (116, 4, True), "present_current": (126, 2, True), "present_velocity": (128, 4, True),
    "present_position": (132, 4, True), "present_input_voltage": (144, 2, False),
}  # fmt: skip
"""Address, size and sign of what the Dynamixel drivers use, from the manual apart from the table of the product."""
every_model = pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)


def test_registers_in_use_are_those_of_the_manual() -> None:
    table = {each.name: (each.address, each.size, each.signed) for each in dynamixel.REGISTERS}
    assert {name: table[name] for name in USED} == USED
    assert {each.name for each in vars(dynamixel).values() if isinstance(each, dynamixel.Register)} <= USED.keys()


@pytest.mark.parametrize(
    ("name", "value", "wire"),
    [
        ("load", -25, "1904"),
        ("velocity", -700, "bc82"),
        ("homing_offset", -177, "b108"),
        ("goal_position", 2300, "fc08"),
    ],
)
def test_sign_of_a_feetech_servo_is_a_bit_of_its_own(name: str, value: int, wire: str) -> None:
    assert BY_NAME[name].encode(value).hex() == wire


def test_one_read_gives_all_measurements_and_one_write_an_order() -> None:
    data = bytes.fromhex("0008bc8219044a1e000001 00002c81")
    assert len(data) == feetech.PRESENT_SIZE
    assert feetech.present(data) == Present(2048, -700, -25, 74, 30, 300)
    assert feetech.order(True, 2300, 250).hex() == "0100fc0800000000fa00"
    assert len(feetech.order(False, 0, 0)) == feetech.ORDER_SIZE


@every_model
@given(share=st.floats(-1.0, 1.0))
def test_torque_and_current_are_inverse(model: MotorModel, share: float) -> None:
    torque = share * model.stall_n_m
    for law in CurrentLaw if model.controls_current else (CurrentLaw.LOAD,):
        counts = model.counts(torque, law)
        near = [model.torque(counts + way, law) for way in (-1, 0, 1)]
        assert abs(near[1] - torque) <= max(abs(near[2] - near[1]), abs(near[1] - near[0]))


def test_figures_by_hand() -> None:
    # U I = R i^2 at rest, with R = U / I_stall.
    current = XL330_M288.motor_current(100, CurrentLaw.SUPPLY)
    assert XL330_M288.volts * 0.1 == pytest.approx(XL330_M288.volts / XL330_M288.stall_a * current**2)
    # 400 / 256 counts of duty per count of error, 885 are the full duty.
    assert XL330_M288.stiffness(None) == pytest.approx(400 / 256 / 885 * 4096 / (2 * pi) * 0.52)
    assert XL430_W250.stiffness(1280) == pytest.approx(2 * XL430_W250.stiffness(None))
    assert pytest.approx(2.0 * pi / 60.0) == motor_models.RPM
    published = ((XL330_M288, (0.354, 0.370, 0.381, 0.463)), (XL330_M077, (0.099, 0.125, 0.146)))
    for model, constants in published:
        assert all(abs(each - model.constant) <= model.constant_error * model.constant * 1.01 for each in constants)
