"""Which kind of NAT a host is behind, from the answers of STUN servers (RFC 5780), sans I/O.

Mapping: whether datagrams to different destinations leave the NAT with the same address and port. Filtering: whose
datagrams the NAT lets in. A server that has two addresses and two ports tells both (section 4.3 and 4.4). Several
servers with one address each tell a part: what a pair of answers rules out is ruled out, and the rest stays open.
"""

from collections.abc import Generator, Sequence
from enum import StrEnum
from itertools import combinations
from typing import NamedTuple

from weberlink.protocol.events import Address


class Behaviour(StrEnum):
    """What a mapping or a filter depends on (RFC 4787 sections 4.1 and 5)."""

    INDEPENDENT = "endpoint-independent"
    ADDRESS = "address-dependent"
    ADDRESS_AND_PORT = "address-and-port-dependent"


ANY = frozenset(Behaviour)


class Question(NamedTuple):
    """A Binding request, always from the same local socket; may ask for an answer from another address or port."""

    server: Address
    from_other_address: bool = False
    from_other_port: bool = False


class Reply(NamedTuple):
    """A Binding response from `source`: our address as the server saw it, and its own other address and port."""

    mapped: Address
    source: Address
    other: Address | None = None


class Nat(NamedTuple):
    """What is known of the way out; `mapping` and `filtering` are the behaviours that the answers leave possible."""

    server: Address
    mapped: Address
    is_translated: bool
    mapping: frozenset[Behaviour]
    filtering: frozenset[Behaviour]

    @property
    def needs_relay(self) -> bool | None:
        """Whether a peer behind a NAT like this one can be reached by a relay only; None if that is not known."""
        if self.mapping == {Behaviour.INDEPENDENT}:
            return False
        return None if Behaviour.INDEPENDENT in self.mapping else True


Talk = Generator[Question, Reply | None, Nat | None]


def examine(local: Address, servers: Sequence[Address]) -> Talk:
    """Find out the kind of NAT: yields questions, takes the reply to each, or None for none.

    Args:
        local: address of the socket that asks.
        servers: numeric addresses of STUN servers; the more, the more can be told.

    Returns:
        None if no server answers.
    """
    for index, server in enumerate(servers):
        reply = yield Question(server)
        if reply is not None:
            # Filtering comes first: a question to the other address would open the filter for its answers.
            filtering = yield from _filtering(server, reply)
            # Ends of the server that differ from the first in the address, and in both.
            ends = [] if reply.other is None else [(reply.other[0], server[1]), reply.other]
            others = [*ends, *servers[index + 1 :]]
            mapping = yield from _mapping(server, reply, others)
            is_translated = reply.mapped != local
            mapping = mapping if is_translated else frozenset({Behaviour.INDEPENDENT})
            return Nat(server, reply.mapped, is_translated, mapping, filtering)
    return None


def _filtering(server: Address, first: Reply) -> Generator[Question, Reply | None, frozenset[Behaviour]]:
    if first.other is None:
        return ANY
    reply = yield Question(server, from_other_address=True, from_other_port=True)
    if reply is not None:
        return frozenset({Behaviour.INDEPENDENT}) if reply.source[0] != server[0] else ANY
    reply = yield Question(server, from_other_port=True)
    if reply is not None:
        return frozenset({Behaviour.ADDRESS}) if reply.source != server else ANY
    return frozenset({Behaviour.ADDRESS_AND_PORT})


def _mapping(
    server: Address, first: Reply, others: Sequence[Address]
) -> Generator[Question, Reply | None, frozenset[Behaviour]]:
    mapped = {server: first.mapped}
    possible = ANY
    for other in others:
        if other in mapped:
            continue
        reply = yield Question(other)
        if reply is None:
            continue
        mapped[other] = reply.mapped
        for one, two in combinations(mapped, 2):
            possible &= _left(one, two, is_same=mapped[one] == mapped[two])
        if len(possible) == 1:
            break
    return possible


def _left(one: Address, two: Address, *, is_same: bool) -> frozenset[Behaviour]:
    """The behaviours for which the mappings towards two destinations are, or are not, the same."""
    if one[0] == two[0]:
        return ANY - {Behaviour.ADDRESS_AND_PORT} if is_same else frozenset({Behaviour.ADDRESS_AND_PORT})
    return frozenset({Behaviour.INDEPENDENT}) if is_same else ANY - {Behaviour.INDEPENDENT}
