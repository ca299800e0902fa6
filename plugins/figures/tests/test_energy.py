"""Work at the port of the operator, and the bound of the energy out of the hand, on records made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from plugins.figures.tests.test_session import NONE, RATE, records, score
from tests.session.systems import ARMS, configuration
from weberlink.config import load
from weberlink.control.axes import HANDLE, LEVER
from weberlink.control.contract import AccountParameters
from weberlink.protocol.states import State
from weberlink.telemetry.reader import Records
from weberlink_figures.energy import accounts_in

OF_HAND = AccountParameters(allowance=0.02, refill=0.01, damping=1.0, rise=160.0)
TICK = 1.0 / RATE


def energy(master: Records, *accounts: AccountParameters) -> dict[str, float]:
    torque_bank = ("zoh",) if len(accounts) > 1 else None
    found: dict[str, float] = score(master, NONE, torque_bank=torque_bank, accounts=accounts)["energy"]
    return found


def pushed_out(force: float, speed: float, ticks: int = 1001) -> Records:
    """The hand is pushed out from the first tick on [N, m/s]."""
    return records(ticks, position=np.outer(speed * TICK * np.arange(ticks), (0, 0, 1)), output=(0.0, 0.0, force))


def test_every_term_is_allowed() -> None:
    """1 s at 50 mm/s with 1 N: 50 mJ come out, evenly; the share is largest at the end."""
    made = pushed_out(1.0, 0.05)
    made["credit"][200:] = 0.003
    allowed = 0.02 + 0.01 * 1.0 + 1.0 * 0.05**2 * 1.0 + 0.003 + 0.05e-3
    told = energy(made, OF_HAND)
    assert told["generated_j"] == pytest.approx(0.05)
    assert told["bound_j"] == pytest.approx(allowed)
    assert told["bound_share"] == pytest.approx(0.05 / allowed)


def test_each_session_has_an_allowance_and_a_credit_that_counts_from_zero() -> None:
    """The second one begins after 0.4 s without; a silence does not begin one."""
    made = pushed_out(1.0, 0.05)
    made["credit"][:400], made["credit"][600:] = 0.002, 0.001
    made["state"][:100] = made["state"][400:600] = State.CONNECTING.value
    made["state"][700:800] = State.SILENT.value
    made["output"][made["state"] == State.CONNECTING.value] = 0.0
    told = energy(made, OF_HAND)
    assert told["bound_j"] == pytest.approx(2 * 0.02 + 0.01 + 0.0025 + 0.001 + 0.05e-3), "the credit before was spent"


def test_force_and_torque_add() -> None:
    """1 N over 50 mm and 0.1 N m over half a radian: 50 mJ each."""
    made = pushed_out(1.0, 0.05)
    made["position"][:, 3] = 0.5 * TICK * np.arange(len(made))
    made["output"][:, 3] = 0.1
    of_handle = replace(OF_HAND, damping=OF_HAND.damping * HANDLE**2)
    told = energy(made, OF_HAND, of_handle)
    assert told["generated_j"] == pytest.approx(0.1, rel=1e-4)
    assert told["bound_j"] == pytest.approx(0.06 + 0.0025 + (HANDLE * 0.5) ** 2 + 0.1e-3, rel=1e-4)


def test_accounts_are_those_of_the_configuration() -> None:
    def of(*overrides: str, file: str = "loopback.yaml") -> tuple[AccountParameters, ...]:
        return accounts_in(configuration(*overrides, file=file).system.model_dump(mode="json"))

    assert of() == (OF_HAND,)
    assert of("control.scheme=none") == ()
    assert of("control.refill_w=0.5")[0].refill == 0.5
    assert of(file="rotation.yaml")[1].damping == pytest.approx(HANDLE**2)
    of_arms = accounts_in(load(ARMS, sides=()).system.model_dump(mode="json"))
    assert [each.damping for each in of_arms] == pytest.approx([LEVER**2])
    mapped = of("master.mapping={scale: 2, force_scale: 4}")[0]
    assert mapped == AccountParameters(allowance=0.01, refill=0.005, damping=0.125, rise=40.0)
