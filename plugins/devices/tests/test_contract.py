"""Every driver of hardware, of this distribution and of the kernel, keeps the contract, before an emulated device."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from importlib.metadata import entry_points
from itertools import chain
from pathlib import Path
from typing import Any, ClassVar

import pytest

from plugins.devices.tests.force_dimension.fake import STATE, Devices
from plugins.devices.tests.pads.test_gamepad import Pad
from plugins.devices.tests.touch import fake_hd
from weberlink.geometry.vector import ZERO, distance
from weberlink.hardware.worker import LOST_S
from weberlink.master.devices import BUILT_IN, DEVICES
from weberlink.master.devices.contract import DeviceFault
from weberlink.testing.devices import PUSH, DeviceBench, DeviceContract, ForceDeviceContract, StoppedHostContract, armed
from weberlink.testing.time import TICK, real_time, running_time, until
from weberlink.testing.wires import HidWire, emulated, on_a_pty, on_a_wire
from weberlink_devices.gamepad.device import GamepadExchange, GamepadOptions
from weberlink_devices.gamepad.identity import EVENT
from weberlink_devices.inverse3.websocket_device import WebSocketDevice
from weberlink_devices.rate_control import RateDevice
from weberlink_devices.spacemouse.device import PuckExchange, SpaceMouseOptions

NINE_BYTES = {"parameters": "aluhaptics_v2"}
SERIAL_FAULTS = ("unplug", "silent", "garbled", "restart", "guardian")


def test_every_kind_of_hardware_is_tested() -> None:
    tested = {each.NAME for each in globals().values() if isinstance(each, type) and each.__name__.startswith("Test")}
    ours = {entry.name for entry in entry_points(group="weberlink.devices") if "weberlink_devices" in entry.value}
    assert tested == ours | {name for name in BUILT_IN if hasattr(DEVICES.load(name), "plugged")}


@pytest.mark.realtime
class TestPolhemHid(ForceDeviceContract):
    NAME = "polhem_hid"
    FAULTS = ("unplug", "silent", "late", "restart")
    SIGNS = (
        {"encoder_directions": (1, -1, 1)},
        {"motor_directions": (1, -1, 1)},
        {"report_bytes": 8},
        {"home_counts": (0, 0, -5999)},
        {"parameters": "woodenhaptics_2019"},
        {"parameters": "polhem_v3"},
    )
    REFUSED = (
        (NINE_BYTES, "published for 8-byte reports, not for 14-byte reports: set encoder_dir"),
        ({**NINE_BYTES, "encoder_directions": (1, 1, 1)}, "published for 8-byte reports"),
        ({"parameters": "vintage_phantom", "encoder_directions": (1, 1, 1)}, "published for the serial board"),
        ({"parameters": "vintage_phantom_2021", "gravity_compensation": True}, "no masses are published"),
        ({"force_n": 5.01}, "force_n: expected at most 5 N"),
    )
    TAKEN = ({"force_n": 5.0},)

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        wire = HidWire(emulated("polhem_hid"))
        with closing(armed("polhem_hid", wire, port="/dev/hidraw9", **options)) as device:
            yield wire.bench(device)


class PolhemSerial:
    NAME = "polhem_serial"

    def make_bench(self, folder: Path, /, **options: Any) -> Any:
        return on_a_pty("polhem_serial", folder, model="vintage_phantom", **options)


@pytest.mark.realtime
class TestPolhemSerial(PolhemSerial, ForceDeviceContract):
    FAULTS = ("unplug", "silent", "late", "garbled", "restart")
    OPTIONS: ClassVar = {"model": "woodenhaptics"}
    SIGNS = ({"model": "polhem"}, {"model": "auto"})


@pytest.mark.realtime
class TestHostOfPolhemSerial(PolhemSerial, StoppedHostContract): ...


@pytest.mark.realtime
class TestForceDimension(ForceDeviceContract, StoppedHostContract):
    NAME = "force_dimension"
    FAULTS = ("unplug", "silent", "garbled", "restart", "button", "too_fast")
    SIGNS = ({"model": "omega.6"}, {"serial_number": 7})
    REFUSED = (
        ({"force_n": 12.1}, "force_n: expected at most 12 N for omega.3"),
        ({"torque_n_m": 0.1}, "torque_n_m: expected at most 0 N m"),
        ({"watchdog_ms": 4.99}, "watchdog_ms: expected 0, or at least 5"),
        ({"watchdog_ms": 31.9}, "watchdog_ms"),
    )
    TAKEN = ({"force_n": 12.0, "watchdog_ms": 5.0}, {"watchdog_ms": 31.875}, {"watchdog_ms": 0.0})

    @contextmanager
    def make_bench(self, folder: Path, /, *, checked: bool = True, **options: Any) -> Iterator[DeviceBench]:
        """A real library file, compiled, in place of the maker's."""
        fake = Devices(folder / "devices")
        handle = fake[0].plug()
        handle["swing_m"] = 0.05
        options |= {"library": str(fake.library)}
        device = armed("force_dimension", checked=checked, **options)
        faults: dict[str, Callable[[], object]] = {
            "unplug": lambda: handle.__setitem__("present", 0),
            "plug": handle.plug,
            "flicker": lambda: handle.__setitem__("not_a_number", 3),
            "silent": lambda: handle.__setitem__("fails", 7),
            "garbled": lambda: handle.__setitem__("not_a_number", 1_000_000),
            "restart": lambda: handle.__setitem__("reset", 1),
            "button": lambda: handle.switch_off(1),
            "too_fast": lambda: handle.switch_off(2),
        }
        with pytest.MonkeyPatch.context() as patch, closing(device):
            patch.setenv(STATE, str(fake.state))  # for processes of a test
            yield DeviceBench(device, real_time(), lambda: handle.wrench[0], faults, options=options)


class LockStepContract(ForceDeviceContract, StoppedHostContract):
    """What a driver keeps besides that asks and waits for the answer."""

    PATIENT: ClassVar = {"reply_ms": 100.0}

    @pytest.mark.parametrize("late_s", [0.11, 0.3])
    def test_no_late_answer_is_taken_and_the_session_ends(self, late_s: float, tmp_path: Path) -> None:
        """Answers that all come too late, the guardian's too; the driver waits longer than a force may stand."""
        with self.make_bench(tmp_path, reply_ms=100.0) as bench:
            bench.open()
            bench.push(PUSH, lambda: bench.displayed > 0.5)
            bench.faults["late"](late_s)
            newest, taken = bench.device.latest(bench.tick()).at, 0.0
            with running_time() as ran, pytest.raises(DeviceFault):
                while ran() < LOST_S + 8.0:
                    for now in bench.hold(PUSH, 1):
                        if (at := bench.device.latest(now).at) > newest:
                            newest, taken = at, ran()
            assert taken < 0.1, "one that was on its way"
            until(lambda: bench.displayed == 0.0, "the end of the force", pause=0.0)


@pytest.mark.realtime
class TestHaply(LockStepContract):
    NAME = "haply_2diy"
    FAULTS = SERIAL_FAULTS
    UNHEARD = ("unplug",)
    SIGNS = (
        {"version": "v2"},
        {"motor_directions": ("cw", "ccw")},
        {"encoder_directions": ("ccw", "cw")},
        {"home_deg": (167.0, 12.0)},
    )

    def make_bench(self, folder: Path, /, **options: Any) -> Any:
        return on_a_pty(self.NAME, folder, **{**self.PATIENT, **options})


@pytest.mark.realtime
class TestInverse3(LockStepContract):
    NAME = "inverse3"
    FAULTS = (*SERIAL_FAULTS, "lost", "unready")
    SIGNS = ({"preset": "led_front"}, {"preset": None})
    REFUSED = (({"port": "ws://host:1/path"}, "port"),)
    TAKEN = ({"port": "ws://host:1/#0A"},)

    def make_bench(self, folder: Path, /, **options: Any) -> Any:
        wire = WebSocketDevice(emulated(self.NAME))
        return on_a_wire(
            self.NAME, wire, lambda: wire.address, **{"grip": "wireless_verse_grip", **self.PATIENT, **options}
        )


@pytest.mark.realtime
class TestTouch(ForceDeviceContract, StoppedHostContract):
    NAME = "touch"
    FAULTS = ("unplug", "silent", "killed", "stopped", "warm")
    UNHEARD = ("unplug",)

    @contextmanager
    def make_bench(self, folder: Path, /, *, checked: bool = True, **options: Any) -> Iterator[DeviceBench]:
        """The maker's library is a fake one, whose board holds the last force."""
        with fake_hd.plugged(folder) as (board,):
            options |= {"library": str(fake_hd.library())}
            device: Any = armed("touch", checked=checked, **options)

            def warm_motors(errors: int) -> None:
                board.error, board.errors_left = 0x0200, errors

            faults: dict[str, Callable[[], object]] = {
                "unplug": lambda: setattr(board, "unplugged", 1),
                "flicker": lambda: warm_motors(3),
                "warm": lambda: warm_motors(1_000_000),
                "silent": lambda: setattr(board, "silent", 1),
                "killed": lambda: os.kill(device.servo_pid, signal.SIGKILL),
                "stopped": lambda: os.kill(device.servo_pid, signal.SIGSTOP),
            }
            with closing(device):
                yield DeviceBench(device, real_time(), lambda: board.felt, faults, options=options)


# --- rate control


class RateContract(DeviceContract):
    """What a rate-controlled device keeps besides."""

    REFUSED = (({"home_m": (0.0, 0.0, 0.0601)}, "home_m: expected a point within"),)
    TAKEN = ({"home_m": (0.06, -0.06, 0.06)},)

    def test_unplugged_device_is_a_fault_in_time(self, bench: DeviceBench) -> None:
        device = bench.device
        bench.open()
        start = device.latest(bench.tick()).position
        bench.push(ZERO, lambda: distance(device.latest(bench.tick()).position, start) > 0.005)
        bench.faults["unplug"]()
        with running_time() as ran, pytest.raises(DeviceFault, match=f"{self.NAME}: /dev/.*: unplugged"):
            while ran() < 0.5:
                device.latest(bench.tick())
        device.close()


class TestSpaceMouse(RateContract):
    NAME = "spacemouse"

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        wire, settings = HidWire(emulated("spacemouse")), SpaceMouseOptions(port="/dev/hidraw9", **options)
        device = RateDevice("spacemouse", settings, PuckExchange(settings, list, wire), TICK, buttons=2)
        with closing(device):
            yield wire.bench(device)


class TestGamepad(RateContract):
    NAME = "gamepad"

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        """Its events come tick by tick."""
        pads, emulator, wait = list[Pad](), emulated("gamepad"), real_time()
        settings = GamepadOptions(port="/dev/input/event9", **options)
        exchange = GamepadExchange(settings, list, lambda path: pads.append(Pad()) or pads[-1])
        device = RateDevice("gamepad", settings, exchange, TICK, buttons=8)

        def unplug() -> None:
            pads[-1].unplug()

        def tick() -> float:
            now = wait()
            emulator.advance(now)
            for _, _, *change in chain.from_iterable(map(EVENT.iter_unpack, emulator.replies(now))):
                if pads and pads[-1].kernel >= 0:
                    pads[-1].change(*change)
            return now

        with closing(device):
            yield DeviceBench(device, tick, faults={"unplug": unplug})
