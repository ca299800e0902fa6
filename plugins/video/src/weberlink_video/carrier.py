"""Carries pictures from the robot's host to the operator's: a session of its own, by the same keys and paths.

The link is that of `weberlink.protocol`, so that keys, new addresses, lost paths and clocks are dealt with as those of
the session that moves the robot. Each host is served at a place of its own: the operator's at the first one, by a key
that may drive, and watchers at the others, by keys that may watch.
"""

import asyncio
import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from time import monotonic, time_ns
from typing import Any, Final

from weberlink.config import MASTER, SLAVE, Configuration
from weberlink.config.finders import PathFinder, finder_of, finding
from weberlink.config.model import split_address
from weberlink.protocol import Endpoint, Event, LocalEnd, Role
from weberlink.protocol.aio.udp import UdpShell, peer_address
from weberlink.protocol.events import Connected, Refused, TakenOver, UpdateReceived
from weberlink.protocol.keys import HeldKey, Right
from weberlink.protocol.security import Checksum, Security
from weberlink.session.composition.link import acquaintance, default_name, held_keys
from weberlink.session.daemon import emulated_link
from weberlink.session.key_watch import KeyWatch
from weberlink.update import ModelParameters, Update, UpdateForm
from weberlink_figures.pictures import Picture, pack, split
from weberlink_video.hub import Hub
from weberlink_video.jpeg import check
from weberlink_video.options import VideoOptions
from weberlink_video.stream import FORM_BYTES, REPORT_BYTES, Receiver, Sender

TICK_S: Final = 1e-3
SILENCE_S: Final = 1.0
LONGEST_ROUND_TRIP_S: Final = 2.0
LARGEST_AGE_S: Final = 60.0  # of a picture; one of another age, on whatever clock, is none of a camera
LOOK_S: Final = 0.002
IDLE_LOOK_S: Final = 0.02
CLASS: Final = 8  # class of service of pictures: lower than that of all other traffic (CS1, RFC 8325)
AGREEMENT: Final = {"pictures": 1}
STREAM: Final = "pictures"


def watching_keys(keys: Iterable[HeldKey]) -> list[HeldKey]:
    """Keys as this link holds them: who may watch may have its session; who may stop is refused in words."""
    return [key._replace(right=Right.DRIVE) if key.right.allows(Right.WATCH) else key for key in keys]


def robots_security(configuration: Configuration, finder: PathFinder | None, *, watches: bool) -> tuple[Security, Any]:
    """The suite of the robot's end, and where its keys are and what reads them; None for it without a key."""
    link = configuration.system.link
    path = link.key_file
    if finder is None and (link.security == "none" or path is None):
        return Checksum(), None
    from weberlink.protocol.psk import Keyring  # noqa: PLC0415 - only where there is a key

    where, read = (path, partial(held_keys, path)) if finder is None else finder.stored_keys()  # type: ignore[arg-type]

    def held() -> list[HeldKey]:
        return watching_keys(read()) if watches else list(read())

    return Keyring(held()), (where, held)


class Carrier:
    """One end of the link of the pictures.

    Args:
        side: of this host; `MASTER` for a watcher too.
        hub: from which the robot's end takes what it sends, or to which the other end gives it.
        place: 0 for the operator, from 1 for watchers.
        served: the carriers of all places of the robot's end, among which the bandwidth is shared.
    """

    def __init__(
        self, configuration: Configuration, side: str, hub: Hub, place: int = 0, served: "Sequence[Carrier]" = ()
    ) -> None:
        self._configuration, self._side, self._hub = configuration, side, hub
        self._place, self._served = place, served
        assert configuration.cameras is not None
        self._options: VideoOptions = configuration.cameras.options  # type: ignore[assignment]
        self._epoch = monotonic()
        self._finder = finder_of(configuration, side)
        self._keys: Any = None
        self._security: Any = None
        self.endpoint = self._build()
        self._sender, self._receiver = Sender(self._options.most_kbit_s * 1e3), Receiver()
        self._cameras: list[str] = []
        self._ended = False
        self._stood = 0.0
        self._no_path = ""

    def _build(self) -> Endpoint:
        link = self._configuration.system.link
        pictures, reports = [[UpdateForm((1,), None, FORM_BYTES)]], [[UpdateForm((1,), None, REPORT_BYTES)]]
        common: dict[str, Any] = {
            "agreement": AGREEMENT,
            "entropy": os.urandom,
            "epoch": self._epoch,
            "tick_period": TICK_S,
            "silence": SILENCE_S,
            "longest_round_trip": LONGEST_ROUND_TRIP_S,
        }
        finder = self._finder
        if self._side == SLAVE:
            self._security, self._keys = robots_security(self._configuration, finder, watches=self._place > 0)
            own = link.names.slave or (finder.own if finder else default_name(SLAVE, link.listen))
            robot = LocalEnd(
                Role.RESPONDER, outgoing=pictures, incoming=reports, security=self._security, name=own, **common
            )
            return Endpoint(robot)
        security, own, expects = acquaintance(self._configuration, MASTER, finder)
        peer = peer_address(expects) if self._configuration.finds_path else self._address(link.slave)
        operator = LocalEnd(
            Role.INITIATOR, outgoing=reports, incoming=pictures, security=security, name=link.names.master or own,
            expects=link.names.slave or expects, take_over=self._place == 0, stamp=lambda _now: time_ns(), **common,
        )  # fmt: skip
        return Endpoint(operator, peer)

    def _address(self, of_link: str) -> tuple[str, int]:
        return split_address(of_link)[0], self._options.port + self._place

    def put(self, picture: Picture) -> None:
        """Send a picture, where somebody watches."""
        if picture.camera not in self._cameras:
            self._cameras.append(picture.camera)
        at_us = round((picture.at - self._epoch) * 1e6)
        self._sender.put(self._cameras.index(picture.camera), pack(picture), picture.at, at_us)

    def end(self) -> None:
        self._ended = True

    async def run(self) -> str:
        """Carry until `end`; returns why the other end does not want pictures, or ""."""
        link, listens = self._configuration.system.link, self._side == SLAVE
        with ExitStack() as stack:
            stream = f"{STREAM} {self._place}" if self._place else STREAM
            paths = stack.enter_context(finding(self._configuration, self._finder, take_over=True, stream=stream))
            emulated = emulated_link(self._side, self._configuration.system, self._epoch)
            shell = UdpShell(
                self.endpoint,
                now=monotonic,
                link=None if emulated is None else emulated.link,
                listen=self._address(link.listen) if listens else ("", 0),
                dscp=CLASS,
                paths=paths,
                on_no_path=self._on_no_path,
            )
            loop = asyncio.get_running_loop()
            await shell.open(loop)
            stack.callback(shell.close)
            if self._keys is not None:
                where, read = self._keys
                watch = KeyWatch(where, read, self._security, self.endpoint)
                watch.open(loop)
                stack.callback(watch.close)
            self.endpoint.connect(monotonic())
            looked_at = monotonic()
            while not self._ended:
                self._stood, looked_at = monotonic() - looked_at - LOOK_S, monotonic()
                shell.service()
                if self._no_path:
                    return self._no_path
                while (event := self.endpoint.next_event()) is not None:
                    if isinstance(event, Refused | TakenOver) and not listens:
                        return event.message if isinstance(event, Refused) else f"{event.name} watches now"
                    self._on_event(event)
                now = monotonic()
                self._send(now)
                shell.flush(now)
                await asyncio.sleep(IDLE_LOOK_S if self.endpoint.clock.rtt is None else LOOK_S)
            self.endpoint.close(monotonic(), "the session ends")
        return ""

    def _on_no_path(self, why: str) -> None:
        self._no_path = why

    def _on_event(self, event: Event) -> None:
        now = monotonic()
        if isinstance(event, Connected):
            self._sender, self._receiver = Sender(self._options.most_kbit_s * 1e3), Receiver()
            for picture in self._hub.newest.values() if self._side == SLAVE else ():
                self.put(picture if picture.jpeg else picture._replace(at=now))
        elif isinstance(event, UpdateReceived) and isinstance(event.update.payload, ModelParameters):
            data = event.update.payload.data
            if self._side == SLAVE:
                self._sender.hear(data, now)
            elif (whole := self._receiver.take(data, event.age, now, max(0.0, self._stood))) is not None:
                self._give(*whole, now)

    def _give(self, message: bytes, at_us: int, now: float) -> None:
        """Show a picture of the robot's host, if it is one, with its moment on the clock of this host."""
        peer_time = self.endpoint.clock.peer_time(now)
        try:
            (picture,), rest = split(message)
            if picture.jpeg:
                check(picture.jpeg)
        except ValueError:
            return
        age = LARGEST_AGE_S if peer_time is None else peer_time - at_us * 1e-6
        if abs(age) < LARGEST_AGE_S and not rest and (picture.camera + picture.note).isprintable():
            self._hub.put(picture._replace(at=now - age))

    def _send(self, now: float) -> None:
        """Send what may leave now."""
        if self._side == SLAVE:
            shared_by = sum(carrier.endpoint.clock.rtt is not None for carrier in self._served)
            self._sender.most_bit_s = self._options.most_kbit_s * 1e3 / max(1, shared_by)
            for fragment in self._sender.take(now) if self.endpoint.clock.rtt is not None else ():
                self._update(fragment, now)
        elif (report := self._receiver.report(now, self.endpoint.clock.rtt or 0.0)) is not None:
            self._update(report, now)

    def _update(self, data: bytes, now: float) -> None:
        tick = round((now - self._epoch) / TICK_S)
        self.endpoint.send_update(now, Update(tick, 0, (0,), ModelParameters(data)))
