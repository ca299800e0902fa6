"""Which sessions of a host an emergency stop ends."""

import asyncio
from pathlib import Path

import pytest

from tests.watching.feeds import records, write
from weberlink.apps.monitor.watch import SessionWatcher
from weberlink.control.tuning import LiveSettings, Tuning
from weberlink.system.control_socket import ControlSocket
from weberlink.telemetry.ring import RingWriter

ENDED, FIRST, SECOND = "6", "7", "8"


class Daemon:
    """A side with its telemetry and its control socket, which notes that it was stopped."""

    def __init__(self, folder: Path, session: str, side: str) -> None:
        path = folder / f"weberlink-{session}-{side}.ring"
        self.ring = RingWriter.create(path, side=side, rate_hz=1000.0, capacity=64)
        write(self.ring, records(20, first=0))
        self.tuning = Tuning(LiveSettings(0.1, "zoh"), {}, lambda *_: None)
        self.is_halted = False
        self.control = ControlSocket(path, self)
        self.control.open(asyncio.get_running_loop())

    def propose(self, change: object, now: float) -> str | None:
        raise AssertionError(change)

    def stop(self, now: float, reason: str) -> None:
        raise AssertionError(reason)

    def emergency(self, now: float) -> None:
        self.is_halted = True

    def close(self) -> None:
        self.control.close()
        self.ring.close()


@pytest.mark.parametrize(
    ("name", "halted"),
    [
        (FIRST, {FIRST}),
        (SECOND, {SECOND}),
        (None, {FIRST, SECOND}),
        ("", {FIRST, SECOND}),
        ("1234", {FIRST, SECOND}),
        (ENDED, {FIRST, SECOND}),
    ],
)
def test_an_emergency_stop_ends_the_named_session_or_all_if_it_does_not_run(
    tmp_path: Path, name: str | None, halted: set[str]
) -> None:
    async def run() -> None:
        watch = SessionWatcher(tmp_path, None, lambda _: None)
        over = Daemon(tmp_path, ENDED, "slave")
        watch.look(0.0)
        over.close()
        daemons = {
            (session, side): Daemon(tmp_path, session, side)
            for session in (FIRST, SECOND)
            for side in ("master", "slave")
        }
        watch.look(10.0)
        assert watch.sessions[ENDED].ended
        answer = await watch.emergency(name)
        assert {session for (session, _), daemon in daemons.items() if daemon.is_halted} == halted
        assert all(daemon.is_halted for (session, _), daemon in daemons.items() if session in halted), "at both ends"
        assert answer["accepted"]
        for daemon in daemons.values():
            daemon.close()
        for session in watch.sessions.values():
            session.close()

    asyncio.run(run())
