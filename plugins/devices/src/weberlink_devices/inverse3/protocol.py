"""The JSON of the Haply Inverse Service 3.1 to 3.5, and its frames: no input or output.

The service answers every message with exactly one state, after a first message with an inventory of all devices
(docs.haply.co/inverseSDK/service/realtime/websocket-protocol, 3.5). Its axes: X to the right, Y forward, away from the
operator, Z up. Ours: x toward the operator, y to the right, z up.
"""

import json
from collections.abc import Mapping, Sequence
from math import hypot, isfinite
from typing import Any, Literal, NamedTuple

from weberlink.geometry.rotation import Quaternion
from weberlink.geometry.vector import Vector, norm
from weberlink.hardware.fault import BadReply, HardwareFault

ForceKey = Literal["vector", "values"]
Grip = Literal["none", "wireless_verse_grip", "verse_grip"]
OLDEST = (3, 1)
"""First version with this JSON; that of 3.0 is another one, on another port."""
VECTOR_SINCE = (3, 5)
"""First version whose `set_cursor_force` has `vector`; earlier ones have `values`."""
PROFILE = "weberlink:master"
"""Name of this program in the service and in Haply Hub."""
GRIP_BUTTONS: Mapping[Grip, tuple[str, ...]] = {
    "none": (),
    "wireless_verse_grip": ("a", "b", "c"),
    "verse_grip": ("button",),
}
"""Names of the buttons of each grip; their places are the bits of a reading."""
FARTHEST_M = 1.0
"""No cursor is farther from the origin of any preset."""
NEEDED = {"power_supply": "without its power supply", "calibrated": "not calibrated", "ready": "not ready"}
"""What `status` must say of a device before it may be used."""


def ours(vector: Vector) -> Vector:
    """From the axes of the service to ours: a turn by 90 degrees about z."""
    x, y, z = vector
    return (0.0 - y, x, z)


def theirs(vector: Vector) -> Vector:
    """From our axes to those of the service."""
    x, y, z = vector
    return (y, 0.0 - x, z)


def our_orientation(turn: Quaternion) -> Quaternion:
    """The same for an orientation: a level grip stays level, and the axis of a turn goes along."""
    w, x, y, z = turn
    return (w, 0.0 - y, x, z)


def version_in(document: Any) -> tuple[int, int] | None:
    """Version (major, minor) in the answer to GET /version; None if it says none."""
    text = _without_envelope(document).get("project_version")
    parts = text.split(".") if isinstance(text, str) else []
    return (int(parts[0]), int(parts[1])) if len(parts) > 1 and all(part.isdecimal() for part in parts[:2]) else None


def ids_in(document: Any) -> Sequence[str]:
    """Ids of the devices in the answer to GET /devices."""
    found = _without_envelope(document).get("inverse3")
    ids = [each.get("device_id") for each in found if isinstance(each, dict)] if isinstance(found, list) else []
    return [each for each in ids if isinstance(each, str)]


def _without_envelope(document: Any) -> dict[str, Any]:
    """What an answer to GET says, which some services wrap as `data`."""
    inner = document.get("data", document) if isinstance(document, dict) else None
    return inner if isinstance(inner, dict) else {}


class CommandWriter:
    """Messages to one device, with the key of the force in `set_cursor_force`."""

    def __init__(self, device_id: str, key: ForceKey) -> None:
        self._id = device_id
        self._key = key
        around = json.dumps(self._request(commands={"set_cursor_force": {key: "#"}}), separators=(",", ":"))
        self._before, self._behind = around.split('"#"')

    def force(self, force: Vector) -> str:
        """Display a force [N, axes of the service] until the next message."""
        x, y, z = force
        return f'{self._before}{{"x":{x:.6f},"y":{y:.6f},"z":{z:.6f}}}{self._behind}'

    def first(self, configure: Mapping[str, Any]) -> str:
        """The first message of a session: its name and settings, zero force, and a wish for a full state."""
        session: dict[str, Any] = {"force_render_full_state": {}}
        if self._key == "vector":  # sessions have names and settings of their own since the same version
            session["configure"] = {"profile": {"name": PROFILE}}
        zero = {"set_cursor_force": {self._key: dict.fromkeys("xyz", 0.0)}}
        request = self._request(commands=zero, **({"configure": configure} if configure else {}))
        return json.dumps({"session": session, **request})

    def probe(self) -> str:
        """Ask for a state without commanding anything."""
        return json.dumps(self._request(commands={"probe_position": {}}))

    def _request(self, **parts: Any) -> dict[str, Any]:
        return {"inverse3": [{"device_id": self._id, **parts}]}


def decode(data: bytes) -> dict[str, Any]:
    """A message of the service; raises BadReply for what is none."""
    try:
        message = json.loads(data)
    except (ValueError, RecursionError):
        message = None
    if not isinstance(message, dict):
        raise BadReply("a malformed answer")
    return message


class ServiceState(NamedTuple):
    """What one message says of the device and its grip, in our axes."""

    position: Vector  # of the cursor [m]
    displayed: Vector | None  # force that the service displays by its own account [N]; None if it does not say
    orientation: Quaternion | None  # of the grip; None without one
    buttons: int  # of the grip, a bit each


def state_of(message: dict[str, Any], device_id: str, grip: Grip) -> ServiceState:
    """Read a state.

    Raises:
        BadReply: it is malformed.
        HardwareFault: the service does not list the device any more, or it cannot be used.
    """
    device = next((each for each in listed(message, "inverse3") if each.get("device_id") == device_id), None)
    if device is None:
        raise HardwareFault(f"the service has lost device {device_id}")
    check_status(device, device_id)
    state = mapping_in(device, "state")
    if state is None or "cursor_position" not in state:
        raise BadReply("an answer without a position")
    position = read_vector(state["cursor_position"])
    if norm(position) > FARTHEST_M:
        raise BadReply("a position out of reach of any such device")
    force = state.get("current_cursor_force")
    displayed = None if force is None else ours(read_vector(force))
    return ServiceState(ours(position), displayed, *_grip_of(message, grip))


def listed(message: dict[str, Any], kind: str) -> list[dict[str, Any]]:
    """The devices of a kind; raises BadReply where the list is none."""
    found = message.get(kind, [])
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise BadReply("a malformed answer")
    return found


def check_status(device: dict[str, Any], device_id: str) -> None:
    """Raise HardwareFault for a device that says that it cannot be used; older services say less."""
    status = mapping_in(device, "status") or {}
    for name, why in NEEDED.items():
        if status.get(name) is False:
            raise HardwareFault(f"device {device_id} is {why}; Haply Hub shows what it waits for")


def choose(inventory: dict[str, Any], wanted: str | None) -> dict[str, Any]:
    """The device of that id, or the only one; raises HardwareFault where there is none, or several."""
    found = [each for each in listed(inventory, "inverse3") if isinstance(each.get("device_id"), str)]
    ids = [each["device_id"] for each in found]
    if wanted is None and len(found) == 1:
        return found[0]
    if wanted in ids:
        return found[ids.index(wanted)]
    listing = ", ".join(ids)
    there = f"there is {listing}" if ids else "it lists none; is it plugged in and switched on?"
    if wanted is None and ids:
        raise HardwareFault(f"{len(ids)} devices: {listing}; name one behind the address in master.device.port: #ID")
    raise HardwareFault(f"the service lists no Inverse3{f' called {wanted}' if wanted else ''}: {there}")


def _grip_of(message: dict[str, Any], grip: Grip) -> tuple[Quaternion | None, int]:
    """Orientation and buttons; none of both while the grip is away or asleep."""
    found = [] if grip == "none" else listed(message, grip)
    state = mapping_in(found[0], "state") if found else None
    if state is None:
        return None, 0
    pressed = state.get("buttons", state)
    if not isinstance(pressed, dict):
        raise BadReply("a malformed grip")
    names = GRIP_BUTTONS[grip]
    buttons = sum(1 << bit for bit, name in enumerate(names) if pressed.get(name) is True)
    turn = state.get("orientation")
    return None if turn is None else our_orientation(_unit_quaternion(turn)), buttons


def _unit_quaternion(value: Any) -> Quaternion:
    x, y, z = read_vector(value)
    w = read_number(value.get("w", 1.0))
    size = hypot(w, x, y, z)
    if not 0.9 < size < 1.1:
        raise BadReply("an orientation that is none")
    return (w / size, x / size, y / size, z / size)


def mapping_in(parent: Mapping[str, Any], name: str) -> dict[str, Any] | None:
    """A part that is an object; None if it is none."""
    value = parent.get(name)
    return value if isinstance(value, dict) else None


def read_vector(value: Any, identity: float = 0.0) -> Vector:
    """x, y and z; a part that the service left out has its identity (3.5 leaves such fields out). Raises BadReply."""
    if not isinstance(value, dict):
        raise BadReply("a malformed vector")
    x, y, z = (read_number(value.get(axis, identity)) for axis in "xyz")
    return (x, y, z)


def read_number(value: Any) -> float:
    """A finite number; raises BadReply for what is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BadReply("a malformed number")
    try:
        number = float(value)
    except OverflowError:
        number = float("inf")
    if not isfinite(number):
        raise BadReply("a number that is not finite")
    return number
