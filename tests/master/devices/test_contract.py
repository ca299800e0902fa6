"""The contract that every device driver keeps, of those of the kernel; boards are emulated."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, ClassVar

import pytest

from weberlink.master.devices import BUILT_IN
from weberlink.testing.devices import DeviceBench, DeviceContract, ForceDeviceContract, StoppedHostContract, armed
from weberlink.testing.time import virtual_time
from weberlink.testing.wires import HidWire, emulated, on_a_pty

REACH = {"motion": "reach", "to_m": [0.2, 0, 0]}
REST = {"motion": "rest"}
TURN = {"motion": "turn", "turn_deg": [0, 0, 9]}
NINE_BYTES = {"parameters": "aluhaptics_v2"}


def test_every_driver_is_tested() -> None:
    tested = {each.NAME for each in globals().values() if isinstance(each, type) and each.__name__.startswith("Test")}
    assert tested == set(BUILT_IN)


class TestOperator(DeviceContract):
    NAME = "operator"
    REFUSED = (
        ({"script": [REACH]}, "script.0: expected motion within the workspace"),
        ({"script": [REST, {"motion": "press", "at_m": [0, 0, 0], "depth_m": 0.1}]}, "script.1"),
        ({"script": [{"motion": "reach", "to_m": [0, 0, 0], "duration_s": 0}]}, "duration_s"),
        ({"script": [{"motion": "slide", "points_m": [[0, 0, 0]]}]}, "points_m"),
        ({"wrist": {"stiffness_n_m_rad": 0}}, "wrist.stiffness_n_m_rad"),
        ({"wrist": {}, "script": [{"motion": "turn", "turn_deg": [0, 150, 150]}]}, "at most half a turn"),
        ({"script": [TURN]}, "script.0.turn_deg: only a hand with a wrist"),
        ({"script": [REST, {**TURN, "motion": "reach", "to_m": [0, 0, 0]}]}, "script.1.turn_deg"),
        ({"home_m": [0.0, 0.0, 0.0601]}, "home_m"),
    )
    TAKEN = (
        {"home_m": [0.0, 0.0, 0.06], "script": [{**REACH, "to_m": [0.06, -0.06, 0.06]}]},
        {"wrist": {}, "script": [{"motion": "turn", "turn_deg": [0, 0, -180]}]},
    )

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        yield DeviceBench(armed("operator", **options), virtual_time())


class TestReplay(DeviceContract):
    NAME = "replay"
    REFUSED = (
        ({"axes": "+x+y+y"}, "axes"),
        ({"trace": "nowhere.csv"}, "nowhere.csv: not found"),
        ({"scale": 100.0}, "trace: .* beyond the workspace"),
    )

    @contextmanager
    def make_bench(self, folder: Path, /, **options: Any) -> Iterator[DeviceBench]:
        path = folder / "circle.csv"
        rows = [f"{i * 0.01},{0.001 * (i % 7)},{0.0005 * i},{-0.0001 * i},0,0,0" for i in range(101)]
        path.write_text("\n".join(["t,px,py,pz,fx,fy,fz", *rows]) + "\n")
        yield DeviceBench(armed("replay", trace=path, **options), virtual_time(), options={"trace": path})


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
