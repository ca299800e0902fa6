"""The real driver in a process of its own, in contact, that is stopped or killed: what the motors do then, and when.

The default bus watchdog is in force. A machine that stalls for longer than that before the test does anything ends an
attempt; another one is made then.
"""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

import pytest

from tests.program import ROOT
from tests.slave.robots.dynamixel.pressing import GROUND_M
from tests.wait import PATIENCE, until
from weberlink.arms.dynamixel import registers
from weberlink.hardware.emulator import PtyDevice
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink.slave.robots.dynamixel import options

pytestmark = pytest.mark.realtime(alone=True)

WITHIN_S = 0.1
WATCHDOG_S = 1e-3 * options.DynamixelOptions().bus_watchdog_ms
ATTEMPTS = 5
PRESSED_N = 2.0
MOST_A = 1e-3 * options.DynamixelOptions().max_current_ma


class Pressing:
    """A process that drives an emulated arm into the ground."""

    def __init__(self, process: subprocess.Popen[str], emulator: DynamixelEmulator) -> None:
        self.process = process
        self.emulator = emulator
        self.motors = emulator.servos[:4]

    def currents(self) -> float:
        """Largest of the four joints [A]."""
        return max(map(abs, self.emulator.currents[:4]))

    def send(self, number: int) -> float:
        """Gives how long after the signal the motors were without current, by the emulator's own time [s]."""
        at = monotonic()
        self.process.send_signal(number)
        until(lambda: self.currents() == 0.0, "the motors to let go")
        assert self.emulator.watchdog_trips == 4
        tripped = max(motor.heard_at for motor in self.motors) + WATCHDOG_S
        return tripped - at


@contextmanager
def pressing(folder: Path) -> Iterator[Pressing]:
    ground = {"shape": "plane", "point_m": [0.0, 0.0, GROUND_M], "stiffness_n_m": 1000.0}
    for attempt in range(ATTEMPTS):
        emulator = DynamixelEmulator(DynamixelEmulatorOptions.model_validate({"scene": [ground]}))
        with PtyDevice(emulator, folder / f"arm{attempt}") as wire:
            command = [sys.executable, "-m", "tests.slave.robots.dynamixel.pressing", str(wire.path)]
            process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
            try:
                state = Pressing(process, emulator)
                until(pressed_or_ended(state), "the arm to press")
                if process.poll() is None:
                    yield state
                    return
            finally:
                process.kill()
                process.wait(PATIENCE)
                assert process.stdout is not None
                process.stdout.close()
    pytest.skip(f"the machine stalls for more than 80 ms again and again: no contact in {ATTEMPTS} attempts")


def pressed_or_ended(state: Pressing) -> Callable[[], bool]:
    return lambda: state.emulator.tip_force[2] > PRESSED_N or state.process.poll() is not None


def test_killed_in_contact_the_arm_lets_go(tmp_path: Path) -> None:
    with pressing(tmp_path) as arm:
        assert arm.send(signal.SIGKILL) <= WITHIN_S
        assert [motor.registers["goal_current"] for motor in arm.motors] == [0, 0, 0, 0]
        sleep(0.3)
        assert arm.currents() == 0.0, "nobody takes it up again"


def test_stopped_host_releases_and_later_holds(tmp_path: Path) -> None:
    with pressing(tmp_path) as arm:
        assert arm.send(signal.SIGSTOP) <= WITHIN_S
        sleep(0.5)
        arm.emulator.largest_current = 0.0
        lying, where = arm.emulator.tip_force[2], arm.emulator.tip
        arm.process.send_signal(signal.SIGCONT)
        said, _ = arm.process.communicate(timeout=PATIENCE)
        assert "bus watchdog tripped" in said
        sleep(0.3)
        assert arm.emulator.largest_current <= MOST_A, "it holds where it lies"
        assert arm.emulator.tip_force[2] < lying + 0.5
        assert max(abs(a - b) for a, b in zip(arm.emulator.tip, where, strict=True)) < 0.01
        for motor in arm.motors:
            assert motor.drive.on
            assert motor.registers["operating_mode"] == registers.MODE_CURRENT_BASED_POSITION
            assert motor.drive.limit <= MOST_A
