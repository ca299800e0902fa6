"""An emulated Haply Inverse3: its service as documented for 3.5 and 3.1, and the handle in a modelled hand.

Written from docs.haply.co/inverseSDK (3.5.x) and public clients. Assumed, not published: the time-out of a command,
that the state in an answer is that after its command, and that a device is in use while any session commands a force.
"""

import json
from collections import deque
from collections.abc import Callable, Mapping
from math import cos, inf, sin
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, Field

from weberlink.geometry.vector import ZERO, Vector, add, is_finite, norm, scale
from weberlink.hardware.emulator import Emulator
from weberlink.hardware.fault import BadReply
from weberlink.options import Options
from weberlink_devices.handle import Handle, HandleOptions
from weberlink_devices.inverse3.protocol import decode, listed, ours, theirs
from weberlink_devices.inverse3.websocket_device import WebSocketDevice

STEP_S = 0.001
SCALE: Mapping[str, float] = dict.fromkeys("xyz", 1.0)
LEVEL: Mapping[str, float] = {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}
SOUND = {"calibrated": True, "power_supply": True, "ready": True, "started": True}
NOD_RAD = 0.3
"""Amplitude of the turning of the grip about the axis to the right."""


class Inverse3EmulatorOptions(Options):
    """Options of the emulated `inverse3`."""

    version: Literal["3.5", "3.1", "3.0"] = Field(
        default="3.5", description="of the service; 3.1 takes `values` alone, 3.0 only says that it is older"
    )
    tcp_port: int = Field(default=0, ge=0, le=65535, description="of the service; 0: a free one, 10001: the usual one")
    device_id: str = Field(default="049D", pattern=r"^\w+$")
    grip: Literal["wireless_verse_grip", "verse_grip", "none"] = "wireless_verse_grip"
    answer_ms: float = Field(default=0.0, ge=0.0, le=100.0, description="from a message to its answer")
    time_out_ms: float = Field(default=50.0, gt=0.0, le=1e4, description="how long a command is displayed; assumed")
    force_gate: float = Field(default=0.3, ge=0.0, le=1.0, description="gain during what it takes for an oscillation")
    handle: HandleOptions = Field(default=HandleOptions(), description="who holds it, and what that person does")


class Inverse3Session:
    """One client: each message is answered with one state; see `websocket_device.ServiceSession`."""

    def __init__(self, service: "Inverse3Emulator", number: int, now: float) -> None:
        self._service = service
        self._replies: deque[tuple[float, bytes]] = deque()
        self.force = ZERO
        """Commanded [N, axes of the service]."""
        self.commanded_at = -inf
        self.gate: float | None = None
        self.preset: str | None = None
        self.profile = ""
        self._say({"session_id": number, **service.document(self, full=True)}, now)

    def receive(self, text: bytes, now: float) -> None:
        self._service.messages += 1
        try:
            message = decode(text)
            full = "force_render_full_state" in message.get("session", {})
            self._take(message, now)
        except (BadReply, LookupError, ValueError, TypeError, AttributeError):
            full = False  # a message that it does not understand is answered, and has no effect
        self._service.advance_force(now)
        self._say(self._service.document(self, full=full), now)

    def replies(self, now: float) -> list[bytes]:
        due = []
        while self._replies and self._replies[0][0] <= now:
            due.append(self._replies.popleft()[1])
        return due

    def next_timer(self) -> float | None:
        return self._replies[0][0] if self._replies else None

    def leave(self) -> None:
        self._service.sessions.remove(self)

    def _take(self, message: dict[str, Any], now: float) -> None:
        if self._service.has_sessions:
            configured = message.get("session", {}).get("configure", {})
            self.profile = configured.get("profile", {}).get("name", self.profile)
        for each in listed(message, "inverse3"):
            if each.get("device_id") == self._service.device_id:
                wishes = each.get("configure", {}) if self._service.has_sessions else {}
                if "preset" in wishes:
                    self.preset = str(wishes["preset"]["preset"])
                if "force_gate" in wishes:
                    self.gate = float(wishes["force_gate"]["gain"])
                self._command(each.get("commands", {}), now)

    def _command(self, commands: dict[str, Any], now: float) -> None:
        wanted = commands.get("set_cursor_force")
        if wanted is None:
            return
        force = wanted.get("vector") if self._service.has_sessions else None
        force = wanted["values"] if force is None else force  # 3.5 still takes the older key
        wanted_n = (float(force["x"]), float(force["y"]), float(force["z"]))
        if not is_finite(wanted_n):
            raise ValueError("a force that is not finite")
        self.force, self.commanded_at = wanted_n, now

    def _say(self, document: dict[str, Any], now: float) -> None:
        self._replies.append((now + self._service.answer_s, json.dumps(document).encode()))


class Inverse3Emulator(Emulator):
    """The service and its device; see `weberlink_devices.inverse3.websocket_device.Service`.

    Forces of all sessions add. A command is displayed until the next one, until its session ends, or for the time-out.
    """

    Options: ClassVar[type[BaseModel]] = Inverse3EmulatorOptions
    transport: ClassVar[str] = "websocket"
    OWN_FAULTS: ClassVar[Mapping[str, str]] = {
        "restart": "the service is started again: all connections are closed; any value",
        "lost": "the device is not listed any more; 0: it is again",
        "unready": "the device says that it is not ready; 0: it is",
        "asleep": "the grip is not listed any more; 0: it is again",
        "push": "another program pushes up with so many newtons; 0: no more",
        "oscillation": "the force gate takes forces for an oscillation; 0: no more",
        "button": "the buttons whose bits are set are held; 0: none",
    }

    def __init__(self, options: Inverse3EmulatorOptions) -> None:
        super().__init__()
        self.handle = Handle(options.handle)
        self.tcp_port = options.tcp_port
        self.device_id = options.device_id
        self.answer_s = options.answer_ms * 1e-3
        self.has_sessions = options.version == "3.5"
        self.sessions: list[Inverse3Session] = []
        self.force: Vector = ZERO
        """On the hand [N, our axes]."""
        self.most_force_n = 0.0
        """Largest force so far [N]."""
        self.messages = 0
        """Number of messages of all sessions."""
        self._options = options
        self._joined = 0
        self._drops = False
        self._moved_at = -inf
        self._states = dict.fromkeys(self.OWN_FAULTS, 0.0)

    def apply_fault(self, name: str, value: float) -> None:
        self._drops |= name == "restart"
        self._states[name] = value

    def join(self, now: float) -> Inverse3Session:
        self._joined += 1
        session = Inverse3Session(self, self._joined, now)
        self.sessions.append(session)
        return session

    def served(self, begin: Callable[[], object]) -> WebSocketDevice:
        """The service on its port of the loopback interface."""
        return WebSocketDevice(self, self.tcp_port, begin=begin)

    def drops_connections(self) -> bool:
        drops, self._drops = self._drops, False
        return drops

    def get(self, path: str) -> str | None:
        if path == "/version":
            version = f"{self._options.version}.0"
            return json.dumps({"project_name": "haply-inverse-service", "project_version": f"{version}.0"})
        if path == "/devices":
            return json.dumps({"inverse3": self._devices(None, full=True)})
        return None

    def advance(self, now: float) -> None:
        super().advance(now)
        self.advance_force(now)
        if now - self._moved_at >= STEP_S:
            self._moved_at = now
            self.handle.advance(self.force, now)

    def next_timer(self) -> float | None:
        return self._moved_at + STEP_S

    def advance_force(self, now: float) -> None:
        """The sum of what all sessions command now, through the force gate."""
        total = (0.0, 0.0, self._states["push"])
        for session in self.sessions:
            if now - session.commanded_at <= self._options.time_out_ms * 1e-3:
                total = add(total, scale(ours(session.force), self._gain(session)))
        self.force = total
        self.most_force_n = max(self.most_force_n, norm(total))

    def document(self, session: Inverse3Session | None, *, full: bool) -> dict[str, Any]:
        """A state of all devices, with their configuration if it is `full`."""
        grip = self._options.grip
        away = self._states["asleep"] or grip == "none"
        grips: list[dict[str, Any]] = [] if away else [{"device_id": "6A1F", "state": self._grip()}]
        return {"inverse3": self._devices(session, full=full), grip: grips}

    def _gain(self, session: Inverse3Session) -> float:
        if not self._states["oscillation"]:
            return 1.0
        return self._options.force_gate if session.gate is None else session.gate

    def _devices(self, session: Inverse3Session | None, *, full: bool) -> list[dict[str, Any]]:
        if self._states["lost"]:
            return []
        config = {"config": self._config(session)} if full else {}
        return [{"device_id": self.device_id, **config, "state": self._state(), "status": self._status(session)}]

    def _status(self, session: Inverse3Session | None) -> dict[str, bool]:
        others = any(each is not session and each.force != ZERO for each in self.sessions)
        in_use = others or self._states["push"] != 0.0
        return {**SOUND, "in_use": in_use, "ready": not self._states["unready"]}

    def _state(self) -> dict[str, Any]:
        idle = self.force == ZERO
        return {
            "cursor_position": _named(theirs(self.handle.position)),
            "cursor_velocity": _named(ZERO),
            "current_cursor_force": _named(theirs(self.force)),
            "control_domain": "undefined" if idle else "cartesian",
            "control_mode": "idle" if idle else "force",
        }

    def _config(self, session: Inverse3Session | None) -> dict[str, Any]:
        gate, preset = (None, None) if session is None else (session.gate, session.preset)
        return {
            "type": "inverse3",
            "handedness": "right",
            "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
            "preset": preset or "defaults",
            "basis": {"permutation": "XYZ"},
            "mount": {"position": _named(ZERO), "rotation": dict(LEVEL), "scale": dict(SCALE)},
            "filters": {
                "force_gate": {"gain": self._options.force_gate if gate is None else gate},
                "damping": {"scalar": 0.0},
            },
        }

    def _grip(self) -> dict[str, Any]:
        held, half = int(self._states["button"]), 0.5 * NOD_RAD * sin(max(0.0, self._moved_at))
        turn = {"w": cos(half), "x": sin(half), "y": 0.0, "z": 0.0}
        if self._options.grip == "verse_grip":
            return {"orientation": turn, "button": bool(held & 1), "hall": 0}
        return {"orientation": turn, "buttons": {name: bool(held >> bit & 1) for bit, name in enumerate("abc")}}


def _named(vector: Vector) -> dict[str, float]:
    return dict(zip("xyz", vector, strict=True))
