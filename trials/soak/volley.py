"""Send datagrams to one address at a given rate, from a process of its own, and count the answers.

64 datagrams per system call (sendmmsg), paced by the millisecond. With `spoof` it writes the IP and UDP headers itself,
which takes root, so that the datagrams seem to come from `source`.
"""

import ctypes
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

BATCH = 64
PRIORITY = 30
"""Of SCHED_FIFO, below the daemons and the relay: a flood from elsewhere does not wait for a processor of this host."""
_PACE = 0.001
_LONGEST_DEBT = 0.05  # what a stall of this process may make up for at once [s]; the rest of it is not sent


class _Vector(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


class _Message(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_length", ctypes.c_uint32),
        ("vectors", ctypes.POINTER(_Vector)),
        ("vector_count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_length", ctypes.c_size_t),
        ("flags", ctypes.c_int),
        ("_", ctypes.c_int),  # a msghdr of its own ends here, on the boundary of its pointers
        ("sent", ctypes.c_uint),
    )


class Magazine:
    """Datagrams laid out for sendmmsg, all to one address."""

    def __init__(self, datagrams: list[bytes], target: tuple[str, int]) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        host, port = target
        name = struct.pack("=HH4s8x", socket.AF_INET, socket.htons(port), socket.inet_aton(host))
        self._name = ctypes.create_string_buffer(name, len(name))
        self._buffers = [ctypes.create_string_buffer(data, len(data)) for data in datagrams]
        self.sizes = [len(data) for data in datagrams]
        self._vectors = (_Vector * len(datagrams))()
        self._messages = (_Message * len(datagrams))()
        for index, buffer in enumerate(self._buffers):
            self._vectors[index] = _Vector(ctypes.addressof(buffer), len(buffer))
            message = self._messages[index]
            message.name, message.name_length = ctypes.addressof(self._name), len(name)
            message.vectors = ctypes.pointer(self._vectors[index])
            message.vector_count = 1

    def fire(self, descriptor: int, first: int, count: int) -> int:
        """Send up to `count` from `first` on; returns how many the kernel took."""
        count = min(count, len(self.sizes) - first)
        sent = self._libc.sendmmsg(descriptor, ctypes.byref(self._messages[first]), count, 0)
        return max(0, int(sent))


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
    magazine = Magazine(datagrams, target)
    sent = sent_bytes = position = 0
    answers: list[int] = []
    began = monotonic()
    forgiven = 0.0
    while (now := monotonic()) < began + seconds:
        due = int((now - began - forgiven) * rate)
        if due - sent > rate * _LONGEST_DEBT:
            forgiven += (due - sent) / rate - _LONGEST_DEBT
            due = int((now - began - forgiven) * rate)
        while sent < due:
            taken = magazine.fire(gun.fileno(), position, min(BATCH, due - sent))
            if not taken:
                break
            sent_bytes += sum(sizes[position : position + taken])
            sent += taken
            position = (position + taken) % len(sizes)
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
