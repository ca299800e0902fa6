"""Send datagrams to one address at a given rate, from a process of its own, and count the answers.

Paced by the millisecond. With `spoof` it writes the IP and UDP headers itself, which takes root, so that the datagrams
seem to come from `source`.
"""

import json
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

Address = tuple[str, int]

PRIORITY = 30
"""Of SCHED_FIFO, below the daemons and the relay: a flood from elsewhere does not wait for a processor of this host."""
_PACE = 0.001
_LONGEST_DEBT = 0.05
"""What a stall of this process may make up for at once [s]; the rest of it is not sent."""


def spoofed(data: bytes, source: tuple[str, int], target: tuple[str, int]) -> bytes:
    """An IPv4 packet with a UDP datagram that says it comes from `source`; the kernel fills in the IP checksum."""
    size = 8 + len(data)
    addresses = socket.inet_aton(source[0]) + socket.inet_aton(target[0])
    head = struct.pack("!BBHHHBBH", 0x45, 0, 20 + size, 0, 0, 64, socket.IPPROTO_UDP, 0) + addresses
    return head + struct.pack("!HHHH", source[1], target[1], size, 0) + data  # no UDP checksum, which IPv4 permits


def fire(order: dict[str, Any]) -> dict[str, Any]:
    """Send as ordered; returns what was sent, and what was answered."""
    target, source = tuple(order["target"]), tuple(order["source"])
    rate, seconds, hears = order["rate"], order["seconds"], not order["spoof"]
    datagrams = [bytes.fromhex(text) for text in order["datagrams"]]
    sizes = [len(data) for data in datagrams]
    if hears:
        gun = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        gun.bind(source)
        gun.setblocking(False)
    else:
        gun = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW)
        datagrams = [spoofed(data, source, target) for data in datagrams]
    sent = sent_bytes = 0
    answers: list[int] = []
    began = monotonic()
    forgiven = 0.0
    while (now := monotonic()) < began + seconds:
        due = int((now - began - forgiven) * rate)
        if due - sent > rate * _LONGEST_DEBT:
            forgiven += (due - sent) / rate - _LONGEST_DEBT
            due = int((now - began - forgiven) * rate)
        for number in range(sent, due):
            try:
                gun.sendto(datagrams[number % len(datagrams)], target)
            except BlockingIOError:
                break
            sent, sent_bytes = number + 1, sent_bytes + sizes[number % len(sizes)]
        answers += _heard(gun) if hears else []
        sleep(_PACE)
    lasted = monotonic() - began
    sleep(0.2)
    answers += _heard(gun) if hears else []
    gun.close()
    return {
        "sent": sent,
        "sent_bytes": sent_bytes,
        "seconds": lasted,
        "answers": len(answers) if hears else None,
        "answered_bytes": sum(answers),
        "longest_answer": max(answers, default=0),
        "shortest_question": min(sizes),
    }


def _heard(gun: socket.socket) -> list[int]:
    sizes = []
    while True:
        try:
            sizes.append(len(gun.recv(65_535)))
        except (BlockingIOError, ConnectionError):
            return sizes


@contextmanager
def volley(
    folder: Path,
    datagrams: Sequence[bytes],
    target: Address,
    source: Address,
    rate: int,
    seconds: float,
    *,
    spoof: bool,
) -> Iterator[subprocess.Popen[bytes]]:
    """A process that fires; it has begun, and prints its figures as JSON when it ends by itself."""
    order = {"target": target, "source": source, "spoof": spoof, "rate": rate, "seconds": seconds}
    path = folder / "order.json"
    path.write_text(json.dumps(order | {"datagrams": [data.hex() for data in datagrams]}), encoding="ascii")
    with subprocess.Popen([sys.executable, "-m", "trials.soak.volley", str(path)], stdout=subprocess.PIPE) as gun:
        try:
            assert gun.stdout is not None
            gun.stdout.readline()
            yield gun
        finally:
            gun.kill()


def main() -> None:
    order = json.loads(Path(sys.argv[1]).read_text(encoding="ascii"))
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdout.write(json.dumps(fire(order)))


if __name__ == "__main__":
    main()
