"""The dialogue with the Haply Inverse Service in lock-step: a force out, a state in.

The service answers each message with exactly one, in their order, over a connection that loses nothing. So the answer
to a message is the last one once none is owed.
"""

from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import monotonic, sleep
from typing import Any, NamedTuple

from weberlink.geometry.vector import ZERO, Vector, norm, scale, subtract
from weberlink.hardware.fault import BadReply, HardwareFault
from weberlink.hardware.guardian import Guardian
from weberlink.master.devices.contract import DeviceReading
from weberlink_devices.inverse3.filters import ForceComparison, ServiceSettings, settings_of
from weberlink_devices.inverse3.http_requests import service_version
from weberlink_devices.inverse3.options import Inverse3Options
from weberlink_devices.inverse3.protocol import (
    OLDEST,
    VECTOR_SINCE,
    CommandWriter,
    ForceKey,
    ServiceState,
    choose,
    decode,
    state_of,
    theirs,
)
from weberlink_devices.inverse3.websocket_port import WebSocketPort, text_frame

OPENING_S = 1.0
"""Longest wait for the connection, for the inventory and for the first state [s]."""
CLOSING_S = 0.05
ABSENT = "is the Haply Inverse Service running? Haply Hub starts it"


class ServiceExchange:
    """Commands are forces [N] in the frame of the device.

    Args:
        options: of the driver.
        guardian: takes the force off when this process stops; None for a device without force.
    """

    def __init__(self, options: Inverse3Options, guardian: Guardian | None = None) -> None:
        self.guardian = guardian
        self._options = options
        self._port: WebSocketPort | None = None
        self._writer = CommandWriter("", "vector")
        self._comparison = ForceComparison()
        self._owed = 0
        self._recovers = False
        """Whether the last answer was missing; the next one must be in time, however slow this host is."""
        self._id: str | None = None
        self.settings = ServiceSettings()
        """Those of the last connection."""
        self.alteration: str | None = None
        """How the displayed force differs from the commanded one; None while it does not."""
        self.grip_trouble: str | None = None
        """Why readings lack the orientation although there should be a grip."""

    def start_afresh(self) -> None:
        """Take whichever device is there, at the next `open`."""
        self._id = None

    def open(self) -> DeviceReading:
        self.close()
        address = self._options.address
        try:
            key = self._key()
            self._port = WebSocketPort(address, OPENING_S)
            return self._begin(self._port, key)
        except HardwareFault as fault:
            self.close()
            said = str(fault).removeprefix(f"{address}: ")
            advice = f"; {ABSENT}" if said == "nothing listens there" else ""
            raise HardwareFault(f"{address}: {said}{advice}") from None

    def exchange(self, force: Vector) -> DeviceReading:
        if self._port is None:
            raise HardwareFault("not open")
        rests = force == ZERO
        state = self._ask(self._writer.force(ZERO if rests else theirs(force)), self._options.reply_ms * 1e-3, rests)
        said = self._comparison.judge(force, state.displayed)
        self.alteration = said and f"{said}: another program adds to it, or a filter ({self.settings.filters})"
        return self._reading(state)

    def probe(self) -> ServiceState:
        """A state without a command."""
        return self._ask(self._writer.probe(), OPENING_S, rest=True)

    def close(self) -> None:
        """Command zero force, and wait for the answer, which confirms it."""
        port = self._port
        if port is None:
            return
        try:
            with suppress(HardwareFault):
                self._ask(self._writer.force(ZERO), CLOSING_S, rest=True)
        finally:
            self._port = None
            port.close()

    def _begin(self, port: WebSocketPort, key: ForceKey) -> DeviceReading:
        device = choose(decode(self._next(port, OPENING_S)), self._id or self._options.device_id)
        self._id = device_id = device["device_id"]
        if not self._options.shared and (device.get("status") or {}).get("in_use") is True:
            raise HardwareFault(
                f"another program uses device {device_id}, and forces add; end that program, "
                "or set master.device.shared: true"
            )
        self._writer = CommandWriter(device_id, key)
        self._owed = 0
        if self.guardian is not None:
            self.guardian.zero = text_frame(self._writer.force(ZERO))
            port.guard(self.guardian)
        port.send(self._writer.first(self._wishes(key)), rest=True)
        message = decode(self._next(port, OPENING_S))
        state = state_of(message, device_id, self._options.grip)
        self.settings = self._settings(message, device)
        self.settings.check()
        self._comparison, self.alteration = ForceComparison(), None
        return self._reading(state)

    def _key(self) -> ForceKey:
        if self._options.force_key != "auto":
            return self._options.force_key
        version = service_version(self._options.address)
        if version is None:
            WebSocketPort(self._options.address, OPENING_S).close()  # says so where nobody is there
            raise HardwareFault(
                "the service does not say its version; set master.device.force_key: vector for 3.5 and later, "
                "values for 3.1 to 3.4"
            )
        if version < OLDEST:
            raise HardwareFault(f"the service is version {version[0]}.{version[1]}, and 3.1 is the least; update it")
        return "vector" if version >= VECTOR_SINCE else "values"

    def _wishes(self, key: ForceKey) -> dict[str, Any]:
        """Settings of this session alone; services before 3.5 have none."""
        if key != "vector":
            return {}
        preset, gate = self._options.preset, self._options.force_gate
        return {
            **({} if preset is None else {"preset": {"preset": preset}}),
            **({} if gate is None else {"force_gate": {"gain": gate}}),
        }

    def _settings(self, message: dict[str, Any], inventoried: dict[str, Any]) -> ServiceSettings:
        """Those of the full state, or of the inventory where the service gives none."""
        there = [each for each in message["inverse3"] if each.get("device_id") == self._id and "config" in each]
        return settings_of(there[0] if there else inventoried)

    def _ask(self, text: str, patience: float, rest: bool) -> ServiceState:
        """Send a message, and take the state that answers it."""
        port = self._port
        assert port is not None
        if self.guardian is not None:
            self._owed += self.guardian.new_writes()  # the service answers each of its messages too
        while port.receive(0.0) is not None:  # late ones, and such that nobody owes
            self._owed = max(0, self._owed - 1)
        asked, answer = monotonic(), b""
        port.send(text, rest=rest)
        self._owed += 1
        while self._owed:
            heard = port.receive(asked + patience)
            if heard is None:
                self._recovers = True
                raise BadReply(f"no answer within {patience * 1e3:g} ms")
            self._owed, answer = self._owed - 1, heard
        if self._recovers and (elapsed := monotonic() - asked) > patience:  # else a stalled host took its time
            raise BadReply(f"answered after {elapsed * 1e3:.0f} ms instead of {patience * 1e3:g}")
        self._recovers = False
        return state_of(decode(answer), self._id or "", self._options.grip)

    @staticmethod
    def _next(port: WebSocketPort, patience: float) -> bytes:
        heard = port.receive(monotonic() + patience)
        if heard is None:
            raise HardwareFault("accepts the connection, but says nothing")
        return heard

    def _reading(self, state: ServiceState) -> DeviceReading:
        grip = self._options.grip
        away = grip != "none" and state.orientation is None
        self.grip_trouble = f"no {grip}: it is away or asleep" if away else None
        position = subtract(state.position, self._options.origin_m)
        return DeviceReading(monotonic(), position, orientation=state.orientation, buttons=state.buttons)


PUSH_S = 0.15
STEP_S = 0.001
SILENCES_S = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class TimeOut(NamedTuple):
    """How long a force stands without commands [s]: after `longest` it was there, after `shortest` it was not."""

    longest: float
    shortest: float
    settings: ServiceSettings


def measure_time_out(options: Inverse3Options, force: Vector, wait: Callable[[float], object] = sleep) -> TimeOut:
    """Push, fall silent for longer and longer, and ask each time whether the force still stands.

    The service displays a command until it takes it for old; its documentation names no time. There must be no guardian
    meanwhile: it would end the force.

    Args:
        options: of the driver.
        force: of the push [N]; somebody holds the handle.
        wait: for a time [s].

    Raises:
        HardwareFault: the device cannot be used, or the service does not say what it displays.
    """
    exchange = ServiceExchange(options)
    exchange.open()
    longest = 0.0
    try:
        for silence in SILENCES_S:
            for step in range(round(PUSH_S / STEP_S)):
                exchange.exchange(scale(force, min(1.0, 2.0 * (step + 1) * STEP_S / PUSH_S)))
                wait(STEP_S)
            wait(silence)
            displayed = exchange.probe().displayed
            if displayed is None:
                raise HardwareFault("the service does not say what force it displays")
            if norm(displayed) < 0.5 * norm(force):
                return TimeOut(longest, silence, exchange.settings)
            longest = silence
    finally:
        exchange.close()
    return TimeOut(longest, inf, exchange.settings)
