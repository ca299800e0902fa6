"""The driver and the emulated service, over a real WebSocket."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import monotonic
from typing import Any

import pytest

from tests.master.devices.driving import drive, fault_of, refusal
from tests.wait import until
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.hardware.websocket_device import WebSocketDevice
from weberlink.master.devices.contract import DeviceFault
from weberlink.master.devices.inverse3.device import Inverse3Device
from weberlink.master.devices.inverse3.options import Inverse3Options
from weberlink.master.emulators.inverse3 import Inverse3Emulator, Inverse3EmulatorOptions

TICK = 0.001
PATIENCE_S = 10.0
PLACE: Vector = (0.02, -0.03, 0.04)
PULL: Vector = (0.2, -0.4, 0.8)
STILL = {"tremor_m": 0.0, "script": [{"motion": "rest"}]}
CLOSE = 1e-4
"""Force that the JSON may be off by [N]."""


@dataclass
class Bench:
    """A device and its emulated service."""

    emulator: Inverse3Emulator
    wire: WebSocketDevice
    device: Inverse3Device

    def run(self, is_so: Callable[[], object], force: Vector = ZERO) -> None:
        drive(self.device, is_so, force)

    def fault(self) -> str:
        return fault_of(self.device, PULL)


class Unnamed(Inverse3Emulator):
    """A service that answers no HTTP."""

    def get(self, path: str) -> str | None:
        return None


@contextmanager
def bench(
    service: dict[str, Any] | None = None,
    *,
    signs: bool = True,
    kind: type[Inverse3Emulator] = Inverse3Emulator,
    **options: Any,
) -> Iterator[Bench]:
    """Patient with the emulated service: a machine that stalls is not what is tested."""
    emulator = kind(Inverse3EmulatorOptions.model_validate({"handle": STILL, **(service or {})}))
    emulator.handle.carry(emulator.handle.position)
    with WebSocketDevice(emulator) as wire:
        port = wire.address + options.pop("port", "")
        wanted = Inverse3Options.model_validate({"port": port, "reply_ms": 100.0, **options})
        checked = Inverse3Device.fingerprint(wanted) if signs else None
        device = Inverse3Device(wanted.model_copy(update={"signs_checked": checked}), TICK)
        try:
            yield Bench(emulator, wire, device)
        finally:
            device.close()


@pytest.mark.parametrize("version", ["3.5", "3.1", None])
def test_position_and_force_are_those_of_the_hand(version: str | None) -> None:
    with bench({"version": version}) if version else bench(kind=Unnamed, force_key="vector") as at:
        at.device.open(monotonic())
        at.emulator.handle.carry(PLACE)
        at.run(lambda: distance(at.device.latest(monotonic()).position, PLACE) < 1e-9)
        at.run(lambda: distance(at.emulator.force, PULL) < CLOSE, PULL)
        assert at.device.trouble is None
        at.device.close()
        assert at.emulator.force == ZERO


def test_origin_and_session_settings_are_those_of_the_file() -> None:
    with bench(origin_m=PLACE, preset="led_front", force_gate=0.7) as at:
        at.device.open(monotonic())
        at.emulator.handle.carry(PLACE)
        at.run(lambda: distance(at.device.latest(monotonic()).position, ZERO) < 1e-9)
        (session,) = at.emulator.sessions
        assert (session.profile, session.preset, session.gate) == ("weberlink:master", "led_front", 0.7)
        assert at.device._dialogue.settings.filters == "force gate 0.7, damping 0"


@pytest.mark.parametrize(("grip", "held"), [("wireless_verse_grip", 0b101), ("verse_grip", 0b1)])
def test_grip_gives_buttons_and_orientation_until_it_sleeps(grip: str, held: int) -> None:
    with bench({"grip": grip}, grip=grip) as at:
        assert at.device.spec.orientation
        at.device.open(monotonic())
        at.emulator.inject("button", float(held))
        at.run(lambda: at.device.latest(monotonic()).buttons == held)
        turn = at.device.latest(monotonic()).orientation
        assert turn is not None
        assert turn[2] != 0.0 == turn[1], "the grip nods about the axis to the right, our y"
        at.emulator.inject("asleep", 1.0)
        at.run(lambda: at.device.latest(monotonic()).orientation is None)
        assert at.device.trouble == f"no {grip}: it is away or asleep"


@pytest.mark.parametrize(("fault", "said"), [("push", "instead of"), ("oscillation", "force gate 0.3")])
def test_altered_force_is_named_while_it_lasts(fault: str, said: str) -> None:
    with bench() as at:
        at.device.open(monotonic())
        at.emulator.inject(fault, 1.5)
        at.run(lambda: said in (at.device.trouble or ""), PULL)
        at.emulator.inject(fault, 0.0)
        at.run(lambda: at.device.trouble is None, PULL)


def test_device_in_use_is_refused_unless_shared() -> None:
    with bench() as at:
        at.emulator.inject("push", 0.5)
        until(lambda: norm(at.emulator.force) > 0.0, "the service")
        assert "another program uses device 049D, and forces add" in refusal(at.device)
    with bench(shared=True) as at:
        at.emulator.inject("push", 0.5)
        at.device.open(monotonic())
        at.run(lambda: distance(at.emulator.force, (0.2, -0.4, 1.3)) < CLOSE, PULL)


@pytest.mark.parametrize(
    ("fault", "said"), [("lost", "the service has lost device 049D"), ("unready", "device 049D is not ready")]
)
def test_device_that_cannot_be_used_is_a_fault(fault: str, said: str) -> None:
    with bench() as at:
        at.device.open(monotonic())
        at.emulator.inject(fault, 1.0)
        assert said in at.fault()
        until(lambda: at.emulator.force == ZERO, "the service")
        with pytest.raises(DeviceFault, match=r"049D|lists no Inverse3"):
            at.device.open(monotonic())


def test_late_answers_are_never_taken_for_others() -> None:
    """After answers that came too late, a reading is that of its own message again."""
    with bench(reply_ms=10.0) as at:
        at.device.open(monotonic())
        at.emulator.faults.late_s = 0.03
        at.run(lambda: at.device.trouble is not None)
        at.emulator.faults.late_s = 0.0
        at.run(lambda: at.device.trouble is None)
        at.emulator.handle.carry(PLACE)
        until(lambda: at.emulator.handle.arrived, "the service")
        seen = at.emulator.messages
        at.run(lambda: at.emulator.messages > seen + 3)
        assert distance(at.device.latest(monotonic()).position, PLACE) < 1e-9


@pytest.mark.parametrize(
    ("service", "options", "says"),
    [
        ({"version": "3.0"}, {}, "version 3.0, and 3.1 is the least"),
        ({}, {"port": "#04BA"}, "lists no Inverse3 called 04BA: there is 049D"),
        ({"kind": Unnamed}, {}, "set master.device.force_key"),
        ({"gone": True}, {}, "nothing listens there; is the Haply Inverse Service running"),
    ],
)
def test_service_that_cannot_be_used_is_refused(service: dict[str, Any], options: dict[str, Any], says: str) -> None:
    settings = {key: value for key, value in service.items() if key == "version"}
    with bench(settings, kind=service.get("kind", Inverse3Emulator), **options) as at:
        if "gone" in service:
            at.wire.unplug()
        assert says in refusal(at.device)


def test_examination_says_time_out_and_filters() -> None:
    with bench({"time_out_ms": 4.0}) as at:
        said = " ".join(at.device.examine((0.0, 0.0, 0.3)))
        assert "and less than" in said
        assert "force gate 0.3, damping 0." in said
        at.emulator.inject("lost", 1.0)
        with pytest.raises(DeviceFault, match="lists no Inverse3"):
            at.device.examine((0.0, 0.0, 0.3))
