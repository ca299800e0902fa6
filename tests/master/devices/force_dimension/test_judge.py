"""Bindings that others wrote (forcedimension-core) agree with the driver, and drive the stand-in as the driver does."""

import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import Any

import pytest

from tests.master.devices.benches import armed
from tests.master.devices.force_dimension import judge_name
from tests.master.devices.force_dimension.fake import STATE, Devices, compiled
from tests.wait import until
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.force_dimension.library import find

BINDINGS = find_spec("forcedimension_core")
pytestmark = pytest.mark.skipif(BINDINGS is None, reason="forcedimension-core is not installed")

LAMBDA_7 = 108


@pytest.fixture(scope="module")
def sdk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as the SDK's, with the stand-in; it has every call that the bindings name."""
    folder = tmp_path_factory.mktemp("sdk")
    place = folder / "lib" / "release" / f"lin-{platform.machine()}-gcc"
    place.mkdir(parents=True)
    assert BINDINGS is not None
    assert BINDINGS.origin is not None
    sources = "".join(path.read_text(encoding="utf-8") for path in Path(BINDINGS.origin).parent.rglob("*.py"))
    named = set(re.findall(r"_libd[hr]d\.(d[hr]d\w+)", sources))
    own = set(re.findall(r"\b(dhd\w+)\(", Path(__file__).with_name("libdhd.c").read_text(encoding="utf-8")))
    compiled(place / "libdrd.so.3.17", sorted(named - own))
    return folder


@contextmanager
def judging(sdk: Path, state: Path, force: list[float]) -> Iterator[dict[str, Any]]:
    """What the bindings see; in the `with` they have the device open."""
    process = subprocess.Popen(
        [sys.executable, "-m", judge_name, json.dumps(force)],
        cwd=Path(__file__).parents[4],
        env={**os.environ, "FDSDK": str(sdk), STATE: str(state)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line, process.communicate()[1]
        yield json.loads(line)
    finally:
        process.kill()
        process.communicate()


def test_bindings_agree_with_the_driver_and_drive_the_stand_in(sdk: Path, tmp_path: Path) -> None:
    devices = Devices(tmp_path / "devices")
    handle = devices[0].plug(LAMBDA_7, 42)
    handle["x"], handle["turned_rad"], handle["buttons"] = 0.03, 0.5, 5
    with judging(sdk, devices.state, [0.0, 1.5, 0.0]) as seen:
        assert seen["calls"] == 18
        assert (seen["count"], seen["serial"], seen["type"]) == (1, 42, "LAMBDA7_RIGHT")
        assert (seen["watchdog"], seen["done"]) == ([0, 160], [0, 0, 0, 0])
        assert (seen["force"], seen["wrist"], seen["buttons"]) == (1, 1, 5)
        assert seen["position"] == pytest.approx([0.03, 1.5 * 3e-4, 0.0])
        assert seen["frame"][0] == pytest.approx([0.8775826, 0.0, 0.4794255])
        device = armed("force_dimension", model="lambda.7", library=str(devices.library))
        with pytest.raises(DeviceFault, match=r"none is plugged in and free.*device in use"):
            device.open(monotonic())
    until(lambda: handle["off_cause"] == 3, "the board")  # the time limit that the bindings set
    device.open(monotonic())
    reading = device.latest(monotonic())
    assert reading.position[0] == pytest.approx(0.03)
    assert reading.orientation == pytest.approx((0.9689124, 0.0, 0.2474040, 0.0))
    assert reading.buttons == 5
    with judging(sdk, devices.state, [0.0, 0.0, 0.0]) as seen:
        assert seen == {"calls": 18, "opened": False, "error": "no device found"}
    device.close()


def test_library_is_found_where_bindings_find_it(sdk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FDSDK", str(sdk))
    assert find().endswith("libdrd.so.3.17")
