"""Registers: signs, units, and the blocks that a cycle reads and writes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weberlink.arms.feetech import registers
from weberlink.arms.feetech.registers import BY_NAME, REGISTERS, Present


@given(st.sampled_from([register for register in REGISTERS if register.sign is not None]), st.data())
def test_signed_values_survive_encoding(register: registers.Register, data: st.DataObject) -> None:
    assert register.sign is not None
    most = (1 << register.sign) - 1
    value = data.draw(st.integers(-most, most))
    assert register.decode(register.encode(value)) == value


@pytest.mark.parametrize(
    ("name", "value", "wire"),
    [
        ("load", -25, "1904"),
        ("velocity", -700, "bc82"),
        ("homing_offset", -177, "b108"),
        ("goal_position", 2300, "fc08"),
    ],
)
def test_sign_is_a_bit_of_its_own(name: str, value: int, wire: str) -> None:
    assert BY_NAME[name].encode(value).hex() == wire


def test_value_beyond_its_sign_bit_raises() -> None:
    with pytest.raises(OverflowError, match="load"):
        BY_NAME["load"].encode(-1024)


def test_registers_do_not_overlap() -> None:
    used = [register.address + i for register in REGISTERS for i in range(register.size)]
    assert len(set(used)) == len(used)
    assert max(used) < registers.END


def test_one_read_gives_all_measurements() -> None:
    data = bytes.fromhex("0008 bc82 1904 4a 1e 00 00 01 0000 2c81".replace(" ", ""))
    assert len(data) == registers.PRESENT_SIZE
    assert registers.present(data) == Present(2048, -700, -25, 74, 30, 300)


def test_one_write_gives_an_order() -> None:
    assert registers.order(True, 2300, 250).hex() == "0100fc0800000000fa00"
    assert len(registers.order(False, 0, 0)) == registers.ORDER_SIZE
