"""Every robot driver on a bench: what it stands before, how its time passes, and what can go wrong with it.

A driver of hardware is on a bench in real time, with an emulated arm behind a real pseudo terminal, or with a stand-in
for its library in its own process; the others are in virtual time.
"""

import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.pace import TICK, real_time, virtual_time
from tests.slave.robots.franka.program import PROGRAM
from weberlink.geometry.vector import ZERO, Vector
from weberlink.hardware.emulator import PtyDevice
from weberlink.slave.emulators.dynamixel import DynamixelEmulator, DynamixelEmulatorOptions
from weberlink.slave.robots import load
from weberlink.slave.robots.contract import Robot
from weberlink.slave.robots.franka.driver import FrankaRobot
from weberlink.slave.robots.franka.options import FrankaOptions
from weberlink.slave.scenes.contact import SceneObject
from weberlink.slave.scenes.scene import Scene
from weberlink.slave.scenes.solids import PlaneShape

GROUND = 500.0  # [N/m]
SLIDERS = """
<mujoco><option timestep="0.001"/><worldbody>
<geom name="ground" type="plane" size="1 1 0.1" solref="-500 -20" solimp="0.99 0.99 0.001"/>
<body pos="0 0 0.03">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
<geom type="sphere" size="0.001" mass="0.1"/><site name="tip"/></body>
</worldbody></mujoco>
"""


@dataclass
class Bench:
    """A robot before a ground that pushes up."""

    robot: Robot  # not open
    tick: Callable[[], float]  # the time of the next tick [s]; waits for it where time is real
    above: Vector  # a free place over the ground
    below: Vector  # a place in the ground that makes a few newtons
    tolerance_m: float = 1e-3  # how near it comes to where it is told
    settle_ticks: int = 600  # in which it does
    faults: Mapping[str, Callable[[], None]] = field(default_factory=dict)  # none for one that is computed

    def hold(self, position: Vector, ticks: int | None = None) -> Iterator[float]:
        """Command a position, tick by tick; gives each time after the command."""
        for _ in range(self.settle_ticks if ticks is None else ticks):
            now = self.tick()
            self.robot.command(position, now)
            yield now


def ground() -> Scene:
    return Scene([SceneObject(PlaneShape(ZERO, (0.0, 0.0, 1.0)), GROUND)])


@contextmanager
def computed(name: str, folder: Path) -> Iterator[Bench]:
    driver = load(name)
    yield Bench(driver(driver.Options(), ground(), TICK), virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))


@contextmanager
def mujoco(folder: Path) -> Iterator[Bench]:
    model = folder / "sliders.xml"
    model.write_text(SLIDERS)
    driver = load("mujoco")
    robot = driver(driver.Options(model=model), None, TICK)
    yield Bench(robot, virtual_time(), (0.01, -0.01, 0.02), (0.01, -0.01, -0.01))


@contextmanager
def dynamixel(folder: Path) -> Iterator[Bench]:
    floor = 0.10
    scene = [{"shape": "plane", "point_m": [0.0, 0.0, floor], "stiffness_n_m": GROUND}]
    emulator = DynamixelEmulator(DynamixelEmulatorOptions(scene=scene))
    with PtyDevice(emulator, folder / "arm") as wire:
        driver = load("dynamixel")
        # Patient with a machine that stalls; what it does then is the business of its own tests.
        options = driver.Options(port=str(wire.path), bus_watchdog_ms=2000.0, timeout_ms=100.0, approach_m_s=0.2)
        robot = driver(options, None, TICK)
        faults = {
            "unplug": wire.unplug,
            "silent": lambda: setattr(emulator.faults, "silent", True),
            "late": lambda: setattr(emulator.faults, "late_s", 0.2),
            "garbled": lambda: setattr(emulator.faults, "garble", 1_000_000),
        } | {
            name: lambda name=name: emulator.inject(name, 1.0)
            for name in ("overload", "trip_watchdog", "dead", "restart")
        }  # fmt: skip
        try:
            yield Bench(
                robot,
                real_time(),
                above=(0.20, 0.02, floor + 0.04),
                below=(0.20, 0.02, floor - 0.02),
                tolerance_m=0.012,
                settle_ticks=500,
                faults=faults,
            )
        finally:
            robot.close()


@contextmanager
def franka(folder: Path) -> Iterator[Bench]:
    floor = 0.40
    # Patient with a machine that stalls.
    options = FrankaOptions(host=f"arm,ground={floor}", approach_m_s=0.5, priority=0, lost_ms=2000.0, stale_ms=500.0)
    robot = FrankaRobot(options, None, TICK, PROGRAM)

    def to_controller(number: signal.Signals) -> None:
        assert robot.controller_pid is not None
        os.kill(robot.controller_pid, number)

    faults = {
        "reflex": lambda: to_controller(signal.SIGUSR1),
        "cut": lambda: to_controller(signal.SIGUSR2),
        "killed": lambda: to_controller(signal.SIGKILL),
        "stopped": lambda: to_controller(signal.SIGSTOP),
    }
    try:
        yield Bench(
            robot,
            real_time(),
            above=(0.5, 0.02, floor + 0.04),
            below=(0.5, 0.02, floor - 0.02),
            tolerance_m=0.005,
            faults=faults,
        )
    finally:
        robot.close()


BENCHES: dict[str, Callable[[Path], AbstractContextManager[Bench]]] = {
    "dynamixel": dynamixel,
    "franka": franka,
    "mujoco": mujoco,
    "point": lambda folder: computed("point", folder),
    "simulated": lambda folder: computed("simulated", folder),
}
FAULTS = [
    ("dynamixel", fault)
    for fault in ("unplug", "silent", "late", "garbled", "overload", "trip_watchdog", "dead", "restart")
] + [("franka", fault) for fault in ("reflex", "cut", "killed", "stopped")]
