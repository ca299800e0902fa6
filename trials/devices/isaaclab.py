"""`python -m trials.devices.isaaclab`: Isaac Lab's client at the emulated service, and our driver.

Isaac Lab (isaaclab on PyPI) has a client of its own, `devices/haply/se3_haply.py`, under BSD-3-Clause. Its module runs
here as it is in the wheel, at the emulated service; the package around it needs a simulator and is not imported. Runs
in an environment with isaaclab, torch and WeberLink: `make isaaclab`. Prints what it found; a failed
check ends it.
"""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import distribution, version
from pathlib import Path
from time import monotonic
from types import ModuleType
from typing import Any

from tests.wait import PATIENCE, until
from weberlink.geometry.vector import Vector, distance
from weberlink.master.devices.contract import DeviceFault
from weberlink_devices.inverse3.device import Inverse3Device
from weberlink_devices.inverse3.emulator import Inverse3Emulator, Inverse3EmulatorOptions
from weberlink_devices.inverse3.options import Inverse3Options
from weberlink_devices.inverse3.protocol import ours, theirs
from weberlink_devices.inverse3.websocket_device import WebSocketDevice

MODULE = "devices/haply/se3_haply.py"
PUSH: Vector = (0.5, -0.25, 1.0)  # [N, axes of the service]; of a size that single precision has
STILL = {"tremor_m": 0.0, "script": [{"motion": "rest"}], "home_m": (0.01, -0.02, 0.03)}
PLACE: Vector = (0.02, 0.03, -0.01)
TOLERANCE = 1e-6


def client_module() -> ModuleType:
    """Their module, in packages without their own initial imports; it is below a folder of the wheel's sources."""
    found = next(file for file in distribution("isaaclab").files or [] if str(file).endswith(f"/isaaclab/{MODULE}"))
    folder = Path(str(found.locate())).parents[2]
    for name in ("isaaclab", "isaaclab.devices", "isaaclab.devices.haply"):
        package = ModuleType(name)
        package.__path__ = [str(folder.joinpath(*name.split(".")[1:]))]
        sys.modules[name] = package
    return import_module("isaaclab.devices.haply.se3_haply")


@contextmanager
def client(address: str) -> Iterator[Any]:
    module = client_module()
    settings = module.HaplyDeviceCfg(websocket_uri=address, data_rate=1000.0, sim_device="cpu", limit_force=2.0)
    device = module.HaplyDevice(settings)
    try:
        yield device
    finally:
        device.running = False
        device._websocket_thread.join(PATIENCE)


def check_alone(emulator: Inverse3Emulator, theirs_: Any) -> None:
    """Position, orientation, buttons and force of their client are those of the emulated device."""
    import torch  # noqa: PLC0415 - in the environment of this trial alone

    emulator.handle.carry(PLACE)
    until(lambda: distance(tuple(theirs_.advance()[:3].tolist()), theirs(PLACE)) < TOLERANCE, "their position")
    emulator.inject("button", 5.0)
    until(lambda: theirs_.advance()[7:].tolist() == [1.0, 0.0, 1.0], "their buttons a and c")
    qx, qy, qz, qw = theirs_.advance()[3:7].tolist()
    assert abs(qx * qx + qy * qy + qz * qz + qw * qw - 1.0) < TOLERANCE
    assert abs(qx) > 0.0, "the grip nods about the axis to the right"
    theirs_.push_force(torch.tensor([PUSH]), torch.tensor([0]))
    until(lambda: distance(emulator.force, ours(PUSH)) < TOLERANCE, "their force on the hand")


def check_together(emulator: Inverse3Emulator, address: str) -> str:
    """While their client pushes, our driver refuses, or says that forces add; gives what it says."""
    options = Inverse3Options(port=address)
    try:
        Inverse3Device(options, 0.001).open(monotonic())
    except DeviceFault as fault:
        assert "another program uses device 049D" in str(fault), fault
    else:
        raise AssertionError("our driver ought to refuse")
    shared = options.model_copy(update={"shared": True, "signs_checked": Inverse3Device.fingerprint(options)})
    device = Inverse3Device(shared, 0.001)
    device.open(monotonic())
    try:
        push = (0.0, 0.0, 0.5)

        def adds() -> bool:
            now = monotonic()
            device.latest(now)
            device.command(push, now)
            added = tuple(a + b for a, b in zip(ours(PUSH), push, strict=True))
            return distance(emulator.force, added) < TOLERANCE and device.trouble is not None  # type: ignore[arg-type]

        until(adds, "the sum of both forces")
        return device.trouble or ""
    finally:
        device.close()


def run(service: str) -> str:
    """The trial at a service of this version; gives what our driver said of the other program."""
    options = {"version": service, "handle": STILL}
    emulator = Inverse3Emulator(Inverse3EmulatorOptions.model_validate(options))
    with WebSocketDevice(emulator) as wire:
        with client(wire.address) as theirs_:
            check_alone(emulator, theirs_)
            said = check_together(emulator, wire.address)
        until(lambda: emulator.force == (0.0, 0.0, 0.0), "no force once their client has gone")
    return said


def main() -> None:
    said = {service: run(service) for service in ("3.5", "3.1")}
    found = {"isaaclab": version("isaaclab"), "torch": version("torch"), "our driver said": said}
    sys.stdout.write(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
