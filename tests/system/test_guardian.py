"""A driver whose force stays on when its host stops is refused, unless the file accepts it by name."""

from pathlib import Path

import pytest

from tests.master.devices.benches import armed
from tests.system.packages import install
from weberlink.master.devices import BUILT_IN, SCRIPTED
from weberlink.system.composition.master import build_device, check_force_ends
from weberlink.system.configuration import MASTER, ConfigurationError, load

DRIVER = """
from types import SimpleNamespace

from pydantic import BaseModel

from weberlink.master.devices.contract import DeviceSpec

BOX = ((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))


class Options(BaseModel):
    watchdog_s: float | None = None
    force: bool = True
    guarded: bool = False


class Pusher(SimpleNamespace):
    Options = Options

    def __init__(self, options, tick_period):
        force_n = 3.0 if options.force else 0.0
        spec = DeviceSpec(
            "pusher", "xyz", force_n, 500.0, BOX, 1000.0, force_feedback=options.force, watchdog_s=options.watchdog_s
        )
        super().__init__(spec=spec, guarded=options.guarded)

    def open(self, now): ...

    def latest(self, now): ...

    def command(self, force, now): ...

    def close(self): ...
"""
FILE = """
link: {listen: "127.0.0.1:0", slave: "127.0.0.1:0", security: session}
master: {device: {driver: pusher}}
slave: {robot: {driver: point}}
"""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    entry_points = "[weberlink.devices]\npusher = pusher:Pusher"
    monkeypatch.syspath_prepend(str(install(tmp_path, "pusher", {"pusher": DRIVER}, entry_points)))
    file = tmp_path / "pusher.yaml"
    file.write_text(FILE)
    return file


@pytest.mark.parametrize("accepted", [(), ("master.accept_no_watchdog=paddle",)])
def test_a_driver_with_neither_is_refused_in_one_line(file: Path, accepted: tuple[str, ...]) -> None:
    with pytest.raises(ConfigurationError, match=r"master\.device: .*set master\.accept_no_watchdog: pusher") as caught:
        build_device(load(file, accepted, sides=[MASTER]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "override",
    [
        "master.accept_no_watchdog=pusher",
        "master.device.watchdog_s=0.5",
        "master.device.guarded=true",
        "master.device.force=false",
    ],
)
def test_one_that_ends_its_force_or_is_accepted_is_built(file: Path, override: str) -> None:
    assert build_device(load(file, (override,), sides=[MASTER])).spec.name == "pusher"


WITHOUT_MOTORS = SCRIPTED | {"pointer", "ros2", "gamepad", "spacemouse"}


@pytest.mark.parametrize("name", sorted(set(BUILT_IN) - WITHOUT_MOTORS))
def test_the_built_in_drivers_of_hardware_end_their_force(name: str) -> None:
    options = {"model": "vintage_phantom"} if name == "polhem_serial" else {}
    device = armed(name, **options)
    assert device.spec.force_feedback
    check_force_ends(device, name, None)
