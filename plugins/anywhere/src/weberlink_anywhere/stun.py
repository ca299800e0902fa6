"""Asks STUN servers which kind of NAT this host is behind, and whether UDP passes at all."""

import socket
from collections.abc import Sequence
from contextlib import suppress
from time import monotonic
from typing import NamedTuple

from aioice import stun

from weberlink.protocol.events import Address
from weberlink_anywhere.nat import Nat, Question, Reply, examine
from weberlink_anywhere.sockets import RUBBISH

PAUSES_S: Sequence[float] = (0.3, 0.5, 0.8)
"""Time after each request of the first question; no answer within their sum is none."""
LEAST_PAUSE_S, ROUND_TRIPS = 0.3, 4.0
"""After each request of the others: this long, or so many round trips."""
TCP_S = 2.0
LONGEST_MESSAGE = 2048
_CHANGE_ADDRESS, _CHANGE_PORT = 0x4, 0x2
"""Flags of CHANGE-REQUEST (RFC 5780 section 7.2)."""


class WayOut(NamedTuple):
    """What the servers told; `nat` is None if none answered by UDP, then `by_tcp` are those that take connections."""

    nat: Nat | None
    unresolved: tuple[str, ...] = ()
    by_tcp: tuple[str, ...] = ()


def find_way_out(servers: Sequence[Address]) -> WayOut:
    """Ask the servers, one question after the other; takes up to some seconds where answers do not come."""
    numeric: list[Address] = []
    unresolved = []
    for host, port in dict.fromkeys(servers):
        try:
            # One family for all: mappings of different families cannot be compared.
            found = socket.getaddrinfo(host, port, family=socket.AF_INET, type=socket.SOCK_DGRAM)
            numeric.append((str(found[0][4][0]), int(found[0][4][1])))
        except OSError:
            unresolved.append(host)
    nat = _talk(list(dict.fromkeys(numeric))) if numeric else None
    by_tcp = () if nat is not None else tuple(_named(server) for server in dict.fromkeys(servers) if _takes_tcp(server))
    return WayOut(nat, tuple(unresolved), by_tcp)


def _talk(servers: Sequence[Address]) -> Nat | None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bound.bind(("", 0))
        talk = examine((_own_address(servers[0]), bound.getsockname()[1]), servers)
        question, pauses = next(talk), PAUSES_S
        while True:
            asked_at = monotonic()
            reply = _ask(bound, question, pauses)
            if reply is not None and pauses is PAUSES_S:
                pauses = (max(LEAST_PAUSE_S, ROUND_TRIPS * (monotonic() - asked_at)),) * len(PAUSES_S)
            try:
                question = talk.send(reply)
            except StopIteration as end:
                nat: Nat | None = end.value
                return nat


def _own_address(server: Address) -> str:
    """Address of this host towards a server; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as way, suppress(OSError):
        way.connect(server)
        return str(way.getsockname()[0])
    return ""


def _ask(bound: socket.socket, question: Question, pauses: Sequence[float]) -> Reply | None:
    flags = question.from_other_address * _CHANGE_ADDRESS | question.from_other_port * _CHANGE_PORT
    request = stun.Message(
        stun.Method.BINDING, stun.Class.REQUEST, attributes={"CHANGE-REQUEST": flags} if flags else None
    )
    for pause in pauses:
        with suppress(OSError):  # no route, or refused: as good as no answer
            bound.sendto(bytes(request), question.server)
        until = monotonic() + pause
        while (left := until - monotonic()) > 0.0:
            bound.settimeout(left)
            try:
                data, source = bound.recvfrom(LONGEST_MESSAGE)
                answer = stun.parse_message(data)
            except (OSError, *RUBBISH):  # among them a timeout and an ICMP error
                continue
            if answer.transaction_id == request.transaction_id and answer.message_class is stun.Class.RESPONSE:
                mapped = answer.attributes.get("XOR-MAPPED-ADDRESS") or answer.attributes.get("MAPPED-ADDRESS")
                if mapped is not None:
                    return Reply(mapped, (source[0], source[1]), answer.attributes.get("OTHER-ADDRESS"))
    return None


def _takes_tcp(server: Address) -> bool:
    try:
        socket.create_connection(server, TCP_S).close()
    except OSError:
        return False
    return True


def _named(server: Address) -> str:
    host, port = server
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
