"""The host process stops in the middle of a push: what the board does, and what comes when the process goes on."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

from weberlink.geometry.vector import norm
from weberlink.hardware.emulator import PtyDevice
from weberlink.master.devices.polhem.serial_protocol import WATCHDOG_S
from weberlink.master.devices.threaded_device import RAMP_S
from weberlink.master.emulators.polhem.serial_board import PolhemSerialEmulator, PolhemSerialEmulatorOptions

ROOT = Path(__file__).parents[4]
PATIENCE = 20.0
PUSH_N, FULL_N = 2.0, 5.0
HOST = f"""
import sys
from time import monotonic, sleep
from weberlink.master.devices import load
driver = load("polhem_serial")
options = driver.Options(port=sys.argv[1], model="woodenhaptics")
options = options.model_copy(update=dict(signs_checked=driver.fingerprint(options)))
device = driver(options, 0.001)
device.open(monotonic())
while True:
    device.command((0.0, 0.0, {PUSH_N}), monotonic())
    device.latest(monotonic())
    sleep(0.001)
"""


class Logging(PolhemSerialEmulator):
    """Keeps the force that every message made, with its time."""

    def __init__(self) -> None:
        still = {"script": [{"motion": "rest", "duration_s": 1000.0}], "tremor_m": 0.0}
        super().__init__(PolhemSerialEmulatorOptions.model_validate({"model": "woodenhaptics", "handle": still}))
        self.made: list[tuple[float, float]] = []

    def replies(self, now: float) -> list[bytes]:
        answers = super().replies(now)
        if answers:
            self.made.append((now, norm(self.force)))
        return answers


def test_stopped_host_has_no_force_and_ramps_again(tmp_path: Path) -> None:
    emulator = Logging()

    def until_pushed() -> None:
        gives_up = monotonic() + PATIENCE
        while norm(emulator.force) < 0.95 * PUSH_N:
            assert monotonic() < gives_up
            sleep(0.0005)

    with PtyDevice(emulator, tmp_path / "tty") as pty:
        host = subprocess.Popen([sys.executable, "-c", HOST, str(pty.path)], cwd=ROOT)
        try:
            until_pushed()
            os.kill(host.pid, signal.SIGSTOP)
            sleep(3.0 * WATCHDOG_S)
            off_after = (emulator.last_force_at or 0.0) - emulator.made[-1][0]
            assert emulator.currents_ma == (0.0, 0.0, 0.0)
            assert off_after <= WATCHDOG_S + 0.01
            before, resumed = len(emulator.made), monotonic()
            os.kill(host.pid, signal.SIGCONT)
            until_pushed()
            again = emulator.made[before:]
            assert again[0][1] == 0.0
            for at, force in again:
                assert force <= FULL_N * (at - resumed) / RAMP_S + 0.02
        finally:
            host.kill()
            host.wait()
        sleep(3.0 * WATCHDOG_S)
        assert emulator.currents_ma == (0.0, 0.0, 0.0), "nor after kill -9"
