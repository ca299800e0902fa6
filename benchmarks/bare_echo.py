"""The limit of an update's way: the same number of bytes through plain blocking sockets, with nothing before or behind.

A process of its own, asking or answering (`benchmarks.echo`).
"""

import gc
import json
import os
import socket
import sys
from signal import SIGHUP
from struct import Struct
from time import monotonic_ns

from benchmarks.arrangement import tell
from benchmarks.echo import ASK
from benchmarks.rights import Rights
from weberlink.realtime import timerfd
from weberlink.realtime.process import die_with_parent

HOST = "127.0.0.1"
SIZE = 48
"""Of a force update with history and tag, the longest of three axes [B]."""
NUMBER = Struct("<Q")
PATIENCE_S = 1.0

Moments = dict[int, tuple[int, int]]


def ask(port: int, rate_hz: float, count: int) -> Moments:
    """Send a question at every deadline and wait for its answer; then say that it was the last."""
    moments: Moments = {}
    period = round(1e9 / rate_hz)
    fd = timerfd.create()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        plain.connect((HOST, port))
        # The kernel's own limit: one of Python's would make the socket another kind, that polls.
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, Struct("ll").pack(int(PATIENCE_S), 0))
        try:
            os.set_blocking(fd, True)
            timerfd.arm(fd, monotonic_ns() + period, period)
            for number in range(count):
                timerfd.expirations(fd)
                question = NUMBER.pack(number).ljust(SIZE, b"\0")
                began = monotonic_ns()
                plain.send(question)
                try:
                    answer = plain.recv(SIZE + 1)
                except BlockingIOError:  # lost
                    continue
                ended = monotonic_ns()
                if answer == question:
                    moments[number] = began, ended
        finally:
            os.close(fd)
            plain.send(b"")
    return moments


def answer(plain: socket.socket) -> Moments:
    """Send back what comes until an empty datagram comes."""
    moments: Moments = {}
    while True:
        question, source = plain.recvfrom(SIZE + 1)
        there = monotonic_ns()
        if not question:
            return moments
        back = monotonic_ns()
        plain.sendto(question, source)
        moments[NUMBER.unpack_from(question)[0]] = there, back


def main(text: str) -> int:
    order = json.loads(text)
    die_with_parent(SIGHUP, order["parent"])
    asks = order["end"] == ASK
    Rights(**order["rights"]).take(0 if asks else 1)
    gc.disable()
    if asks:
        moments = ask(order["port"], order["rate_hz"], order["warm_up"] + order["questions"])
    else:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
            plain.bind((HOST, 0))
            tell(f"{plain.getsockname()[1]}\n")
            moments = answer(plain)
    tell(json.dumps(moments))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
