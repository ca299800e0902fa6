"""The driver and the emulated service, over a real WebSocket."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

import pytest

from tests.wait import until
from weberlink.geometry.vector import ZERO, Vector, distance, norm
from weberlink.master.devices.contract import DeviceFault
from weberlink.testing.devices import drive, refusal
from weberlink.testing.wires import on_a_wire
from weberlink_devices.inverse3.emulator import Inverse3Emulator, Inverse3EmulatorOptions
from weberlink_devices.inverse3.http_requests import service_devices, service_version
from weberlink_devices.inverse3.websocket_device import WebSocketDevice

PLACE: Vector = (0.02, -0.03, 0.04)
PULL: Vector = (0.2, -0.4, 0.8)
STILL = {"tremor_m": 0.0, "script": [{"motion": "rest"}]}
CLOSE = 1e-4
"""Force that the JSON may be off by [N]."""


class Unnamed(Inverse3Emulator):
    """A service that answers no HTTP."""

    def get(self, path: str) -> str | None:
        return None


@contextmanager
def bench(
    service: dict[str, Any] | None = None, kind: type[Inverse3Emulator] = Inverse3Emulator, **options: Any
) -> Iterator[tuple[Any, Any, WebSocketDevice]]:
    """A device, its emulated service, and the wire. Patient: a machine that stalls is not what is tested."""
    emulator = kind(Inverse3EmulatorOptions.model_validate({"handle": STILL, **(service or {})}))
    emulator.handle.carry(emulator.handle.position)
    wire, which = WebSocketDevice(emulator), options.pop("port", "")
    with on_a_wire("inverse3", wire, lambda: wire.address + which, **{"reply_ms": 100.0, **options}) as found:
        yield found.device, emulator, wire


@pytest.mark.parametrize(
    ("how", "version"),
    [({}, (3, 5)), ({"service": {"version": "3.1"}}, (3, 1)), ({"kind": Unnamed, "force_key": "vector"}, None)],
)
def test_origin_and_force_are_those_of_the_hand_in_every_version(how: dict[str, Any], version: Any) -> None:
    with bench(**how, origin_m=PLACE) as (device, emulator, wire):
        assert service_version(wire.address) == version
        assert service_devices(wire.address) == (("049D",) if version else ())
        device.open(monotonic())
        emulator.handle.carry(PLACE)
        drive(device, lambda: distance(device.latest(monotonic()).position, ZERO) < 1e-9)
        drive(device, lambda: distance(emulator.force, PULL) < CLOSE, PULL)
        assert device.trouble is None


def test_session_has_the_settings_of_the_file() -> None:
    with bench(preset="led_front", force_gate=0.7) as (device, emulator, _):
        device.open(monotonic())
        (session,) = emulator.sessions
        assert (session.profile, session.preset, session.gate) == ("weberlink:master", "led_front", 0.7)


@pytest.mark.parametrize(("grip", "held"), [("wireless_verse_grip", 0b101), ("verse_grip", 0b1)])
def test_grip_gives_buttons_and_orientation_until_it_sleeps(grip: str, held: int) -> None:
    with bench({"grip": grip}, grip=grip) as (device, emulator, _):
        assert device.spec.orientation
        device.open(monotonic())
        emulator.inject("button", float(held))
        drive(device, lambda: device.latest(monotonic()).buttons == held)
        turn = device.latest(monotonic()).orientation
        assert turn is not None
        assert turn[2] != 0.0 == turn[1], "the grip nods about the axis to the right, our y"
        emulator.inject("asleep", 1.0)
        drive(device, lambda: device.latest(monotonic()).orientation is None)
        assert device.trouble == f"no {grip}: it is away or asleep"


@pytest.mark.parametrize(("fault", "said"), [("push", "instead of"), ("oscillation", "force gate 0.3")])
def test_altered_force_is_named_while_it_lasts(fault: str, said: str) -> None:
    with bench() as (device, emulator, _):
        device.open(monotonic())
        emulator.inject(fault, 1.5)
        drive(device, lambda: said in (device.trouble or ""), PULL)
        emulator.inject(fault, 0.0)
        drive(device, lambda: device.trouble is None, PULL)


def test_device_in_use_is_refused_unless_shared() -> None:
    with bench() as (device, emulator, _):
        emulator.inject("push", 0.5)
        until(lambda: norm(emulator.force) > 0.0, "the service")
        assert "another program uses device 049D, and forces add" in refusal(device)
    with bench(shared=True) as (device, emulator, _):
        emulator.inject("push", 0.5)
        device.open(monotonic())
        drive(device, lambda: distance(emulator.force, (0.2, -0.4, 1.3)) < CLOSE, PULL)


def test_late_answers_are_never_taken_for_others() -> None:
    """After answers that came too late, a reading is that of its own message again."""
    with bench(reply_ms=10.0) as (device, emulator, _):
        device.open(monotonic())
        emulator.faults.late_s = 0.03
        drive(device, lambda: device.trouble is not None)
        emulator.faults.late_s = 0.0
        drive(device, lambda: device.trouble is None)
        emulator.handle.carry(PLACE)
        until(lambda: emulator.handle.arrived, "the service")
        seen = emulator.messages
        drive(device, lambda: emulator.messages > seen + 3)
        assert distance(device.latest(monotonic()).position, PLACE) < 1e-9


@pytest.mark.parametrize(
    ("service", "options", "says"),
    [
        ({"version": "3.0"}, {}, "version 3.0, and 3.1 is the least"),
        ({}, {"port": "#04BA"}, "lists no Inverse3 called 04BA: there is 049D"),
        ({}, {"kind": Unnamed}, "set master.device.force_key"),
        ({}, {}, "nothing listens there; is the Haply Inverse Service running"),
    ],
)
def test_service_that_cannot_be_used_is_refused(service: dict[str, Any], options: dict[str, Any], says: str) -> None:
    with bench(service, **options) as (device, _, wire):
        if not service and not options:
            wire.unplug()
        assert says in refusal(device)


def test_examination_says_time_out_and_filters() -> None:
    with bench({"time_out_ms": 4.0}) as (device, emulator, _):
        said = " ".join(device.examine((0.0, 0.0, 0.3)))
        assert "and less than" in said
        assert "force gate 0.3, damping 0." in said
        emulator.inject("lost", 1.0)
        with pytest.raises(DeviceFault, match="lists no Inverse3"):
            device.examine((0.0, 0.0, 0.3))
