"""The spec and the options of the robot, and its way home on an emulated arm behind a pseudo terminal, in real time.

What all robots do is in the contract, and the cycle of the bus in virtual time.
"""

from pathlib import Path
from time import monotonic
from typing import Any

import pytest
from pydantic import ValidationError

from weberlink.geometry.vector import Vector
from weberlink.testing.serving import PtyDevice
from weberlink_arms.cartesian.driver import DynamixelRobot
from weberlink_arms.cartesian.options import DynamixelOptions
from weberlink_arms.emulators.open_manipulator import DynamixelEmulator

TICK = 0.001
GOAL: Vector = (0.19, 0.02, 0.18)


def test_the_spec_states_lag_and_uncertainty() -> None:
    spec = DynamixelRobot(DynamixelOptions(torque_constant_error=0.05, bus_watchdog_ms=90.0), None, TICK).spec
    assert spec.lag_s == pytest.approx(0.004 + 0.001 + 10e-6 * (18 + 84))
    assert (spec.force_error, spec.rate_hz, spec.watchdog_s) == ((4.0, 0.05), 250.0, pytest.approx(0.1))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"baud": 57_600}, "baud: expected more: .* takes 23.2 ms, and the arm needs 200 Hz"),
        ({"stiffness_n_m": 439.0}, "stiffness_n_m: expected 438 or less"),
        ({"damping_rate_s": 14.0}, "damping_rate_s: expected 13.9 or less at 250 Hz with rotor_inertia_kg_m2 0.045"),
        ({"workspace_m": ((0.2, -0.1, 0.1), (0.1, 0.1, 0.2))}, "workspace_m: expected a lower and a higher corner"),
        ({"workspace_m": ((0.12, -0.1, 0.1), (0.4, 0.1, 0.2))}, "workspace_m: expected corners that the arm reaches"),
        ({"home_m": (0.3, 0.0, 0.1)}, "home_m: expected a point within the workspace"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(ValidationError, match=says):
        DynamixelOptions(**options)


@pytest.mark.realtime
@pytest.mark.parametrize(
    ("case", "holds"), [("home", [False] * 4), ("fails", [True, True, True, False]), ("stays", [True] * 4)]
)
def test_it_goes_home_before_it_goes_limp(tmp_path: Path, case: str, holds: list[bool]) -> None:
    """Where it does not get home, or after an emergency stop, it holds."""
    emulator = DynamixelEmulator()
    with PtyDevice(emulator, tmp_path / "arm") as wire:
        # Takes a machine which pauses for an arm which does not.
        patient = {"timeout_ms": 100.0, "bus_watchdog_ms": 2000.0, "approach_m_s": 0.5}
        options = {"port": str(wire.path), "on_close": "rest", "home_m": (0.15, 0.0, 0.2), **patient}
        robot = DynamixelRobot(DynamixelOptions.model_validate(options), None, TICK)
        robot.open(monotonic())
        if case == "fails":
            emulator.inject("overload", 4)
        elif case == "stays":
            robot.stay()
        robot.close()
        assert [servo.torque_on for servo in emulator.servos[:4]] == holds
