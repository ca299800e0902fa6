"""Lateness and one-way delay with a path found by ICE, beside a direct one.

Both are live sessions of two daemons on this host, with the same keys and every sample sent, and take turns, so that
other load of the machine affects both alike. The mailbox server is that of the package magic-wormhole-mailbox-server,
on loopback.

    python -m benchmarks.paths --seconds 10 --rounds 5
"""

import argparse
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Any

import numpy as np

from benchmarks.arrangement import MAIN_RATE_HZ, Arrangement, BenchError
from benchmarks.live_run import live_run
from benchmarks.live_side import LiveSide
from benchmarks.percentiles import Series, Summary, ratios, summary
from weberlink.anywhere.peers import Peer, PeerStore
from weberlink.protocol.keys import KEY_BYTES
from weberlink.system.configuration import SIDES
from weberlink.system.environment import environment, footer

CONFIGS = Path(__file__).parents[1] / "configs"
HOST = "127.0.0.1"
START_S = 20.0
"""Time that the mailbox server has to listen."""
EVERY_SAMPLE = ("codec.force.weber=0", "codec.force.floor_n=0", "codec.position.weber=0", "codec.position.bound_m=0")
WAYS: dict[str, tuple[str, ...]] = {
    "direct": (),
    "ice": ("link.path=ice",),
    "ice, two": ("link.path=ice", "link.paths=2"),
}
FIGURES = ("lateness_us", "one_way_us", "work_us")


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port


@contextmanager
def mailbox() -> Iterator[str]:
    """A mailbox server; yields its address.

    Raises:
        BenchError: it does not start.
    """
    port = free_port(socket.SOCK_STREAM)
    command = [sys.executable, "-m", "twisted", "wormhole-mailbox", f"--port=tcp:{port}:interface={HOST}"]
    with (
        TemporaryDirectory() as folder,
        subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as server,  # noqa: S603
    ):
        try:
            _wait_for(port)
            yield f"ws://{HOST}:{port}/v1"
        finally:
            server.terminate()


def _wait_for(port: int) -> None:
    until = monotonic() + START_S
    while monotonic() < until:
        try:
            socket.create_connection((HOST, port), 1.0).close()
        except OSError:
            sleep(0.05)
        else:
            return
    raise BenchError("the mailbox server does not listen: is weberlink[anywhere] installed?")


def ports(_overrides: Sequence[str]) -> list[str]:
    port = free_port(socket.SOCK_DGRAM)
    return [f"link.listen={HOST}:{port}", f"link.slave={HOST}:{port}"]


def acquaint(folder: Path) -> None:
    """Make an operator and a robot known to each other; both sides read the same folder."""
    store, key = PeerStore(folder), os.urandom(KEY_BYTES)
    store.add(Peer("robot", "robot", "operator", "slave", key))
    store.add(Peer("operator", "operator", "robot", "master", key))


def measure(file: Path, seconds: float, rounds: int) -> dict[str, list[Mapping[str, LiveSide]]]:
    """Sessions of each way, in turns.

    Raises:
        BenchError: a session failed.
    """
    runs: dict[str, list[Mapping[str, LiveSide]]] = {way: [] for way in WAYS}
    with TemporaryDirectory() as folder, mailbox() as url:
        acquaint(Path(folder))
        common = ("link.security=peers", f"link.peer_store={folder}", f"link.mailbox={url}", *EVERY_SAMPLE)
        for _ in range(rounds):
            for way, changes in WAYS.items():
                arrangement = Arrangement(file, file, (*common, *changes), ports, seconds)
                runs[way].append(live_run(arrangement, MAIN_RATE_HZ, seconds))
    return runs


def figure(side: LiveSide, name: str) -> Series:
    """A figure of a side in every tick [us]; the delay once for each datagram that came."""
    if name == "lateness_us":
        return side.lateness_us
    values: Series = side.records[name]
    if name == "one_way_us":
        values = values[np.diff(side.records["datagrams_received"].astype(np.int64), prepend=0) > 0]
    return values[np.isfinite(values)]


def result(runs: Mapping[str, Sequence[Mapping[str, LiveSide]]]) -> dict[str, Any]:
    """By side and figure: percentiles of each way, their ratio to direct, and the median ratio of p50 in the turns."""
    return {side: {name: _compared(runs, side, name) for name in FIGURES} for side in SIDES} | {
        "missed_share": {
            way: {side: float(np.mean([turn[side].missed_share for turn in turns])) for side in SIDES}
            for way, turns in runs.items()
        },
        "paths": {way: turns[-1][SIDES[0]].summary["paths"] for way, turns in runs.items()},
    }


def _compared(runs: Mapping[str, Sequence[Mapping[str, LiveSide]]], side: str, name: str) -> dict[str, Any]:
    turns = {way: [summary(figure(turn[side], name)) for turn in sides] for way, sides in runs.items()}
    whole = {way: summary(np.concatenate([figure(turn[side], name) for turn in sides])) for way, sides in runs.items()}
    return {
        way: {"us": whole[way], "ratio": ratios(whole[way], whole["direct"]), "turns": _turns(turns, way)}
        for way in WAYS
    }


def _turns(turns: Mapping[str, Sequence[Summary]], way: str) -> dict[str, float]:
    """Median ratio to the direct session of the same turn."""
    pairs = list(zip(turns[way], turns["direct"], strict=True))
    return {
        name: median(found for one, other in pairs if (found := ratios(one, other)[name]) is not None)
        for name in ("p50", "p99")
    }


def lines(compared: Mapping[str, Any]) -> Iterator[str]:
    yield f"{'':24}{'p50':>8}{'p99':>8}{'p99.9':>8}{'max':>9}   beside direct, median of turns: p50, p99"
    for side in SIDES:
        for name in FIGURES:
            for way, found in compared[side][name].items():
                us, turns = found["us"], found["turns"]
                values = "".join(f"{us[each]:8.0f}" for each in ("p50", "p99", "p99_9"))
                yield (
                    f"{side:7}{name.removesuffix('_us'):9}{way:8}{values}{us['max']:9.0f}"
                    f"   {turns['p50']:.2f} {turns['p99']:.2f}"
                )
    for way, shares in compared["missed_share"].items():
        yield f"missed ticks, {way}: " + ", ".join(f"{side} {100 * share:.2f} %" for side, share in shares.items())


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="of each session")
    parser.add_argument("--rounds", type=int, default=3, help="sessions of each way")
    parser.add_argument("--file", type=Path, default=CONFIGS / "loopback.yaml", help="configuration")
    parser.add_argument("--json", type=Path, help="where to write all figures")
    asked = parser.parse_args()
    try:
        compared = result(measure(asked.file, asked.seconds, asked.rounds))
    except BenchError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    host = environment()
    sys.stdout.write("\n".join([*lines(compared), footer(host)]) + "\n")
    if asked.json is not None:
        asked.json.write_text(json.dumps(compared | {"environment": host}, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
