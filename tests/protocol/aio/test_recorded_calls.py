"""A real port of a slave that was just started, under 20,000 calls a second from another process."""

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import pytest
import uvloop

from tests.protocol.aio.test_udp import ANY, make, until
from tests.protocol.test_recorded_calls import RATE, forged, recorded
from weberlink.protocol import Connected, Role, State
from weberlink.protocol.aio import UdpShell

pytestmark = pytest.mark.realtime

SECONDS = 5.0
LIMIT_S = 3.0


@contextmanager
def in_real_time() -> Iterator[None]:
    """As the daemons run, where it is permitted: what else runs here is not what is measured."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
    except PermissionError:
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)


@contextmanager
def flood(target: tuple[str, int], datagrams: list[bytes], path: Path) -> Iterator[subprocess.Popen[str]]:
    order = {
        "target": target,
        "source": ("127.0.0.3", 0),
        "spoof": False,
        "rate": RATE,
        "seconds": SECONDS,
        "datagrams": [data.hex() for data in datagrams],
    }
    path.write_text(json.dumps(order), encoding="ascii")
    command = [sys.executable, "-m", "tests.soak.volley", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as gun:
        assert gun.stdout is not None
        assert gun.stdout.readline() == "ready\n"
        try:
            yield gun
        finally:
            gun.kill()


async def call_under_fire(datagrams: list[bytes], path: Path) -> tuple[float, dict[str, int]]:
    """Time from the master's first HELLO until both ends are engaged [s], and what the slave dropped."""
    loop = asyncio.get_running_loop()
    slave = make(Role.RESPONDER)
    listening = UdpShell(slave, now=monotonic, listen=ANY)
    await listening.open(loop)
    slave.connect(monotonic())
    with flood(listening.address, datagrams, path):
        while slave.statistics.drops < 100:
            await asyncio.sleep(0.01)
        began = monotonic()
        master = make(Role.INITIATOR, peer=("127.0.0.1", listening.address[1]))
        calling = UdpShell(master, now=monotonic)
        await calling.open(loop)
        master.connect(monotonic())
        calling.flush(monotonic())
        async with asyncio.timeout(LIMIT_S):
            await until(slave, Connected, [])
            await until(master, Connected, [])
        took = monotonic() - began
        assert master.state is slave.state is State.ENGAGED
    for shell in (calling, listening):
        shell.close()
    return took, {str(reason): count for reason, count in slave.statistics.dropped.items()}


@pytest.mark.parametrize("kind", ["recorded", "forged"])
def test_a_session_begins_while_20000_calls_a_second_arrive(kind: str, tmp_path: Path) -> None:
    datagrams = recorded(6_000) if kind == "recorded" else forged(1_000)
    with in_real_time(), asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        _, dropped = runner.run(call_under_fire(datagrams, tmp_path / "order.json"))
    assert sum(dropped.values()) > 100
