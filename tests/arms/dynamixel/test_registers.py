"""Counts and units, signs, and what alarms mean."""

from itertools import pairwise
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.dynamixel import registers
from weberlink.arms.dynamixel.registers import Register

MANUAL = {
    "model_number": (0, 2, False),
    "id": (7, 1, False),
    "baud_rate": (8, 1, False),
    "return_delay_time": (9, 1, False),
    "drive_mode": (10, 1, False),
    "operating_mode": (11, 1, False),
    "homing_offset": (20, 4, True),
    "max_voltage_limit": (32, 2, False),
    "min_voltage_limit": (34, 2, False),
    "current_limit": (38, 2, False),
    "torque_enable": (64, 1, False),
    "hardware_error_status": (70, 1, False),
    "position_p_gain": (84, 2, False),
    "bus_watchdog": (98, 1, True),
    "goal_current": (102, 2, True),
    "goal_position": (116, 4, True),
    "present_current": (126, 2, True),
    "present_velocity": (128, 4, True),
    "present_position": (132, 4, True),
    "present_input_voltage": (144, 2, False),
}
"""Address, size and sign of what the driver uses, written from the manual apart from the table of the product."""


def test_registers_in_use_are_those_of_the_manual() -> None:
    table = {register.name: (register.address, register.size, register.signed) for register in registers.REGISTERS}
    assert {name: table[name] for name in MANUAL} == MANUAL
    used = {each.name for each in vars(registers).values() if isinstance(each, Register)}
    assert used <= MANUAL.keys()


def test_registers_do_not_overlap() -> None:
    for a, b in pairwise(registers.REGISTERS):
        assert a.address + a.size <= b.address


@given(st.sampled_from(registers.REGISTERS), st.data())
def test_any_value_of_a_register_comes_back(register: Register, data: st.DataObject) -> None:
    bits = 8 * register.size
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if register.signed else (0, (1 << bits) - 1)
    value = data.draw(st.integers(low, high))
    wire = register.encode(value)
    assert len(wire) == register.size
    assert register.decode(wire) == value
    for beyond in (low - 1, high + 1):
        with pytest.raises(OverflowError):
            register.encode(beyond)


def test_units() -> None:
    assert registers.angle(2048) == 0.0
    assert registers.angle(2048 + 1024) == pytest.approx(pi / 2)
    assert registers.angle(2048 - 2048) == pytest.approx(-pi)
    assert registers.RAD_S_PER_COUNT / (2 * pi / 60) == pytest.approx(0.229)
    assert registers.counts_of_current(1.0) == 372
    assert registers.counts_of_current(-3.209) == -1193


def test_alarms_are_named_by_their_bits() -> None:
    assert registers.hardware_error_text(0) == "none"
    assert "overload" in registers.hardware_error_text(0x20)
    both = registers.hardware_error_text(0x05)
    assert "voltage" in both
    assert "overheating" in both
    assert registers.hardware_error_text(0x80) == "alarm bit 7"
