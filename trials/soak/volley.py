"""Floods: the datagrams that somebody without the key, or with a recording, can send, and a process that sends them.

It sends to one address at a given rate, paced by the millisecond, and counts the answers.
"""

import os
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from random import Random
from time import monotonic, sleep
from typing import Any

from weberlink.protocol.handshake import HELLO_FIELDS, HELLO_HEADER, Hello, pack_hello, read_fields, read_map
from weberlink.protocol.psk import PresharedKey
from weberlink.protocol.wire import CLEAR_BYTES, SEQUENCE_MASK, Kind, sequence_of

KINDS = ("forged", "replayed", "truncated", "random", "handshake", "calls")
ROUNDS = 1024
_LONGEST_RANDOM = 1400  # what a network carries
_PROOF = 16


def load(kind: str, genuine: Sequence[bytes], random: Random, key: bytes, calls: int = ROUNDS) -> list[bytes]:
    sealed = [data for data in genuine if data[0] not in (Kind.HELLO, Kind.WELCOME)]
    if kind in ("forged", "replayed", "truncated") and not sealed:
        raise ValueError(f"{kind}: nothing genuine was recorded to make it of")
    match kind:
        case "forged":  # the shape of genuine datagrams, newer numbers, other contents
            newest = sequence_of(sealed[-1])
            forged = []
            for _ in range(ROUNDS):
                like, number = random.choice(sealed), newest + random.randint(1, 200)
                head = like[:1] + (number & SEQUENCE_MASK).to_bytes(CLEAR_BYTES - 1, "little")
                forged.append(head + random.randbytes(len(like) - len(head)))
            return forged
        case "replayed":
            return list(sealed[-ROUNDS:])
        case "truncated":
            return [cut[: random.randrange(1, len(cut))] for cut in random.choices(sealed, k=ROUNDS)]
        case "random":
            return [random.randbytes(random.randint(1, _LONGEST_RANDOM)) for _ in range(ROUNDS)]
        case "handshake":  # HELLOs without proof of the key
            return [call[:-_PROOF] + random.randbytes(_PROOF) for call in _calls(genuine, key, random, calls)]
        case "calls":  # HELLOs with it, as someone has who recorded very many calls
            return _calls(genuine, key, random, calls)
    raise ValueError(kind)


def _calls(genuine: Sequence[bytes], key: bytes, random: Random, count: int) -> list[bytes]:
    """HELLOs like a genuine one, of as many calls with the key, whose answers nobody can use any more."""
    security, size = PresharedKey(key), HELLO_HEADER.size
    hello = next((data for data in genuine if data[0] == Kind.HELLO), None)
    heard = None if hello is None else security.hear(hello[:size], hello[size:])
    fields = None if heard is None else read_fields(read_map(heard[0]) or {}, HELLO_FIELDS)
    if hello is None or fields is None:
        raise ValueError("no genuine HELLO was recorded to make others of")
    payload = pack_hello(Hello(*fields), security.overhead)
    *header, stamp = HELLO_HEADER.unpack_from(hello)
    calls, first = [], max(1, stamp - count)
    for rising in range(first, first + count):  # as those of a recording
        packed = HELLO_HEADER.pack(*header, rising)
        calls.append(packed + security.call(packed, random.randbytes(security.private_size), payload)[0])
    return calls


Address = tuple[str, int]
PRIORITY = 30  # of SCHED_FIFO, below the daemons and the relay: a flood does not wait for a processor of this host
_PACE = 0.001
_LONGEST_DEBT = 0.05  # what a stall of this process may make up for at once [s]; the rest of it is not sent


def fire(datagrams: Sequence[bytes], target: Address, source: Address, rate: int, seconds: float) -> dict[str, int]:
    """Send for a time; returns what was sent, and what was answered."""
    gun = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    gun.bind(source)
    gun.setblocking(False)
    sent, sent_bytes, due, answers = 0, 0, 0.0, list[int]()
    now = began = monotonic()
    while now < began + seconds:
        before, now = now, monotonic()
        due = min(due + (now - before) * rate, _LONGEST_DEBT * rate)
        with suppress(OSError):  # the buffer is full
            while due >= 1.0:
                sent_bytes += gun.sendto(datagrams[sent % len(datagrams)], target)
                sent, due = sent + 1, due - 1.0
        answers += _heard(gun)
        sleep(_PACE)
    sleep(0.2)
    answers += _heard(gun)
    gun.close()
    return {
        "sent": sent,
        "sent_bytes": sent_bytes,
        "answers": len(answers),
        "answered_bytes": sum(answers),
        "longest_answer": max(answers, default=0),
        "shortest_question": min(map(len, datagrams)),
    }


def _heard(gun: socket.socket) -> list[int]:
    sizes = []
    while True:
        try:
            sizes.append(len(gun.recv(65_535)))
        except (BlockingIOError, ConnectionError):
            return sizes


@contextmanager
def volley(*order: object) -> Iterator[Connection]:
    """A process that has begun to fire, with the arguments of `fire`; its figures come through the pipe."""
    context = get_context("spawn")
    figures, theirs = context.Pipe()
    gun = context.Process(target=_serve, args=(theirs, *order), daemon=True)
    gun.start()
    theirs.close()
    try:
        figures.recv()
        yield figures
    finally:
        gun.kill()
        gun.join()
        figures.close()


def _serve(figures: Connection, *order: Any) -> None:
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    figures.send("ready")
    figures.send(fire(*order))
