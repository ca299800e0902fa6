"""The emulated Inverse Service, without a wire."""

import json
from typing import Any

from tests.master.devices.inverse3.published import FORCE_UP
from weberlink.geometry.vector import ZERO, Vector
from weberlink.master.emulators.inverse3 import Inverse3Emulator, Inverse3EmulatorOptions, Inverse3Session

UP: Vector = (0.0, 0.0, 1.5)


def service(**options: Any) -> Inverse3Emulator:
    emulator = Inverse3Emulator(Inverse3EmulatorOptions.model_validate(options))
    emulator.advance(0.0)
    return emulator


def say(session: Inverse3Session, message: Any, now: float) -> list[dict[str, Any]]:
    """Send a message; what the service says by then."""
    session.receive(message if isinstance(message, bytes) else json.dumps(message).encode(), now)
    return [json.loads(reply) for reply in session.replies(now)]


def joined(emulator: Inverse3Emulator, now: float = 0.0) -> Inverse3Session:
    """A session whose inventory was read."""
    session = emulator.join(now)
    (inventory,) = session.replies(now)
    assert json.loads(inventory)["inverse3"][0]["config"]["type"] == "inverse3"
    return session


def test_each_message_is_answered_with_one_state() -> None:
    session = joined(service())
    nothing = {"x": 0.0, "y": 0.0, "z": float("nan")}
    endless = {"inverse3": [{"device_id": "049D", "commands": {"set_cursor_force": {"vector": nothing}}}]}
    others = ({}, b"nonsense", b"[]", {"inverse3": 7}, {"inverse3": [{"device_id": "other"}]}, endless)
    for message in (FORCE_UP, *others):
        (answer,) = say(session, message, 0.001)
        assert "config" not in answer["inverse3"][0]
    (full,) = say(session, {"session": {"force_render_full_state": {}}}, 0.001)
    assert "config" in full["inverse3"][0]


def test_command_is_displayed_until_its_time_out() -> None:
    emulator = service(time_out_ms=50.0)
    session = joined(emulator)
    (answer,) = say(session, FORCE_UP, 0.001)
    assert answer["inverse3"][0]["state"]["current_cursor_force"] == {"x": 0.0, "y": 0.0, "z": 1.5}
    emulator.advance(0.05)
    assert emulator.force == UP
    emulator.advance(0.052)
    assert emulator.force == ZERO


def test_forces_of_sessions_add_until_they_leave() -> None:
    emulator = service()
    first, second = joined(emulator), joined(emulator)
    say(first, FORCE_UP, 0.001)
    (answer,) = say(second, FORCE_UP, 0.002)
    assert emulator.force == (0.0, 0.0, 3.0)
    assert answer["inverse3"][0]["status"]["in_use"] is True
    first.leave()
    emulator.advance(0.003)
    assert emulator.force == UP
